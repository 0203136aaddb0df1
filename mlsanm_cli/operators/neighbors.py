"""The nodes nearest to a point, as far as it sees them."""

from __future__ import annotations

import numpy as np

from mlsanm_cli.arrays import FloatArray, IndexArray, IntArray
from mlsanm_cli.cloud.search import nearest
from mlsanm_cli.cloud.sight import VisibilityCriterion
from mlsanm_cli.errors import NumericalError
from mlsanm_cli.startup import cKDTree

EXTRA_NODES = 8
"""Nodes searched in addition to the size of a stencil, as several may have the same distance."""
TIE_TOLERANCE = 1e-7
"""Relative difference below which distances are equal."""


def nearest_nodes(tree: cKDTree, targets: FloatArray, size: int) -> IndexArray:
    """Numbers (e, k) of the nodes nearest to ``targets`` (e, 2), enough for stencils of ``size`` nodes."""
    distance, found = nearest(tree, targets, np.arange(1, min(size + 1, tree.n) + 1))
    numbers = np.asarray(found, dtype=np.int32)
    # Which of equally far nodes comes first must not depend on how many are looked for.
    tied = np.flatnonzero((distance[:, 1:] == distance[:, :-1]).any(axis=1))
    order = np.lexsort((numbers[tied], distance[tied]), axis=1)
    numbers[tied] = np.take_along_axis(numbers[tied], order, axis=1)
    return numbers


def neighbors_of(
    points: FloatArray,
    tree: cKDTree,
    targets: FloatArray,
    size: int,
    sight: VisibilityCriterion | None,
    known: IndexArray | None = None,
) -> tuple[FloatArray, IntArray]:
    """Radii (e,) and numbers (e, size) of stencils, the nearest nodes that the ``targets`` (e, 2) see.

    They are searched for where those ``known`` (e, k), by :func:`nearest_nodes`, are not enough.
    """
    if known is None or known.shape[1] <= min(size, len(points) - 1):
        known = nearest_nodes(tree, targets, size)
    radius, indices = _nearest(points, tree, targets, size, known)
    if sight is not None:
        asked = np.flatnonzero(sight.near(targets, radius))
        radius[asked], indices[asked] = _seen(points, sight, tree, targets[asked], size)
    return radius, indices


def _nearest(
    points: FloatArray, tree: cKDTree, targets: FloatArray, size: int, known: IndexArray
) -> tuple[FloatArray, IntArray]:
    """Radii (e,) and numbers (e, size) of the nearest of the ``known`` nodes (e, k), equally far ones by
    their numbers.

    Without that rule round-off would choose among equals, and a change of units would change the result.
    """
    indices = known[:, :size].astype(np.int64)
    radius = distances(points, targets, known[:, size - 1 : size])[:, 0]
    if known.shape[1] > size:
        beyond = distances(points, targets, known[:, size : size + 1])[:, 0]
        tied = np.flatnonzero(beyond <= (1.0 + TIE_TOLERANCE) * radius)
        if len(tied):
            more = nearest_nodes(tree, targets[tied], size + EXTRA_NODES - 1)
            distance = distances(points, targets[tied], more)
            order = np.argsort(distance * (1.0 + TIE_TOLERANCE * more / len(points)), axis=1)[:, :size]
            indices[tied] = np.take_along_axis(more, order, axis=1)
            radius[tied] = np.take_along_axis(distance, order[:, -1:], axis=1)[:, 0]
    return radius, indices


def distances(points: FloatArray, targets: FloatArray, numbers: IndexArray | IntArray) -> FloatArray:
    """Distances (e, k) of the nodes ``numbers`` (e, k) from each target (e, 2)."""
    away = points[numbers] - targets[:, None]
    return np.sqrt(away[..., 0] ** 2 + away[..., 1] ** 2)


def _seen(
    points: FloatArray, sight: VisibilityCriterion, tree: cKDTree, targets: FloatArray, size: int
) -> tuple[FloatArray, IntArray]:
    """Radii (e,) and numbers (e, size) of the nearest nodes on each target's own side of the slits."""
    indices = np.empty((len(targets), size), dtype=np.int64)
    pending, asked, nodes = np.arange(len(targets)), min(size, len(points)), len(points)
    while len(pending):
        some = targets[pending]
        numbers = _nearest(points, tree, some, asked, nearest_nodes(tree, some, asked))[1]
        seen = ~sight.cut(targets[pending], numbers)
        enough = seen.sum(axis=1) >= size
        # Stable: nodes that are seen come first, still ordered by distance.
        first = np.argsort(~seen[enough], axis=1, kind="stable")[:, :size]
        indices[pending[enough]] = np.take_along_axis(numbers[enough], first, axis=1)
        pending = pending[~enough]
        if len(pending) and asked == nodes:
            x, y = targets[pending[0]]
            raise NumericalError(
                f"fewer than {size} nodes can be seen from ({x:.6g}, {y:.6g}) past the slits of the body",
                "make the spacing smaller there",
            )
        asked = min(2 * asked, nodes)
    return distances(points, targets, indices[:, -1:])[:, 0], indices
