"""Triangulation of a cloud: for pictures, quality figures and checks, never for shape functions."""

from __future__ import annotations

import numpy as np
from scipy.spatial import Delaunay

from mlsanm_cli.arrays import FloatArray, IntArray
from mlsanm_cli.cloud.membership import inside_polygon, twice_area
from mlsanm_cli.cloud.sight import VisibilityCriterion
from mlsanm_cli.roundoff import ROUND_OFF


def triangulate(points: FloatArray, edges: IntArray, sight: VisibilityCriterion | None) -> IntArray:
    """Delaunay triangles (t, 3), counter-clockwise, of ``points`` (n, 2) inside loops of ``edges`` (e, 2).
    Triangles across slits are removed by ``sight``."""
    placed = points if sight is None else sight.opened
    triangles = np.asarray(Delaunay(placed).simplices, dtype=np.int64)
    a, b, c = (points[triangles[:, corner]] for corner in range(3))
    twice = twice_area(a, b, c)
    triangles[twice < 0.0] = triangles[twice < 0.0][:, ::-1]
    # Only triangles of three boundary nodes can lie outside, across a hollow or flat along a curve. Where
    # slits are opened: drawn, those next to a slit's end may turn about and lie over their neighbours.
    on_boundary = np.zeros(len(points), dtype=bool)
    on_boundary[edges] = True
    outside = np.abs(twice) <= ROUND_OFF * ((b - a) ** 2).sum(axis=1)
    doubtful = np.flatnonzero(on_boundary[triangles].all(axis=1) & ~outside)
    centers = placed[triangles[doubtful]].mean(axis=1)
    outside[doubtful] = ~inside_polygon(placed[edges].reshape(-1, 4), centers)
    inner: IntArray = triangles[~outside]
    if sight is not None:
        ends = np.roll(inner, -1, axis=1)
        inner = inner[~np.any([sight.apart(inner[:, side], ends[:, side]) for side in range(3)], axis=0)]
    return inner
