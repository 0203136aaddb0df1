"""Settings of local fits, and the nearest neighbours of a point that are visible from it."""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from mlsanm_cli.arrays import FloatArray, IndexArray, IntArray
from mlsanm_cli.cloud.cloud import nearest
from mlsanm_cli.cloud.sight import VisibilityCriterion
from mlsanm_cli.errors import NumericalError
from mlsanm_cli.records import dataclass

NEIGHBORS = {1: 9, 2: 16, 3: 24, 4: 34, 5: 46, 6: 60}
"""Neighbours per stencil by degree: about 2.5 per polynomial coefficient."""

WEIGHT_EXPONENT = 4.0
"""Rows of a local fit are multiplied by exp(-WEIGHT_EXPONENT r^2), r the distance over the radius."""

ONE_SIDED_RADIUS, ONE_SIDED_DEGREE = 0.9, 4
"""Factor on this radius at boundary nodes, whose stencils reach farther, from this degree on."""
EXTRA_NODES = 8
"""Extra nodes searched where more are equidistant than a stencil takes."""
TIE_TOLERANCE = 1e-7
"""Relative tolerance for equal distances."""


@dataclass(frozen=True)
class MlsSettings:
    """``degree`` of the local polynomial (1 to 6) and ``neighbors`` per stencil (None: by degree). With
    ``corners`` fits are enriched by singular functions at reentrant corners; with ``narrow`` one-sided fits
    have narrower weights from ONE_SIDED_DEGREE on, and their equilibrium counts less."""

    degree: int = 2
    neighbors: int | None = None
    corners: bool = True
    narrow: bool = True

    @property
    def narrows(self) -> bool:
        """Whether one-sided fits have narrower weights."""
        return self.narrow and self.degree >= ONE_SIDED_DEGREE

    @property
    def coefficients(self) -> int:
        """Number of coefficients of the local polynomial."""
        return (self.degree + 1) * (self.degree + 2) // 2

    @property
    def stencil_size(self) -> int:
        """Neighbours of a stencil before any enlargement."""
        return self.neighbors or NEIGHBORS[self.degree]

    @property
    def rank_tolerance(self) -> float:
        """Smallest accepted ratio of diagonal entries of R; sound stencils lie 20 to 200 times above it."""
        return 10.0 ** -(self.degree + 1)


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
    points: FloatArray, tree: cKDTree, targets: FloatArray, size: int, sight: VisibilityCriterion | None
) -> tuple[FloatArray, IntArray]:
    """Radii (e,) and node numbers (e, size) of stencils: the nearest nodes seen from ``targets`` (e, 2)."""
    radius, indices = _nearest(points, tree, targets, size)
    if sight is not None:
        # The nearest nodes not hidden by a slit.
        pending, nodes = np.flatnonzero(sight.near(targets, radius)), len(points)
        asked = min(size, nodes)
        while len(pending):
            some = targets[pending]
            numbers = _nearest(points, tree, some, asked)[1]
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
    points: FloatArray, tree: cKDTree, targets: FloatArray, size: int
) -> tuple[FloatArray, IntArray]:
    """Radii (e,) and numbers (e, size) of the nearest nodes, ties broken by number, not by round-off."""
    known = nearest_nodes(tree, targets, size)
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
