"""Weighted linear least squares through the normal equations, with corrected semi-normal steps.

For rows M u = b with row weights w, the solution minimises |diag(w) (M u - b)|. The Cholesky factor of the
normal equations alone loses half the digits; a step r = b - M u, N du = M^T r on the rows themselves (Bjorck
1987, doi:10.1016/0024-3795(87)90101-7) gives them back.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sparse

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.operators.linear.interface import DirectSolver, Factor
from mlsanm_cli.operators.refinement import missing, refine


@dataclass(frozen=True)
class LeastSquares:
    """Factorised least-squares problem: ``rows`` (r, n) already multiplied by ``weight`` (r,)."""

    rows: sparse.csr_array
    weight: FloatArray
    factor: Factor

    def solve(self, sources: sparse.csc_array) -> FloatArray:
        """Solutions (n, c) for right-hand sides ``sources`` (r, c) given in the rows' physical units."""
        weighted = sparse.csr_array(sources * self.weight[:, None])
        first = self.factor.solve((self.rows.T @ weighted).toarray())
        return refine(first, self._update(weighted.toarray()))

    def residual(self, source: sparse.csc_array, solution: FloatArray) -> float:
        """What one more corrected semi-normal step would change of a ``solution`` (n, 1), relatively."""
        return missing(solution, self._update(self.scaled(source)))

    def _update(self, weighted: FloatArray) -> Callable[[FloatArray], FloatArray]:
        return lambda solution: self.factor.solve(self.rows.T @ (weighted - self.rows @ solution))

    def inverse_normal(self, vectors: FloatArray) -> FloatArray:
        """(M^T M)^-1 times ``vectors`` (n, c)."""
        return self.factor.solve(vectors)

    def scaled(self, sources: sparse.csc_array) -> FloatArray:
        """Right-hand sides (r, c) multiplied by the weights."""
        return np.asarray((sources * self.weight[:, None]).toarray())


def factorise(
    rows: sparse.csr_array, weight: FloatArray, points: FloatArray, solver: DirectSolver
) -> LeastSquares:
    """Set up and factorise the normal equations of ``rows`` (r, n), weighted by ``weight`` (r,)."""
    weighted = sparse.csr_array(rows.multiply(weight[:, None]))
    normal = sparse.csc_array(weighted.T @ weighted)
    return LeastSquares(weighted, weight, solver.factor(normal, solver.analyse(normal, points)))
