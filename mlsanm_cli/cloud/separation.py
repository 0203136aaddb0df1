"""How the nodes of a cloud stand to their nearest ones, and how many there are across its thinnest part."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mlsanm_cli.arrays import FloatArray, IntArray
from mlsanm_cli.cloud.search import nearest as nearest_nodes
from mlsanm_cli.cloud.sight import VisibilityCriterion
from mlsanm_cli.startup import cKDTree

NEIGHBORS = 6
MAX_FACING, OPPOSITE_COSINE = 32, 0.9
"""Boundary nodes among which an opposite one is searched, and cosine of the angle between opposite
normals."""


@dataclass(frozen=True)
class NodeSeparation:
    """``closest``: smallest distance to another node over the local spacing, that of ``node``; ``growth``:
    largest change of spacing per unit distance between neighbours."""

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
    """By the nearest nodes of all ``points`` (n, 2), found in their ``tree``, ``spacing`` (n,) asked for
    there, of which an acute corner leaves no more than ``room`` (n,); those that ``sight`` hides across a
    slit are infinitely far."""
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
    """How many ``spacings`` the thinnest part of a body has across, near the boundary's node ``node``, and
    its ``width``; infinite where none is thin enough to be seen."""

    node: int
    spacings: float
    width: float


def thinnest(points: FloatArray, spacing: FloatArray, index: IntArray, normal: FloatArray) -> Thinnest:
    """Where two sides of a body with ``points`` (n, 2) and ``spacing`` (n,) are closest, with nothing but
    material in between: by its boundary's nodes ``index`` (b,) with outward ``normal`` (b, 2).

    The width is the diameter of the circle that touches the boundary in one node and meets the other.
    """
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
