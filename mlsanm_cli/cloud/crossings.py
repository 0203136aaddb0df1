"""Outlines that cross themselves."""

from __future__ import annotations

import numpy as np

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.startup import cKDTree


def first_crossing(chords: FloatArray) -> FloatArray | None:
    """A point (2,) near the crossing of two ``chords`` (e, 4), or None; sharing an end is no crossing."""
    start, end = chords[:, :2], chords[:, 2:]
    reach = float(np.hypot(*(end - start).T).max())
    pairs = cKDTree(0.5 * (start + end)).query_pairs(reach, output_type="ndarray")
    a, b, c, d = start[pairs[:, 0]], end[pairs[:, 0]], start[pairs[:, 1]], end[pairs[:, 1]]
    apart = (_side(a, b, c) * _side(a, b, d) < 0.0) & (_side(c, d, a) * _side(c, d, b) < 0.0)
    if not apart.any():
        return None
    first = int(np.argmax(apart))
    middle: FloatArray = 0.25 * (a + b + c + d)[first]
    return middle


def _side(a: FloatArray, b: FloatArray, c: FloatArray) -> FloatArray:
    u, v = b - a, c - a
    return np.asarray(u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0])
