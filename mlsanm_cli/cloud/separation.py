"""How the nodes of a cloud stand to their nearest ones."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.cloud.search import nearest as nearest_nodes
from mlsanm_cli.cloud.sight import VisibilityCriterion
from mlsanm_cli.startup import cKDTree

NEIGHBORS = 6


@dataclass(frozen=True)
class NodeSeparation:
    """``closest``: smallest distance to another node over the local spacing, that of ``node``; ``growth``:
    largest change of spacing per unit distance between neighbours."""

    node: int
    closest: float
    growth: float


def separation(
    points: FloatArray, tree: cKDTree, spacing: FloatArray, sight: VisibilityCriterion | None
) -> NodeSeparation:
    """By the nearest nodes of all ``points`` (n, 2), found in their ``tree``, ``spacing`` (n,) asked for
    there; those that ``sight`` hides across a slit are infinitely far."""
    count = min(NEIGHBORS, len(points) - 1)
    distance, found = nearest_nodes(tree, points, np.arange(2, count + 2))
    neighbour = np.asarray(found, dtype=np.int64)
    if sight is not None:
        one = np.repeat(np.arange(len(neighbour)), count)
        distance[sight.apart(one, neighbour.ravel()).reshape(neighbour.shape)] = np.inf
    nearest = distance.min(axis=1) / spacing
    node = int(np.argmin(nearest))
    growth = np.abs(spacing[neighbour] - spacing[:, None]) / distance
    return NodeSeparation(node, float(nearest[node]), float(growth.max()))
