"""Multifrontal factorisation with nested-dissection fronts, on top of BLAS and LAPACK; factors are verified,
with SuperLU as fallback. Duff and Reid 1983 (doi:10.1145/356044.356047), Liu 1992 (doi:10.1137/1034004)."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import scipy.sparse as sparse

from mlsanm_cli.arrays import FloatArray, IntArray
from mlsanm_cli.errors import NumericalError
from mlsanm_cli.kernels.multifrontal import borders, factorise
from mlsanm_cli.kernels.substitution import Tree, products, solve
from mlsanm_cli.operators.linear.dissection import nested_dissection, with_multipliers
from mlsanm_cli.operators.linear.interface import Factor, LinearSolver, Matrix, backward_error
from mlsanm_cli.operators.linear.superlu import factor_quasi_definite
from mlsanm_cli.operators.structure import structure
from mlsanm_cli.records import dataclass


@dataclass(frozen=True)
class Fronts:
    """The elimination tree, in the format of the kernels.

    ``order`` (n,) of the nodes, ``place`` (n,) its inverse; ``start`` (f + 1,) of the fronts, the number
    ``negative`` (f,) of their last nodes with negative pivots, their ``parent`` (f,); ``begin`` (f + 1,)
    offsets of their borders in ``border``; ``panel`` (f + 1,) offsets in the factor; ``waiting``, peak size
    of pending updates.
    """

    order: IntArray
    place: IntArray
    start: IntArray
    negative: IntArray
    parent: IntArray
    begin: IntArray
    border: IntArray
    panel: IntArray
    waiting: int

    @property
    def unknowns(self) -> IntArray:
        """Elimination order (2n,) of the unknowns."""
        return np.stack([2 * self.order, 2 * self.order + 1], axis=1).ravel()

    @classmethod
    def of(cls, points: FloatArray, graph: sparse.bsr_array, negative: int = 0) -> Fronts:
        """Fronts of the nested dissection of ``points`` (n, 2) with adjacency ``graph``. The last
        ``negative`` vertices, not adjacent to each other, come last in their fronts."""
        count = len(points) - negative
        if negative:
            entries = (np.ones(len(graph.indices), dtype=np.int8), graph.indices, graph.indptr)
            pattern = sparse.csr_array(entries, shape=(len(points), len(points)))[:count, :count]
            tree, of_front = with_multipliers(nested_dissection(points[:count], pattern), graph, negative)
        else:
            tree = nested_dissection(points, graph)
            of_front = np.zeros(len(tree.parent), dtype=np.int64)
        order, place = tree.order, np.empty_like(tree.order)
        place[order] = np.arange(len(points))
        begin, border, waiting = borders(tree.start, tree.parent, *structure(graph), order, place)
        pivots, height = 2 * np.diff(tree.start), 2 * np.diff(tree.start) + 2 * np.diff(begin)
        panel = np.concatenate([np.zeros(1, dtype=np.int64), np.cumsum(pivots * height)])
        return cls(order, place, tree.start, of_front, tree.parent, begin, border, panel, waiting)


@dataclass(frozen=True)
class CholeskyFactor:
    """Panels of the factor, one after the other in ``values``, and the elimination ``order`` (2n,)."""

    fronts: Fronts
    order: IntArray
    values: FloatArray
    note: str = ""

    @property
    def arrays(self) -> Tree:
        """Leading arguments of both substitution kernels."""
        shape = self.fronts
        return (shape.start, shape.negative, shape.begin, shape.border, shape.panel, self.values)

    def solve(self, rhs: FloatArray) -> FloatArray:
        """Solution for (n,) or (n, c) right-hand sides; the matrix is symmetric. Raises ValueError for
        another n."""
        if len(rhs) != len(self.order):
            raise ValueError(f"{len(rhs)} rows for {len(self.order)} unknowns")
        if not rhs.size:
            return np.zeros(rhs.shape)  # BLAS knows no matrices without rows
        x = np.ascontiguousarray(rhs[self.order], dtype=float)
        solve(*self.arrays, x.ravel(), rhs.size // len(rhs))
        solution = np.empty(rhs.shape)
        solution[self.order] = x
        return solution

    def products(self, left: sparse.csr_array, right: sparse.csc_array) -> FloatArray:
        """``left`` (g, n) times the solutions for ``right`` (n, c), by forward substitution only."""
        both = sparse.csr_array(sparse.hstack([left.T, right], format="csr"))[self.order]
        indptr, indices = both.indptr.astype(np.int64), both.indices.astype(np.int64)
        columns = (indptr, indices, both.data, left.shape[0], both.shape[1])
        return products(*self.arrays, self.fronts.parent, *columns)


def factor_definite(
    matrix: Matrix,
    points: FloatArray,
    negative: int = 0,
    solver: LinearSolver = "auto",
    fronts: Fronts | None = None,
) -> Factor:
    """Factorise a symmetric ``matrix`` (2n, 2n) of two unknowns at each of the nodes ``points`` (n, 2),
    positive definite except for the unknowns of the last ``negative`` points, in which it is negative
    definite; ``fronts`` if they are known. Falls back to SuperLU, with a note, if a pivot has the wrong sign
    or the factor is inaccurate. Raises NumericalError if the matrix is singular."""
    if solver == "superlu":
        return factor_quasi_definite(matrix, points)
    blocks = sparse.bsr_array(matrix, blocksize=(2, 2))
    fronts = fronts or Fronts.of(points, blocks, negative)
    values = np.empty(int(fronts.panel[-1]))
    failed = factorise(
        *(fronts.start, fronts.negative, fronts.parent, fronts.begin, fronts.border, fronts.panel),
        *(fronts.waiting, *structure(blocks), np.ascontiguousarray(blocks.data)),
        *(fronts.order, fronts.place, values),
    )
    factor = None
    if failed < 0:
        factor = CholeskyFactor(fronts, fronts.unknowns, values)
    return verified_or_superlu(factor, matrix, points)


MAX_BACKWARD_ERROR = 1e-11
"""Accepted backward error of a factor; round-off is expected."""
MAX_UNCORRECTED_ERROR, MAX_CORRECTED_ERROR = 1e-9, 1e-13
"""Or: accepted backward error if one correction, as all solutions get, reduces it to MAX_CORRECTED_ERROR.
Equations of nearly incompressible bodies lose digits in any factor without pivoting (1e-11 and more), which a
correction restores (1e-17 to 4e-14)."""


def verified_or_superlu(factor: Factor | None, matrix: Matrix, points: FloatArray) -> Factor:
    """The ``factor`` of a ``matrix`` (2n, 2n) if accurate, else SuperLU's, with a note. Raises NumericalError
    if that is inaccurate too."""
    if factor is not None and _accurate(matrix, factor):
        return factor
    other = factor_quasi_definite(matrix, points)
    if not _accurate(matrix, other):
        raise NumericalError(
            "the elastic system of a body is singular to working precision",
            "a body may move freely, or its cloud be too coarse for mls.degree or Poisson's ratio: "
            'try mls.degree = 2, or solver.linear = "superlu"',
        )
    return replace(
        other, note="the equations are not positive definite to working precision; SuperLU factorised them"
    )


def _accurate(matrix: Matrix, factor: Factor) -> bool:
    """Whether a factor is accurate, with the corrections that solutions get."""
    error = backward_error(matrix, factor)
    if error <= MAX_BACKWARD_ERROR:
        return True
    return (
        error <= MAX_UNCORRECTED_ERROR
        and backward_error(matrix, factor, corrections=1) <= MAX_CORRECTED_ERROR
    )
