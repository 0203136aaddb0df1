"""SuperLU (Li 2005, doi:10.1145/1089014.1089017) in symmetric mode with geometric nested dissection."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import scipy.sparse as sparse

from mlsanm_cli.arrays import FloatArray, IntArray
from mlsanm_cli.errors import NumericalError
from mlsanm_cli.operators.linear.dissection import nested_dissection
from mlsanm_cli.operators.linear.interface import Matrix
from mlsanm_cli.records import dataclass

if TYPE_CHECKING:
    from scipy.sparse.linalg import SuperLU

BLOCK = 64
"""Columns solved at once."""
THRESHOLD = 0.1
"""A diagonal entry is accepted as pivot unless another in its column is 1/THRESHOLD times larger."""


@dataclass(frozen=True)
class SuperLUFactor:
    """Factor of the permuted matrix."""

    factor: SuperLU
    order: IntArray
    note: str = ""

    def solve(self, rhs: FloatArray) -> FloatArray:
        """Solution for (n,) or (n, c) right-hand sides."""
        solution = np.empty_like(rhs)
        solution[self.order] = self.factor.solve(rhs[self.order])
        return solution

    def products(self, left: sparse.csr_array, right: sparse.csc_array) -> FloatArray:
        """``left`` (g, n) times full solutions for ``right`` (n, c), in blocks of columns."""
        blocks = (right[:, first : first + BLOCK].toarray() for first in range(0, right.shape[1], BLOCK))
        found = [np.zeros((left.shape[0], 0)), *(left @ self.solve(block) for block in blocks)]
        return np.concatenate(found, axis=1)


def factor_quasi_definite(matrix: Matrix, points: FloatArray) -> SuperLUFactor:
    """Order and factorise without pivoting. Raises NumericalError if the matrix is singular."""
    plain = sparse.csc_array(matrix)
    return factor_in_order(plain, elimination_order(plain, points))


def elimination_order(matrix: sparse.csc_array, points: FloatArray) -> IntArray:
    """Elimination order (2n,) for a ``matrix`` (2n, 2n) of symmetric pattern by nested dissection of the
    nodes ``points`` (n, 2); both unknowns of a node stay together."""
    nodes = nested_dissection(points, sparse.csr_array(matrix[::2, ::2]))[0]
    return np.stack([2 * nodes, 2 * nodes + 1], axis=1).ravel()


def factor_in_order(matrix: sparse.csc_array, order: IntArray, threshold: float = 0.0) -> SuperLUFactor:
    """Factorise in ``order`` (n,) with the ``threshold`` of pivoting, 0 for quasi-definite matrices. Raises
    NumericalError if the matrix is singular."""
    # Imported here: it loads the eigenvalue solvers, not needed when the own Cholesky factor suffices.
    from scipy.sparse.linalg import splu

    if np.array_equal(order, np.arange(len(order))):
        permuted = sparse.csc_matrix(matrix)
    else:
        permuted = sparse.csc_matrix(matrix[order][:, order])
    try:
        factor = splu(
            permuted, permc_spec="NATURAL", diag_pivot_thresh=threshold, options={"SymmetricMode": True}
        )
    except (RuntimeError, MemoryError) as error:
        raise NumericalError(
            f"the elastic system of a body could not be factorised ({error})",
            "a body may be able to move freely, or its cloud may be too coarse for mls.degree",
        ) from error
    return SuperLUFactor(factor, order)
