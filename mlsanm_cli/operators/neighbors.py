"""Nearest neighbours of a point that are visible from it."""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from mlsanm_cli.arrays import FloatArray, IndexArray, IntArray
from mlsanm_cli.cloud.search import nearest
from mlsanm_cli.cloud.sight import VisibilityCriterion
from mlsanm_cli.errors import NumericalError
from mlsanm_cli.operators.settings import ONE_SIDED_RADIUS, MlsSettings

EXTRA_NODES = 8
"""Extra nodes searched where more are equidistant than a stencil takes."""
TIE_TOLERANCE = 1e-7
"""Relative tolerance for equal distances."""
CENTERED, HALF_DISK = 0.25, 4.0 / (3.0 * np.pi)
"""Distance of a stencil's mean node from its target, in radii: inside, and at a straight boundary."""


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
        asked = np.flatnonzero(sight.near(targets, radius))
        radius[asked], indices[asked] = _visible(points, sight, tree, targets[asked], size)
    return radius, indices


def weight_radius(
    points: FloatArray, targets: FloatArray, radius: FloatArray, indices: IntArray, settings: MlsSettings
) -> FloatArray:
    """Radii (e,) of the weights for stencils of ``radius`` (e,) and node numbers ``indices`` (e, k) around
    the ``targets`` (e, 2): smaller where these are one-sided, as at the boundary."""
    if not settings.narrows:
        return radius
    away = points[indices].mean(axis=1) - targets
    offset = np.hypot(away[:, 0], away[:, 1]) / radius
    share = np.clip((offset - CENTERED) / (HALF_DISK - CENTERED), 0.0, 1.0)
    return np.asarray(radius * (1.0 - (1.0 - ONE_SIDED_RADIUS) * share))


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


def _visible(
    points: FloatArray, sight: VisibilityCriterion, tree: cKDTree, targets: FloatArray, size: int
) -> tuple[FloatArray, IntArray]:
    """Radii (e,) and numbers (e, size) of the nearest nodes not hidden by a slit."""
    indices = np.empty((len(targets), size), dtype=np.int64)
    pending, asked, nodes = np.arange(len(targets)), min(size, len(points)), len(points)
    while len(pending):
        some = targets[pending]
        numbers = _nearest(points, tree, some, asked, nearest_nodes(tree, some, asked))[1]
        seen = ~sight.cut(targets[pending], numbers)
        enough = seen.sum(axis=1) >= size
        # Stable: visible nodes first, still sorted by distance.
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
