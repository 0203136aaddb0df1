"""Bodies of revolution about the line x = 0: distances from the axis and images behind it."""

from __future__ import annotations

import numpy as np

from mlsanm_cli.arrays import BoolArray, FloatArray, IntArray
from mlsanm_cli.roundoff import ROUND_OFF


def radius_of(points: FloatArray, nodes: FloatArray) -> FloatArray:
    """Distances (e,) of ``points`` (e, 2) from the axis, 0 up to round-off of a body's ``nodes`` (n, 2)."""
    x = points[:, 0]
    return np.where(x > ROUND_OFF * np.abs(nodes).max(), x, 0.0)


def at_axis(points: FloatArray, revolved: bool) -> BoolArray | None:
    """Mask (m,) of the ``points`` (m, 2) of a contact that are on the axis; None in plane scenes."""
    return np.asarray(radius_of(points, points) == 0.0) if revolved else None


def imaged(points: FloatArray, edges: IntArray) -> IntArray:
    """Numbers (g,) of the nodes ``points`` (n, 2) whose images behind the axis continue the body: those
    opposite to ``edges`` (b, 2) of its outline on the axis."""
    radius, beside = radius_of(points, points), np.zeros(len(points), dtype=bool)
    for low, high in np.sort(points[edges[(radius[edges] == 0.0).all(axis=1)], 1], axis=1):
        beside |= (points[:, 1] >= low) & (points[:, 1] <= high)
    return np.flatnonzero(beside & (radius > 0.0))


def with_images(points: FloatArray, own: IntArray) -> FloatArray:
    """The nodes ``points`` (n, 2) and the images of the nodes ``own`` (g,) behind the axis."""
    return np.concatenate([points, points[own] * np.array([-1.0, 1.0])])
