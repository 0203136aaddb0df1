"""Points in polygons."""

from __future__ import annotations

import numpy as np

from mlsanm_cli.arrays import BoolArray, FloatArray


def inside_polygon(edges: FloatArray, points: FloatArray) -> BoolArray:
    """Even-odd rule for ``points`` (n, 2) among ``edges`` (e, 4), which form closed loops."""
    inside = np.zeros(len(points), dtype=bool)
    for x0, y0, x1, y1 in edges:
        if y0 != y1:
            crosses = (y0 > points[:, 1]) != (y1 > points[:, 1])
            inside ^= crosses & (points[:, 0] < x0 + (points[:, 1] - y0) / (y1 - y0) * (x1 - x0))
    return inside
