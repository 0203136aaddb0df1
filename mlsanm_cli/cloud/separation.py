"""Separation of the nodes of a cloud, and the number of nodes across the body's thinnest part."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mlsanm_cli.arrays import FloatArray, IntArray
from mlsanm_cli.cloud.search import nearest as nearest_nodes
from mlsanm_cli.cloud.sight import VisibilityCriterion
from mlsanm_cli.startup import cKDTree

NEIGHBORS = 6
MAX_FACING, OPPOSITE_COSINE = 32, 0.9
"""Nearest boundary nodes searched for one on the opposite side, and the least -n1.n2 of such a pair."""


@dataclass(frozen=True)
class NodeSeparation:
    """``closest``: smallest distance to another node over the local spacing, attained at ``node``;
    ``growth``: largest spacing difference of neighbours over their distance."""

    node: int
    closest: float
    growth: float


def separation(
    points: FloatArray,
    tree: cKDTree,
    spacing: FloatArray,
    sight: VisibilityCriterion | None,
    room: FloatArray,
) -> NodeSeparation:
    """Separation of ``points`` (n, 2) with ``spacing`` (n,), at most ``room`` (n,) between the faces of acute
    corners, and search ``tree``; pairs that ``sight`` hides from each other across a slit do not count."""
    count = min(NEIGHBORS, len(points) - 1)
    distance, found = nearest_nodes(tree, points, np.arange(2, count + 2))
    neighbour = np.asarray(found, dtype=np.int64)
    if sight is not None:
        one = np.repeat(np.arange(len(neighbour)), count)
        distance[sight.apart(one, neighbour.ravel()).reshape(neighbour.shape)] = np.inf
    nearest = distance.min(axis=1) / np.minimum(spacing, room)
    node = int(np.argmin(nearest))
    growth = np.abs(spacing[neighbour] - spacing[:, None]) / distance
    return NodeSeparation(node, float(nearest[node]), float(growth.max()))


@dataclass(frozen=True)
class Thinnest:
    """The thinnest part of a body: ``width``, the number of ``spacings`` across it, and a boundary ``node``
    there; infinite where no part is thin enough to be found."""

    node: int
    spacings: float
    width: float


def thinnest(points: FloatArray, spacing: FloatArray, index: IntArray, normal: FloatArray) -> Thinnest:
    """The thinnest part of a body of ``points`` (n, 2) with ``spacing`` (n,), from its boundary nodes
    ``index`` (b,) with outward ``normal`` (b, 2). Its width is the diameter of the circle inside that touches
    the boundary at one node and passes through another one."""
    at = points[index]
    count = min(MAX_FACING, len(index) - 1)
    near = np.asarray(nearest_nodes(cKDTree(at), at, np.arange(2, count + 2))[1], dtype=np.int64)
    away = at[:, None] - at[near]
    depth = (away * normal[:, None]).sum(axis=2)
    across = (depth > 0.0) & ((normal[near] * normal[:, None]).sum(axis=2) < -OPPOSITE_COSINE)
    width = np.full(near.shape, np.inf)
    np.divide((away**2).sum(axis=2), depth, out=width, where=across)
    least = width.min(axis=1)
    found = int((least / spacing[index]).argmin())
    return Thinnest(int(index[found]), float(least[found] / spacing[index[found]]), float(least[found]))
