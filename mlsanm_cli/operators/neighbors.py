"""Nearest neighbours of a point that are visible from it."""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from mlsanm_cli.arrays import FloatArray, IndexArray, IntArray
from mlsanm_cli.cloud.search import nearest
from mlsanm_cli.cloud.sight import VisibilityCriterion
from mlsanm_cli.errors import NumericalError

EXTRA_NODES = 8
"""Extra nodes searched where more are equidistant than a stencil takes."""
TIE_TOLERANCE = 1e-7
"""Relative tolerance for equal distances."""


def nearest_nodes(tree: cKDTree, targets: FloatArray, size: int) -> IndexArray:
    """Numbers (e, k) of the nodes nearest to ``targets`` (e, 2), enough for stencils of ``size`` nodes."""
    distance, found = nearest(tree, targets, np.arange(1, min(size + 1, tree.n) + 1))
    numbers = np.asarray(found, dtype=np.int32)
    # Sort equidistant nodes by number: their order must not depend on how many are searched.
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
    """Radii (e,) and node numbers (e, size) of stencils: the nearest nodes visible from ``targets`` (e, 2). A
    new search is made only if the ``known`` ones (e, k) from :func:`nearest_nodes` do not suffice."""
    if known is None or known.shape[1] <= min(size, len(points) - 1):
        known = nearest_nodes(tree, targets, size)
    radius, indices = _nearest(points, tree, targets, size, known)
    if sight is not None:
        # The nearest nodes not hidden by a slit.
        pending, asked, nodes = (
            np.flatnonzero(sight.near(targets, radius)),
            min(size, len(points)),
            len(points),
        )
        while len(pending):
            some = targets[pending]
            numbers = _nearest(points, tree, some, asked, nearest_nodes(tree, some, asked))[1]
            seen = ~sight.cut(some, numbers)
            enough = seen.sum(axis=1) >= size
            # Stable: visible nodes first, still sorted by distance.
            first = np.argsort(~seen[enough], axis=1, kind="stable")[:, :size]
            done, chosen = pending[enough], np.take_along_axis(numbers[enough], first, axis=1)
            indices[done], radius[done] = chosen, distances(points, targets[done], chosen[:, -1:])[:, 0]
            pending = pending[~enough]
            if len(pending) and asked == nodes:
                x, y = targets[pending[0]]
                raise NumericalError(
                    f"fewer than {size} nodes can be seen from ({x:.6g}, {y:.6g}) past the slits of the body",
                    "make the spacing smaller there",
                )
            asked = min(2 * asked, nodes)
    return radius, indices


def _nearest(
    points: FloatArray, tree: cKDTree, targets: FloatArray, size: int, known: IndexArray
) -> tuple[FloatArray, IntArray]:
    """Radii (e,) and numbers (e, size) of the nearest of the ``known`` nodes (e, k), ties broken by number:
    round-off must not decide."""
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
