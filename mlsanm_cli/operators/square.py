"""Square systems: as many equations as unknowns, each a combination of a few physical rows."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sparse

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.operators.linear.superlu import THRESHOLD, SuperLUFactor, elimination_order, factor_in_order
from mlsanm_cli.operators.refinement import (
    BLOCK_COLUMNS,
    FULL_TOLERANCE,
    FUNCTIONAL_TOLERANCE,
    VERIFIED_TOLERANCE,
    Progress,
    best_part,
    refine,
    relative,
)
from mlsanm_cli.operators.system import Equations, LinearSystem


@dataclass(frozen=True)
class Square(LinearSystem):
    """Factorised ``matrix`` (n, n); ``choice`` (n, r) combines right-hand sides of the r rows to its own."""

    matrix: sparse.csr_array
    choice: sparse.csr_array
    factor: SuperLUFactor

    def solve(self, sources: sparse.csc_array, tolerance: float = FULL_TOLERANCE) -> FloatArray:
        rhs = self.scaled(sources)
        first = self.factor.solve(rhs)
        return refine(first, self._update(rhs), Progress.of(first, tolerance))[0]

    def solve_with_error(
        self, sources: sparse.csc_array, start: FloatArray | None = None
    ) -> tuple[FloatArray, FloatArray]:
        rhs = self.scaled(sources)
        if start is None:
            first = self.factor.solve(rhs)
            progress = Progress.of(first, FULL_TOLERANCE, VERIFIED_TOLERANCE)
        else:
            first = start @ best_part(self.matrix @ start, rhs)
            progress = Progress.begun(sources.shape[1], FULL_TOLERANCE, VERIFIED_TOLERANCE)
        solution, progress = refine(first, self._update(rhs), progress)
        return solution, relative(progress.last, solution)

    def solve_unrefined(self, sources: sparse.csc_array) -> FloatArray:
        return self.factor.solve(self.scaled(sources))

    def step(self, source: sparse.csc_array, solution: FloatArray, more: sparse.csc_array) -> FloatArray:
        rhs = np.hstack([self.scaled(source) - self.matrix @ solution, self.scaled(more)])
        return self.factor.solve(rhs)

    def functionals(
        self, observed: sparse.csr_array, sources: sparse.csc_array, mixture: FloatArray | None = None
    ) -> FloatArray:
        # In blocks of columns, so that no dense (n, c) array is stored.
        count = sources.shape[1] if mixture is None else mixture.shape[1]
        result = np.empty((observed.shape[0], count))
        for first in range(0, count, BLOCK_COLUMNS):
            columns = slice(first, first + BLOCK_COLUMNS)
            some = sources[:, columns] if mixture is None else sources @ mixture[:, columns]
            result[:, columns] = observed @ self.solve(sparse.csc_array(some), FUNCTIONAL_TOLERANCE)
        return result

    def residual(self, sources: sparse.csc_array, solutions: FloatArray) -> FloatArray:
        rest = self.scaled(sources) - self.matrix @ solutions
        return relative(np.linalg.norm(self.factor.solve(rest), axis=0), solutions)

    def _update(self, rhs: FloatArray) -> Callable[[FloatArray], FloatArray]:
        return lambda solution: self.factor.solve(rhs - self.matrix @ solution)

    @property
    def note(self) -> str:
        return self.factor.note

    def inverse_normal(self, vectors: FloatArray) -> FloatArray:
        """(K^T K)^-1 times ``vectors`` (n, c)."""
        return self.factor.solve(self.factor.solve_transposed(vectors))

    def scaled(self, sources: sparse.csc_array, strong: bool = True) -> FloatArray:
        """Right-hand sides (n, c) of the equations for those of the rows (r, c)."""
        return np.asarray((self.choice @ sources).toarray())

    def equations(self, sources: sparse.csc_array) -> Equations:
        """The equations, unchanged."""
        return Equations(self.matrix, sparse.csr_array(self.choice @ sources), definite=False)

    def residual_vector(self, source: FloatArray, solution: FloatArray) -> FloatArray:
        """Left-hand side minus right-hand side (n,)."""
        return np.asarray(self.matrix @ solution - self.choice @ source)


def factorise(rows: sparse.csr_array, choice: sparse.csr_array, points: FloatArray) -> Square:
    """Factorise the equations ``choice`` (n, r) times ``rows`` (e, n), the first e of the r rows of
    right-hand sides. Equation k should have a large entry for unknown k, so that few rows are exchanged in
    pivoting."""
    matrix = sparse.csr_array(choice[:, : rows.shape[0]] @ rows)
    pattern = sparse.csc_array(abs(matrix) + abs(matrix).T)
    order = elimination_order(pattern, points)
    return Square(matrix, choice, factor_in_order(sparse.csc_array(matrix), order, THRESHOLD))
