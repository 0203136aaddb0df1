"""Separation of the nodes of a cloud, and the width of the body at its boundary."""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from mlsanm_cli.arrays import FloatArray, IntArray
from mlsanm_cli.cloud.search import nearest as nearest_nodes
from mlsanm_cli.cloud.sight import VisibilityCriterion

NEIGHBORS = 6
MAX_FACING, OPPOSITE_COSINE = 32, 0.9
"""Nearest boundary nodes searched for one on the opposite side, and the least -n1.n2 of such a pair."""


def separation(
    points: FloatArray,
    tree: cKDTree,
    spacing: FloatArray,
    sight: VisibilityCriterion | None,
    room: FloatArray,
) -> tuple[FloatArray, float]:
    """Distance (n,) of ``points`` (n, 2) from the nearest other one over the ``spacing`` (n,), at most
    ``room`` (n,) between the faces of acute corners, and the largest spacing difference of neighbours over
    their distance. ``tree`` finds neighbours; pairs that ``sight`` hides from each other across a slit do not
    count."""
    count = min(NEIGHBORS, len(points) - 1)
    distance, found = nearest_nodes(tree, points, np.arange(2, count + 2))
    neighbour = np.asarray(found, dtype=np.int64)
    if sight is not None:
        one = np.repeat(np.arange(len(neighbour)), count)
        distance[sight.apart(one, neighbour.ravel()).reshape(neighbour.shape)] = np.inf
    growth = np.abs(spacing[neighbour] - spacing[:, None]) / distance
    return np.asarray(distance.min(axis=1) / np.minimum(spacing, room)), float(growth.max())


def widths(points: FloatArray, index: IntArray, normal: FloatArray) -> FloatArray:
    """Width (n,) of a body of ``points`` (n, 2) at its boundary nodes ``index`` (b,) with outward ``normal``
    (b, 2), infinite elsewhere: the diameter of the smallest circle inside that touches the boundary at the
    node and passes through another one on the opposite side."""
    at = points[index]
    count = min(MAX_FACING, len(index) - 1)
    near = np.asarray(nearest_nodes(cKDTree(at), at, np.arange(2, count + 2))[1], dtype=np.int64)
    away = at[:, None] - at[near]
    depth = (away * normal[:, None]).sum(axis=2)
    across = (depth > 0.0) & ((normal[near] * normal[:, None]).sum(axis=2) < -OPPOSITE_COSINE)
    width = np.full(near.shape, np.inf)
    np.divide((away**2).sum(axis=2), depth, out=width, where=across)
    least = np.full(len(points), np.inf)
    np.minimum.at(least, index, width.min(axis=1))
    return least
