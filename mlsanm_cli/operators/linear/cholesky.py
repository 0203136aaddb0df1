"""Multifrontal Cholesky factorisation over the fronts of the nested dissection, BLAS and LAPACK for the rest.

Duff and Reid 1983 (doi:10.1145/356044.356047), Liu 1992 (doi:10.1137/1034004).
"""

from __future__ import annotations

import numpy as np
import scipy.sparse as sparse

from mlsanm_cli.arrays import FloatArray, IntArray
from mlsanm_cli.kernels.multifrontal import BLOCK, borders, factorise, products, solve
from mlsanm_cli.operators.linear.dissection import nested_dissection
from mlsanm_cli.operators.linear.fallback import believed
from mlsanm_cli.operators.linear.interface import Factor, Matrix
from mlsanm_cli.operators.linear.superlu import SuperLUSolver
from mlsanm_cli.operators.structure import structure
from mlsanm_cli.values import dataclass


@dataclass(frozen=True)
class Fronts:
    """Which unknowns are eliminated together, as the kernels want it.

    ``order`` (n,) of the nodes, ``place`` (n,) of each in it; ``start`` (f + 1,) of the fronts and their
    ``parent`` (f,); ``begin`` (f + 1,) of their borders in ``border``; ``panel`` (f + 1,), where each one's
    part of the factor is; ``waiting``, the most numbers that wait for their fronts.
    """

    order: IntArray
    place: IntArray
    start: IntArray
    parent: IntArray
    begin: IntArray
    border: IntArray
    panel: IntArray
    waiting: int

    @classmethod
    def of(cls, points: FloatArray, graph: sparse.bsr_array) -> Fronts:
        """Those of the nested dissection of ``points`` (n, 2); pairs with a block are neighbours."""
        tree = nested_dissection(points, graph)
        place = np.empty_like(tree.order)
        place[tree.order] = np.arange(len(points))
        begin, border, waiting = borders(tree.start, tree.parent, *structure(graph), tree.order, place)
        pivots, height = 2 * np.diff(tree.start), 2 * np.diff(tree.start) + 2 * np.diff(begin)
        whole = pivots // BLOCK
        rest = pivots - BLOCK * whole
        size = BLOCK * (whole * height - BLOCK * (whole * (whole - 1) // 2)) + rest * (height - BLOCK * whole)
        panel = np.concatenate([np.zeros(1, dtype=np.int64), np.cumsum(size)])
        return cls(tree.order, place, tree.start, tree.parent, begin, border, panel, waiting)


@dataclass(frozen=True)
class CholeskyFactor:
    """``values``, the panels of the factor; ``order`` (2n,) tells which unknown is eliminated when."""

    fronts: Fronts
    order: IntArray
    values: FloatArray
    note: str = ""

    def solve(self, rhs: FloatArray, transposed: bool = False) -> FloatArray:
        """Solution for (n,) or (n, c) right-hand sides; the matrix is its own transpose.

        Raises ValueError for another n.
        """
        if len(rhs) != len(self.order):
            raise ValueError(f"{len(rhs)} rows for {len(self.order)} unknowns")
        if not rhs.size:
            return np.zeros(rhs.shape)  # BLAS knows no matrices without rows
        x = np.ascontiguousarray(rhs[self.order], dtype=float)
        shape = self.fronts
        solve(
            shape.start, shape.begin, shape.border, shape.panel, self.values, x.ravel(), rhs.size // len(rhs)
        )
        solution = np.empty(rhs.shape)
        solution[self.order] = x
        return solution

    def products(self, left: sparse.csr_array, right: sparse.csc_array) -> FloatArray:
        """``left`` (g, n) times the solutions for ``right`` (n, c), by half of each solution only."""
        both = sparse.csr_array(sparse.hstack([left.T, right], format="csr"))[self.order]
        indptr, indices = both.indptr.astype(np.int64), both.indices.astype(np.int64)
        shape = self.fronts
        tree = (shape.start, shape.parent, shape.begin, shape.border, shape.panel)
        return products(*tree, self.values, indptr, indices, both.data, left.shape[0], both.shape[1])


class CholeskySolver(SuperLUSolver):
    """Our own method for positive definite matrices, SuperLU for what it cannot do."""

    name = "cholesky"

    def factor_definite(self, matrix: Matrix, points: FloatArray) -> Factor:
        """Factorise; SuperLU does it, with a note, if a pivot is not positive or the factor does not solve.

        Raises NumericalError where neither has a factor that solves.
        """
        blocks = sparse.bsr_array(matrix, blocksize=(2, 2))
        fronts = Fronts.of(points, blocks)
        values, failed = factorise(
            *(fronts.start, fronts.parent, fronts.begin, fronts.border, fronts.panel, fronts.waiting),
            *(*structure(blocks), np.ascontiguousarray(blocks.data), fronts.order, fronts.place),
        )
        factor = None
        if failed < 0:
            order = np.stack([2 * fronts.order, 2 * fronts.order + 1], axis=1).ravel()
            factor = CholeskyFactor(fronts, order, values)
        return believed(factor, matrix, points)
