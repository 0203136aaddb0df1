"""Our own sparse Cholesky factorisation: multifrontal, over the fronts of the nested dissection."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sparse

from mlsanm_cli.arrays import FloatArray, IntArray
from mlsanm_cli.kernels.multifrontal import borders, factorise, products, solve_backward, solve_forward
from mlsanm_cli.operators.linear.dissection import nested_dissection
from mlsanm_cli.operators.linear.interface import Factor
from mlsanm_cli.operators.linear.superlu import SuperLUSolver


@dataclass(frozen=True)
class CholeskyFactor:
    """Factor of the permuted matrix, front by front."""

    order: IntArray
    start: IntArray
    parent: IntArray
    begin: IntArray
    border: IntArray
    panel: IntArray
    values: FloatArray

    def solve(self, rhs: FloatArray, transposed: bool = False) -> FloatArray:
        """Solution for (n,) or (n, c) right-hand sides; the matrix is its own transpose."""
        columns = rhs.size // len(rhs)
        x = np.ascontiguousarray(rhs[self.order], dtype=float).ravel()
        shape = (self.start, self.begin, self.border, self.panel, self.values, x, columns)
        solve_forward(*shape)
        solve_backward(*shape)
        solution = np.empty(rhs.shape)
        solution[self.order] = x.reshape(rhs.shape)
        return solution

    def products(self, left: sparse.csr_array, right: sparse.csc_array) -> FloatArray:
        """``left`` (g, n) times the solutions for ``right`` (n, c)."""
        both = sparse.csr_array(sparse.hstack([left.T, right], format="csr"))[self.order]
        return products(self.start, self.parent, self.begin, self.border, self.panel, self.values,
            both.indptr.astype(np.int64), both.indices.astype(np.int64), both.data, left.shape[0], both.shape[1])


class CholeskySolver(SuperLUSolver):
    name = "cholesky"

    def factor_definite(self, matrix: sparse.csc_array, points: FloatArray) -> Factor:
        blocks = sparse.csr_array(matrix).tobsr((2, 2))
        indptr, indices = blocks.indptr.astype(np.int64), blocks.indices.astype(np.int64)
        graph = sparse.csr_array((np.ones(len(indices)), indices, indptr), shape=(len(points),) * 2)
        tree = nested_dissection(points, graph)
        place = np.empty_like(tree.order)
        place[tree.order] = np.arange(len(points))
        begin, border, stack = borders(tree.start, tree.parent, indptr, indices, tree.order, place)
        pivots, edge = 2 * np.diff(tree.start), 2 * np.diff(begin)
        panel = np.concatenate([[0], np.cumsum(pivots * (pivots + edge))])
        values, failed = factorise(tree.start, tree.parent, begin, border, panel, stack, indptr, indices, blocks.data, tree.order, place)
        assert failed<0
        order = np.stack([2 * tree.order, 2 * tree.order + 1], axis=1).ravel()
        return CholeskyFactor(order, tree.start, tree.parent, begin, border, panel, values)
