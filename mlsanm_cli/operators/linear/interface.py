"""The interface every sparse direct solver is used through: analyse once, factor, solve many."""

from __future__ import annotations

from typing import Protocol

import scipy.sparse as sparse

from mlsanm_cli.arrays import FloatArray, IntArray


class Factor(Protocol):
    """A factorised matrix."""

    def solve(self, rhs: FloatArray) -> FloatArray:
        """Solution for one right-hand side (n,) or several (n, c)."""
        ...


class DirectSolver(Protocol):
    """A sparse direct method for symmetric positive definite matrices."""

    name: str

    def analyse(self, matrix: sparse.csc_array, points: FloatArray) -> IntArray:
        """Elimination order (2n,) of the unknowns, two to each of the nodes ``points`` (n, 2)."""
        ...

    def factor(self, matrix: sparse.csc_array, order: IntArray) -> Factor:
        """Factorise; raises NumericalError for a singular matrix."""
        ...
