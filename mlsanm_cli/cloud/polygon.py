"""Point-in-polygon test and polygon area."""

from __future__ import annotations

import numpy as np

from mlsanm_cli.arrays import BoolArray, FloatArray

BATCH_SIZE = 2**18
"""Point-edge pairs processed at once: large for speed, small for memory."""


def inside_polygon(edges: FloatArray, points: FloatArray) -> BoolArray:
    """Mask (n,) of ``points`` (n, 2) inside closed loops of ``edges`` (e, 4), by the even-odd rule."""
    x0, y0, x1, y1 = edges[edges[:, 1] != edges[:, 3]].T
    inside = np.zeros(len(points), dtype=bool)
    step = max(1, BATCH_SIZE // max(1, len(x0)))
    for first in range(0, len(points), step):
        x, y = points[first : first + step].T
        # Few edges cross the level of a point: only for these is the intersection computed.
        point, edge = np.nonzero((y0 > y[:, None]) != (y1 > y[:, None]))
        crossing = x0[edge] + (y[point] - y0[edge]) / (y1[edge] - y0[edge]) * (x1[edge] - x0[edge])
        odd = np.bincount(point[x[point] < crossing], minlength=len(x)) % 2
        inside[first : first + step] = odd == 1
    return inside


def signed_area(points: FloatArray) -> float:
    """Area of a closed polygon ``points`` (k, 2), negative if clockwise."""
    x, y = (points - points[0]).T
    return 0.5 * float((x * np.roll(y, -1) - np.roll(x, -1) * y).sum())
