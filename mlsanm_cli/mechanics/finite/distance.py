"""How far a body at finite strain has deformed since its equations were made."""

from __future__ import annotations

import numpy as np

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.mechanics.finite.body import FiniteBody

MAX_STRETCH = 1.25
"""Stretch of a node, or its inverse, relative to the expansion point above which the equations are renewed at
the end of a step. A block of 289 nodes compressed by 40 % between sticking platens took 24 steps without
renewal, and at degree 4 followed another branch; with renewal two steps, from 1.15 as from 1.5."""
MAX_ROTATION = 1.2
"""Or a rotation above this angle: J_0^T W^2 J(u) changes its sign with rotations beyond a right angle. A
column that buckled until its end had turned by 100 degrees met spurious limit points, and returned to
negative loads."""


def far_from(body: FiniteBody, displacement: FloatArray, station: FloatArray) -> bool:
    """Whether a body of a ``displacement`` (2N,) is so far from the ``station`` (2N,) of its equations that
    these are renewed: stretched, or turned, somewhere."""
    if most_stretched(body, displacement, station) > MAX_STRETCH:
        return True
    angles = []
    for one in (displacement, station):
        xx, xy, yx, yy = body.gradient(one)
        angles.append(np.arctan2(yx - xy, 2.0 + xx + yy))
    turned = np.abs(np.exp(1j * angles[0]) - np.exp(1j * angles[1])).max()
    return bool(turned > 2.0 * np.sin(0.5 * MAX_ROTATION))


def most_stretched(body: FiniteBody, displacement: FloatArray, station: FloatArray) -> float:
    """By how much a node is stretched at most between the ``station`` (2N,) and a ``displacement`` (2N,), or
    1 over by how little."""
    now, then = (
        (body.gradient(u) + np.array([1.0, 0.0, 0.0, 1.0])[:, None]).T.reshape(-1, 2, 2)
        for u in (displacement, station)
    )
    ratios = np.linalg.svd(now @ np.linalg.inv(then), compute_uv=False)
    return float(max(ratios.max(), 1.0 / ratios.min()))
