"""Deformation of a body at finite strain since its equations were set up."""

from __future__ import annotations

import numpy as np

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.mechanics.finite.body import FiniteBody

MAX_STRETCH = 1.25
"""The equations are renewed after a step at whose end some node is stretched by more than this, or less than
its inverse, relative to their station. Block of 289 nodes, 40 % down between sticking platens: with those of
the reference throughout 24 steps, at degree 4 onto another branch; renewed, two steps, with 1.15 and with 1.5
alike."""
MAX_ROTATION = 1.2
"""Or rotated by more than this angle: J_0^T W^2 J(u) becomes indefinite for rotations beyond a right angle. A
column buckled to an end rotation of 100 degrees met spurious limit points and returned to negative loads."""


def far_from(body: FiniteBody, displacement: FloatArray, station: FloatArray) -> bool:
    """Whether a body at ``displacement`` (2N,) is stretched or rotated so much relative to the ``station``
    (2N,) that its equations should be renewed."""
    if most_stretched(body, displacement, station) > MAX_STRETCH:
        return True
    angles = []
    for one in (displacement, station):
        xx, xy, yx, yy = body.gradient(one)
        angles.append(np.arctan2(yx - xy, 2.0 + xx + yy))
    turned = np.abs(np.exp(1j * angles[0]) - np.exp(1j * angles[1])).max()
    return bool(turned > 2.0 * np.sin(0.5 * MAX_ROTATION))


def most_stretched(body: FiniteBody, displacement: FloatArray, station: FloatArray) -> float:
    """Largest stretch of a node, or inverse of the smallest, between the ``station`` (2N,) and
    ``displacement`` (2N,)."""
    now, then = (
        (body.gradient(u) + np.array([1.0, 0.0, 0.0, 1.0])[:, None]).T.reshape(-1, 2, 2)
        for u in (displacement, station)
    )
    ratios = np.linalg.svd(now @ np.linalg.inv(then), compute_uv=False)
    return float(max(ratios.max(), 1.0 / ratios.min()))
