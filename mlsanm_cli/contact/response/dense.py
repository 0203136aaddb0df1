"""Small dense systems with rows and columns of different units."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import Protocol

import numpy as np
from scipy.linalg.lapack import dgecon, dgetrf, dgetrs

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.records import dataclass
from mlsanm_cli.roundoff import ROUND_OFF

SINGULAR = 1e-15
"""Reciprocal condition number of a singular matrix."""


class SingularSystemError(ArithmeticError):
    """The matrix is singular to working precision."""


def scales(matrix: FloatArray, lengths: int) -> tuple[FloatArray, FloatArray]:
    """Row and column scales (r,) of a matrix (r, r) for which its condition number is meaningful. The first
    ``lengths`` rows are gaps and slips. Columns are scaled by the gaps and slips they cause, then rows; in
    reverse order the units of the balance rows would matter."""
    tiny = np.finfo(float).tiny
    effect = np.abs(matrix[:lengths]).max(axis=0, initial=0.0)
    effect = np.where(effect > 0.0, effect, np.abs(matrix).max(axis=0, initial=0.0))
    columns = 1.0 / np.maximum(effect, tiny)
    rows = 1.0 / np.maximum(np.abs(matrix * columns).max(axis=1, initial=0.0), tiny)
    return rows, columns


class Multiplier(Protocol):
    """An operator that multiplies vectors."""

    def __matmul__(self, vector: FloatArray, /) -> FloatArray: ...


class Blocks:
    """A matrix (r, r) in blocks between ``cuts``. In products zero blocks cost nothing, nor do unknowns of a
    block before the first and after the last that are not zero: open nodes beside a contact."""

    def __init__(self, matrix: FloatArray, cuts: Sequence[int]) -> None:
        spans = [slice(first, last) for first, last in pairwise(sorted({0, *cuts, len(matrix)}))]
        self._parts = list[tuple[slice, list[slice]]]()
        for columns in spans:
            runs = list[slice]()
            for rows in spans:
                if not matrix[rows, columns].any():
                    continue
                begun = runs and runs[-1].stop == rows.start
                runs.append(slice(runs.pop().start if begun else rows.start, rows.stop))
            self._parts.append((columns, runs))
        self._matrix = matrix

    def __matmul__(self, vector: FloatArray) -> FloatArray:
        total = np.zeros(len(self._matrix))
        for columns, runs in self._parts:
            acting = np.flatnonzero(vector[columns]) + columns.start
            if not len(acting):
                continue
            some = slice(acting[0], acting[-1] + 1)
            for rows in runs:
                total[rows] += self._matrix[rows, some] @ vector[some]
        return total


@dataclass(frozen=True, eq=False)
class Bordered:
    """A matrix (m + k, m + k) of blocks: ``own`` (m, m), ``right``, ``below`` and ``last`` (k, k)."""

    own: Multiplier
    right: FloatArray
    below: FloatArray
    last: FloatArray

    def __matmul__(self, vector: FloatArray) -> FloatArray:
        first, rest = np.split(vector, [len(self.right)])
        upper = self.own @ first + self.right @ rest
        return np.concatenate([upper, self.below @ first + self.last @ rest])


class ScaledFactor:
    """LU factors of a scaled matrix (r, r), which is overwritten if column-major. Raises SingularSystemError,
    also for a reciprocal condition number below ``least``."""

    def __init__(self, scaled: FloatArray, least: float = SINGULAR) -> None:
        norm = np.abs(scaled).sum(axis=0).max()
        self._factor, self._pivots, info = dgetrf(scaled, overwrite_a=1)
        if info == 0:
            rcond, info = dgecon(self._factor, norm)
        if info != 0 or rcond < least:
            raise SingularSystemError

    def solve(self, rhs: FloatArray) -> FloatArray:
        """Solution (r,) or (r, c)."""
        solution: FloatArray = dgetrs(self._factor, self._pivots, rhs)[0]
        return solution


class DenseSystem:
    """A factorised matrix (r, r) whose first ``lengths`` rows are lengths, see :func:`scales`. Raises
    SingularSystemError."""

    def __init__(self, matrix: FloatArray, lengths: int) -> None:
        self._matrix = matrix
        if not len(matrix):
            return
        self._rows, self._columns = scales(matrix, lengths)
        self._factor = ScaledFactor(self._rows[:, None] * (matrix * self._columns))

    def solve(self, rhs: FloatArray) -> FloatArray:
        """Solution (r,) or (r, c), with one step of iterative refinement on the unscaled system."""
        if not len(rhs):
            return np.zeros_like(rhs)
        solution = self._once(rhs)
        return solution + self._once(rhs - self._matrix @ solution)

    def _once(self, rhs: FloatArray) -> FloatArray:
        shape = (-1,) + (1,) * (rhs.ndim - 1)
        result: FloatArray = self._columns.reshape(shape) * self._factor.solve(
            rhs * self._rows.reshape(shape)
        )
        return result


def null_space(rows: FloatArray, least: float = ROUND_OFF) -> FloatArray:
    """Orthonormal null space (k, d) of the ``rows`` (r, k), up to singular values of ``least``."""
    if not len(rows):
        return np.eye(rows.shape[1])
    # The R factor has the same singular values and is much smaller.
    _, values, right = np.linalg.svd(np.linalg.qr(rows, mode="r"))
    basis: FloatArray = right[int((values > least).sum()) :].T
    return basis
