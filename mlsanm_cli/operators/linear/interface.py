"""The interface every sparse direct solver is used through: analyse once, factor, solve many."""

from __future__ import annotations

from typing import Protocol

import scipy.sparse as sparse

from mlsanm_cli.arrays import FloatArray, IntArray


class Factor(Protocol):
    """A factorised matrix."""

    def solve(self, rhs: FloatArray, transposed: bool = False) -> FloatArray:
        """Solution for one right-hand side (n,) or several (n, c), on request with the transposed matrix."""
        ...


class DirectSolver(Protocol):
    """A sparse direct method."""

    name: str

    def analyse(self, matrix: sparse.csc_array, points: FloatArray) -> IntArray:
        """Elimination order (2n,) of the unknowns, two to each of the nodes ``points`` (n, 2).

        ``matrix`` (2n, 2n) has a symmetric pattern.
        """
        ...

    def factor(self, matrix: sparse.csc_array, order: IntArray) -> Factor:
        """Factorise a symmetric positive definite matrix; raises NumericalError for a singular one."""
        ...

    def factor_unsymmetric(self, matrix: sparse.csc_array, order: IntArray) -> Factor:
        """Factorise any square matrix, rows exchanged where needed; NumericalError for a singular one."""
        ...
