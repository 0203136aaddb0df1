"""How far a body at finite strain has deformed since its equations were made."""

from __future__ import annotations

import numpy as np

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.mechanics.finite.body import FiniteBody

RENEW = 1.25
"""The equations are renewed behind a step at whose end some node is stretched by more than this, or by less
than 1 over it, against the state that they are of. Block of 289 nodes, 40 % down
between platens that stick: with those of the reference all along 24 steps, at degree 4 onto another branch;
renewed, two steps, whether from 1.15 or 1.5."""
TURNED = 1.2
"""Or has turned by more than this angle: J_0^T W^2 J(u) loses its sign with rotations beyond a right angle. A
column that buckled until its end had turned by 100 degrees met limit points that there are not, and went back
to negative loads."""


def far_from(body: FiniteBody, displacement: FloatArray, station: FloatArray) -> bool:
    """Whether a body of a ``displacement`` (2N,) is so far from the ``station`` (2N,) of its equations that
    these are renewed: stretched, or turned, somewhere."""
    if most_stretched(body, displacement, station) > RENEW:
        return True
    angles = []
    for one in (displacement, station):
        xx, xy, yx, yy = body.gradient(one)
        angles.append(np.arctan2(yx - xy, 2.0 + xx + yy))
    turned = np.abs(np.exp(1j * angles[0]) - np.exp(1j * angles[1])).max()
    return bool(turned > 2.0 * np.sin(0.5 * TURNED))


def most_stretched(body: FiniteBody, displacement: FloatArray, station: FloatArray) -> float:
    """By how much a node is stretched at most between the ``station`` (2N,) and a ``displacement`` (2N,), or
    1 over by how little."""
    now, then = (
        (body.gradient(u) + np.array([1.0, 0.0, 0.0, 1.0])[:, None]).T.reshape(-1, 2, 2)
        for u in (displacement, station)
    )
    ratios = np.linalg.svd(now @ np.linalg.inv(then), compute_uv=False)
    return float(max(ratios.max(), 1.0 / ratios.min()))
