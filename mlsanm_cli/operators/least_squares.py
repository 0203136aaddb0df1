"""Weighted linear least squares through the normal equations, with corrected semi-normal steps.

For rows M u = b with row weights w, the solution minimises |diag(w) (M u - b)|. The Cholesky factor of the
normal equations alone loses half the digits; a step r = b - M u, N du = M^T r on the rows themselves (Bjorck
1987, doi:10.1016/0024-3795(87)90101-7) gives them back.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sparse

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.operators.linear.interface import DirectSolver, Factor

BLOCK = 64


@dataclass(frozen=True)
class LeastSquares:
    """Factorised least-squares problem: ``rows`` (r, 2n) already multiplied by ``weight`` (r,)."""

    rows: sparse.csr_array
    weight: FloatArray
    factor: Factor

    def solve(self, sources: sparse.csc_array, corrections: int = 1) -> FloatArray:
        """Solutions (2n, c) for right-hand sides ``sources`` (r, c) given in the rows' physical units."""
        weighted = sparse.csr_array(sources * self.weight[:, None])
        solution = self.factor.solve((self.rows.T @ weighted).toarray())
        dense = weighted.toarray()
        for _ in range(corrections):
            solution += self.factor.solve(self.rows.T @ (dense - self.rows @ solution))
        return solution

    def solve_blocks(self, sources: sparse.csc_array) -> Iterator[tuple[slice, FloatArray]]:
        """Solutions a block of columns at a time, so that no dense (2n, c) array is kept."""
        for first in range(0, sources.shape[1], BLOCK):
            columns = slice(first, min(first + BLOCK, sources.shape[1]))
            yield columns, self.solve(sources[:, columns])

    def optimality(self, source: sparse.csc_array, solution: FloatArray) -> float:
        """|M^T r| over |M^T b| in the largest norm, r = b - M u: zero at the exact minimum."""
        weighted = (source * self.weight[:, None]).toarray()
        scale = float(np.abs(self.rows.T @ weighted).max(initial=0.0))
        gradient = np.abs(self.rows.T @ (weighted - self.rows @ solution)).max(initial=0.0)
        return float(gradient) / scale if scale > 0.0 else float(gradient)


def factorise(
    rows: sparse.csr_array, weight: FloatArray, points: FloatArray, solver: DirectSolver
) -> LeastSquares:
    """Set up and factorise the normal equations of ``rows`` (r, 2n), weighted by ``weight`` (r,)."""
    weighted = sparse.csr_array(rows.multiply(weight[:, None]))
    normal = sparse.csc_array(weighted.T @ weighted)
    return LeastSquares(weighted, weight, solver.factor(normal, solver.analyse(normal, points)))
