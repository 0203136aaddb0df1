"""Multifrontal factors with nested-dissection fronts, on top of BLAS and LAPACK: of quasi-definite matrices,
verified, with SuperLU as fallback, and of general ones with a symmetric pattern. Duff and Reid 1983
(doi:10.1145/356044.356047), Liu 1992 (doi:10.1137/1034004). SuperLU (Li 2005, doi:10.1145/1089014.1089017)
in symmetric mode with geometric nested dissection."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Literal, Protocol, TypeAlias

import numpy as np
import scipy.sparse as sparse

from mlsanm_cli.arrays import FloatArray, IndexArray, IntArray
from mlsanm_cli.errors import NumericalError
from mlsanm_cli.kernels.dissection import dissect, places_between
from mlsanm_cli.kernels.multifrontal import borders, factorise
from mlsanm_cli.kernels.substitution import products, solve
from mlsanm_cli.records import dataclass

if TYPE_CHECKING:
    from scipy.sparse.linalg import SuperLU

Matrix: TypeAlias = "sparse.csc_array | sparse.bsr_array"
"""A symmetric matrix, in CSC or block form."""
LinearSolver: TypeAlias = Literal["auto", "superlu"]
"""Direct solver of symmetric systems: own Cholesky factorisation, or SuperLU."""
MAX_ENTRIES = np.iinfo(np.int32).max
"""Largest number of entries with 32-bit indices."""


def structure(matrix: sparse.csr_array | sparse.bsr_array) -> tuple[IndexArray, IndexArray]:
    """Row offsets and column indices of a matrix's entries or blocks. Raises NumericalError for too many."""
    refuse_too_many(int(matrix.indptr[-1]))
    indptr, indices = (part.astype(np.int32, copy=False) for part in (matrix.indptr, matrix.indices))
    return indptr, indices


def refuse_too_many(entries: int) -> None:
    """Raise NumericalError for more ``entries`` than 32-bit indices can count."""
    if entries > MAX_ENTRIES:
        raise NumericalError(
            f"the equations of a body have {entries:.3g} entries, more than the limit of {MAX_ENTRIES:.3g}",
            "make its spacing larger, or mls.degree lower",
        )


class Factor(Protocol):
    """A factorised matrix."""

    @property
    def note(self) -> str:
        """Remark on the factorisation for users; usually ""."""

    def solve(self, rhs: FloatArray) -> FloatArray:
        """Solution for right-hand sides (n,) or (n, c)."""

    def products(self, left: sparse.csr_array, right: sparse.csc_array) -> FloatArray:
        """``left`` (g, n) times the solutions for ``right`` (n, c): (g, c)."""


BLOCK = 64
"""Columns solved at once."""
THRESHOLD = 0.1
"""A diagonal entry is accepted as pivot unless another in its column is 1/THRESHOLD times larger."""
LEAF_SIZE = 16
"""Largest part that is not cut."""
DIRECTIONS = 8
Tree: TypeAlias = tuple[IntArray, IntArray, IntArray]
"""Elimination order (n,) of the vertices, and the tree of fronts: front k of f eliminates vertices
``start[k]`` to ``start[k + 1]`` in this order, which are adjacent to later ones of its ancestors only, with
``parent`` (f,), -1 for the root. Descendants come right before their ancestor."""


def nested_dissection(points: FloatArray, graph: sparse.csr_array | sparse.bsr_array) -> Tree:
    """Nested dissection (George 1973, doi:10.1137/0710032): both halves of the vertices first, the separator
    between them last, bisected at the median of the ``points`` (n, 2) along the one of DIRECTIONS directions
    with the smallest separator. Raises ValueError for a ``graph`` of another number of vertices."""
    if graph.shape[0] != graph.shape[1] or len(graph.indptr) != len(points) + 1:
        raise ValueError(f"a graph of {len(graph.indptr) - 1} vertices for {len(points)} points")
    angles = np.pi * np.arange(DIRECTIONS) / DIRECTIONS
    heights = points @ np.stack([np.cos(angles), np.sin(angles)])
    ranked = np.argsort(heights.T, axis=1, kind="stable").astype(np.int32)
    order = np.empty(len(points), dtype=np.int64)
    begins, parents = np.empty((2, 2 * len(points) + 1), dtype=np.int64)
    count = dissect(*structure(graph), ranked, LEAF_SIZE, order, begins, parents)
    # The kernel numbers fronts, and parents, from last to first.
    parent = parents[:count][::-1]
    start = np.append(begins[:count][::-1], len(points))
    return order, start, np.where(parent >= 0, count - 1 - parent, -1)


class Fronts:
    """The nested dissection of ``points`` (n, 2) with adjacency ``graph``, of which the last ``negative``
    vertices, not adjacent to each other, come last in their fronts, in the format of the kernels.

    ``order`` (n,) of the nodes, ``place`` (n,) its inverse, ``unknowns`` (2n,) in this order; ``start`` (f +
    1,) of the fronts, the number ``negative`` (f,) of their last nodes with negative pivots, their ``parent``
    (f,); ``begin`` (f + 1,) offsets of their borders in ``border``; ``waiting``, peak size of updates.
    """

    def __init__(self, points: FloatArray, graph: sparse.bsr_array, negative: int = 0) -> None:
        count = len(points) - negative
        if negative:
            entries = (np.ones(len(graph.indices), dtype=np.int8), graph.indices, graph.indptr)
            pattern = sparse.csr_array(entries, shape=(len(points), len(points)))[:count, :count]
            order, start, parent = nested_dissection(points[:count], pattern)
            # They join the front where their neighbours' fronts meet: in the dissection they would pull all
            # adjacent vertices into separators.
            front, found = np.empty(count, dtype=np.int64), np.empty(negative, dtype=np.int64)
            front[order] = np.repeat(np.arange(len(parent)), np.diff(start))
            places_between(*structure(graph), count, front, parent, found)
            of_front = np.bincount(found, minlength=len(parent)).astype(np.int64)
            own = np.concatenate([front[order], found])
            order = np.concatenate([order, count + np.arange(negative)])[np.argsort(own, kind="stable")]
            start = start + np.concatenate([[0], np.cumsum(of_front)])
        else:
            order, start, parent = nested_dissection(points, graph)
            of_front = np.zeros(len(parent), dtype=np.int64)
        place = np.empty_like(order)
        place[order] = np.arange(len(points))
        begin, border, waiting = borders(start, parent, *structure(graph), order, place)
        self.order, self.place, self.start, self.negative, self.parent = order, place, start, of_front, parent
        self.begin, self.border, self.waiting = begin, border, waiting
        self.unknowns = np.stack([2 * order, 2 * order + 1], axis=1).ravel()


@dataclass(frozen=True)
class MultifrontalFactor:
    """Panels of the factor in ``values`` at offsets ``panel`` (f + 1,), and the exchanges of rows ``swaps``
    (2n,) among pivots, (0,) for a symmetric matrix."""

    fronts: Fronts
    panel: IntArray
    values: FloatArray
    swaps: IndexArray
    note: str = ""

    @classmethod
    def of(cls, matrix: sparse.bsr_array, fronts: Fronts, transposed: IntArray) -> MultifrontalFactor | None:
        """The factor of a ``matrix`` (2n, 2n) in 2 x 2 blocks, of a general one with the numbers
        ``transposed`` (:func:`mirrored`); None if it is singular or a pivot has the wrong sign."""
        general = len(transposed) > 0
        pivots, edge = 2 * np.diff(fronts.start), 2 * np.diff(fronts.begin)
        sizes = pivots * (pivots + (2 * edge if general else edge))
        panel = np.concatenate([np.zeros(1, dtype=np.int64), np.cumsum(sizes)])
        values = np.empty(int(panel[-1]))
        swaps = np.empty(matrix.shape[0] if general else 0, dtype=np.int32)
        failed = factorise(
            *(fronts.start, fronts.negative, fronts.parent, fronts.begin, fronts.border, panel),
            *(fronts.waiting, *structure(matrix), np.ascontiguousarray(matrix.data), transposed),
            *(fronts.order, fronts.place, swaps, values),
        )
        return cls(fronts, panel, values, swaps) if failed < 0 else None

    def solve(self, rhs: FloatArray) -> FloatArray:
        """Solution for (n,) or (n, c) right-hand sides. Raises ValueError for another n."""
        fronts = self.fronts
        if len(rhs) != len(fronts.unknowns):
            raise ValueError(f"{len(rhs)} rows for {len(fronts.unknowns)} unknowns")
        if not rhs.size:
            return np.zeros(rhs.shape)  # BLAS knows no matrices without rows
        x = np.ascontiguousarray(rhs[fronts.unknowns], dtype=float)
        panels = (fronts.start, fronts.negative, fronts.begin, fronts.border, self.panel, self.values)
        solve(*panels, self.swaps, x.ravel(), rhs.size // len(rhs))
        solution = np.empty(rhs.shape)
        solution[fronts.unknowns] = x
        return solution

    def products(self, left: sparse.csr_array, right: sparse.csc_array) -> FloatArray:
        """``left`` (g, n) times the solutions for ``right`` (n, c), by forward substitution; if symmetric."""
        fronts = self.fronts
        both = sparse.csr_array(sparse.hstack([left.T, right], format="csr"))[fronts.unknowns]
        indptr, indices = both.indptr.astype(np.int64), both.indices.astype(np.int64)
        panels = (fronts.start, fronts.negative, fronts.begin, fronts.border, self.panel, self.values)
        return products(*panels, fronts.parent, indptr, indices, both.data, left.shape[0], both.shape[1])


@dataclass(frozen=True)
class SuperLUFactor:
    """Factor of the permuted matrix."""

    factor: SuperLU
    order: IntArray
    note: str = ""

    def solve(self, rhs: FloatArray) -> FloatArray:
        solution = np.empty_like(rhs)
        solution[self.order] = self.factor.solve(rhs[self.order])
        return solution

    def products(self, left: sparse.csr_array, right: sparse.csc_array) -> FloatArray:
        """``left`` (g, n) times full solutions for ``right`` (n, c), in blocks of columns."""
        blocks = (right[:, first : first + BLOCK].toarray() for first in range(0, right.shape[1], BLOCK))
        found = [np.zeros((left.shape[0], 0)), *(left @ self.solve(block) for block in blocks)]
        return np.concatenate(found, axis=1)


def elimination_order(matrix: sparse.csc_array, points: FloatArray) -> IntArray:
    """Elimination order (2n,) for a ``matrix`` (2n, 2n) of symmetric pattern by nested dissection of the
    nodes ``points`` (n, 2); both unknowns of a node stay together."""
    nodes = nested_dissection(points, sparse.csr_array(matrix[::2, ::2]))[0]
    return np.stack([2 * nodes, 2 * nodes + 1], axis=1).ravel()


def factor_in_order(matrix: sparse.csc_array, order: IntArray, threshold: float = 0.0) -> SuperLUFactor:
    """Factorise in ``order`` (n,) with the ``threshold`` of pivoting. Raises NumericalError if singular."""
    # Imported here: it loads the eigenvalue solvers, not needed when the own Cholesky factor suffices.
    from scipy.sparse.linalg import splu

    permuted, options = sparse.csc_matrix(matrix[order][:, order]), {"SymmetricMode": True}
    try:
        factor = splu(permuted, permc_spec="NATURAL", diag_pivot_thresh=threshold, options=options)
    except (RuntimeError, MemoryError) as error:
        raise NumericalError(
            f"the elastic system of a body could not be factorised ({error})",
            "a body may be able to move freely, or its cloud may be too coarse for mls.degree",
        ) from error
    return SuperLUFactor(factor, order)


def factor_definite(
    matrix: Matrix,
    points: FloatArray,
    negative: int = 0,
    solver: LinearSolver = "auto",
    fronts: Fronts | None = None,
) -> Factor:
    """Factorise a symmetric ``matrix`` (2n, 2n) of two unknowns at each of the ``points`` (n, 2), positive
    definite but for the last ``negative`` points, in which it is negative definite; ``fronts`` if known.
    Falls back to SuperLU, with a note. Raises NumericalError if the matrix is singular."""

    def by_superlu() -> SuperLUFactor:
        plain = sparse.csc_array(matrix)
        return factor_in_order(plain, elimination_order(plain, points))

    def accurate(one: Factor) -> bool:
        error = backward_error(matrix, one)
        if MAX_BACKWARD_ERROR < error <= MAX_UNCORRECTED_ERROR:
            return backward_error(matrix, one, corrections=1) <= MAX_CORRECTED_ERROR
        return error <= MAX_BACKWARD_ERROR

    if solver == "superlu":
        return by_superlu()
    blocks = sparse.bsr_array(matrix, blocksize=(2, 2))
    fronts = fronts or Fronts(points, blocks, negative)
    factor = MultifrontalFactor.of(blocks, fronts, np.zeros(0, dtype=np.int64))
    if factor is not None and accurate(factor):
        return factor
    other = by_superlu()
    if not accurate(other):
        raise NumericalError(
            "the elastic system of a body is singular to working precision",
            "a body may move freely, or its cloud be too coarse for mls.degree or Poisson's ratio: "
            'try mls.degree = 2, or solver.linear = "superlu"',
        )
    return replace(
        other, note="the equations are not positive definite to working precision; SuperLU factorised them"
    )


def mirrored(graph: sparse.bsr_array) -> IntArray:
    """Numbers (e,) of the transposed blocks of a ``graph`` with a symmetric pattern."""
    count = len(graph.indptr) - 1
    row, column = np.repeat(np.arange(count), np.diff(graph.indptr)), graph.indices.astype(np.int64)
    found = np.empty(len(row), dtype=np.int64)
    found[np.argsort(column * count + row)] = np.argsort(row * count + column)
    return found


def factor_general(matrix: sparse.bsr_array, fronts: Fronts, transposed: IntArray) -> MultifrontalFactor:
    """Factorise a ``matrix`` (2n, 2n) in 2 x 2 blocks, with pivoting among the unknowns of a front;
    ``transposed`` are the numbers of :func:`mirrored`. Raises NumericalError if it is singular."""
    factor = MultifrontalFactor.of(matrix, fronts, transposed)
    if factor is None or not np.isfinite(factor.values.sum()):
        raise NumericalError(
            "the tangent of a body is singular",
            "a body may be able to move freely, or its cloud may be too coarse for mls.degree",
        )
    return factor


MAX_BACKWARD_ERROR = 1e-11
"""Accepted backward error of a factor; round-off is expected."""
MAX_UNCORRECTED_ERROR, MAX_CORRECTED_ERROR = 1e-9, 1e-13
"""Or: accepted backward error if one correction, as all solutions get, reduces it to MAX_CORRECTED_ERROR."""


def backward_error(matrix: Matrix, factor: Factor, corrections: int = 0) -> float:
    """Backward error of a factor of a symmetric ``matrix`` (n, n).

    With D its diagonal: max_i |b - A x|_i / (|b|_i + sqrt(D_i) sum_j sqrt(D_j) |x_j|), independent of the
    units of the unknowns. For the last, negative ones D_i is at least max_j A_ij^2 / D_j over the positive
    ones. The right-hand side is random with fixed seed; the solution gets ``corrections`` refinement steps.
    """
    rhs = np.random.default_rng(0).normal(size=matrix.shape[0])
    solution = factor.solve(rhs)
    for _ in range(corrections):
        solution = solution + factor.solve(rhs - matrix @ solution)
    diagonal = matrix.diagonal()
    scale = np.sqrt(np.abs(diagonal))
    first = int(np.argmax(diagonal < 0.0)) if (diagonal < 0.0).any() else len(diagonal)
    if first < len(diagonal):
        last = sparse.eye_array(len(diagonal), len(diagonal) - first, k=-first, format="csc")
        coupled = sparse.csc_array(matrix @ last)[:first]
        share = 1.0 / np.maximum(scale[:first], np.finfo(float).tiny)
        sizes = abs(sparse.diags_array(share) @ coupled).max(axis=0).toarray().ravel()
        scale[first:] = np.maximum(scale[first:], sizes)
    parts = scale * (scale @ np.abs(solution)) + np.abs(rhs)
    return float((np.abs(rhs - matrix @ solution) / parts).max())
