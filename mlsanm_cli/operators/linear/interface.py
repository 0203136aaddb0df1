"""Interface of sparse direct solvers: factorise once, solve many times."""

from __future__ import annotations

from typing import Protocol, TypeAlias

import numpy as np
import scipy.sparse as sparse

from mlsanm_cli.arrays import FloatArray

Matrix: TypeAlias = "sparse.csc_array | sparse.bsr_array"
"""A symmetric matrix, in CSC or block form."""
BLOCK = 64
"""Columns solved at once."""


class Factor(Protocol):
    """A factorised matrix."""

    @property
    def note(self) -> str:
        """Remark on the factorisation for users; usually ""."""

    def solve(self, rhs: FloatArray, transposed: bool = False) -> FloatArray:
        """Solution for right-hand sides (n,) or (n, c), with the transposed matrix if ``transposed``."""

    def products(self, left: sparse.csr_array, right: sparse.csc_array) -> FloatArray:
        """``left`` (g, n) times the solutions for ``right`` (n, c): (g, c). By forward substitution only
        where the method allows it, else by :func:`products_of_solutions`."""


class DirectSolver(Protocol):
    """A sparse direct method for two unknowns at each of the nodes ``points`` (n, 2)."""

    name: str

    def factor_definite(self, matrix: Matrix, points: FloatArray, negative: int = 0) -> Factor:
        """Factorise a symmetric matrix (2n, 2n), positive definite except for the unknowns of the last
        ``negative`` points, in which it is negative definite. Raises NumericalError if it is singular."""


def products_of_solutions(factor: Factor, left: sparse.csr_array, right: sparse.csc_array) -> FloatArray:
    """``left`` (g, n) times full solutions for ``right`` (n, c), in blocks of columns: (g, c)."""
    result = np.empty((left.shape[0], right.shape[1]))
    for first in range(0, right.shape[1], BLOCK):
        columns = slice(first, first + BLOCK)
        result[:, columns] = left @ factor.solve(right[:, columns].toarray())
    return result


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
        coupled = sparse.csc_array(_last_columns(matrix, first)[:first])
        share = 1.0 / np.maximum(scale[:first], np.finfo(float).tiny)
        sizes = abs(sparse.diags_array(share) @ coupled).max(axis=0).toarray().ravel()
        scale[first:] = np.maximum(scale[first:], sizes)
    parts = scale * (scale @ np.abs(solution)) + np.abs(rhs)
    return float((np.abs(rhs - matrix @ solution) / parts).max())


def _last_columns(matrix: Matrix, first: int) -> sparse.csc_array:
    """Columns of a symmetric ``matrix`` (n, n) from ``first`` on, which starts a block."""
    if not isinstance(matrix, sparse.bsr_array):
        return sparse.csc_array(matrix[:, first:])
    row, shape = first // 2, (matrix.shape[0] - first, matrix.shape[1])
    begin = matrix.indptr[row]
    blocks = (matrix.data[begin:], matrix.indices[begin:], matrix.indptr[row:] - begin)
    return sparse.csc_array(sparse.csr_array(sparse.bsr_array(blocks, shape=shape)).T)
