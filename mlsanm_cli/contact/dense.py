"""Small dense systems whose rows and columns have unlike units."""

from __future__ import annotations

import numpy as np
import scipy.linalg as linalg

from mlsanm_cli.arrays import FloatArray

SINGULAR = 1e-15


class SingularSystemError(ArithmeticError):
    """The matrix is singular to working precision."""


class DenseSystem:
    """A factorised matrix (r, r), scaled so that singularity shows as a number.

    ``lengths`` rows come first that are gaps and slips. Columns are scaled by the gaps and slips they cause,
    then rows: the other way round the unit of the balance rows below would decide. Raises
    SingularSystemError.
    """

    def __init__(self, matrix: FloatArray, lengths: int) -> None:
        self._matrix = matrix
        if not len(matrix):
            return
        effect = np.abs(matrix[:lengths]).max(axis=0, initial=0.0)
        effect = np.where(effect > 0.0, effect, np.abs(matrix).max(axis=0))
        self._columns = 1.0 / np.maximum(effect, np.finfo(float).tiny)
        scaled = matrix * self._columns
        self._rows = 1.0 / np.maximum(np.abs(scaled).max(axis=1), np.finfo(float).tiny)
        scaled *= self._rows[:, None]
        norm = np.abs(scaled).sum(axis=0).max()
        self._factor, self._pivots, info = linalg.lapack.dgetrf(scaled, overwrite_a=1)
        if info == 0:
            rcond, info = linalg.lapack.dgecon(self._factor, norm)
        if info != 0 or rcond < SINGULAR:
            raise SingularSystemError

    def solve(self, rhs: FloatArray) -> FloatArray:
        """Solution (r,) or (r, c); one step on the unscaled system takes away the factors' round-off."""
        if not len(rhs):
            return np.zeros_like(rhs)
        solution = self._once(rhs)
        return solution + self._once(rhs - self._matrix @ solution)

    def _once(self, rhs: FloatArray) -> FloatArray:
        shape = (-1,) + (1,) * (rhs.ndim - 1)
        solution, _ = linalg.lapack.dgetrs(self._factor, self._pivots, rhs * self._rows.reshape(shape))
        result: FloatArray = solution * self._columns.reshape(shape)
        return result
