"""Products with dense matrices by blocks, and null spaces."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import Protocol

import numpy as np

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.records import dataclass
from mlsanm_cli.roundoff import ROUND_OFF

SINGULAR = 1e-15
"""Reciprocal condition number of a singular matrix."""


class SingularSystemError(ArithmeticError):
    """The matrix is singular to working precision."""


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


def null_space(rows: FloatArray, least: float = ROUND_OFF) -> FloatArray:
    """Orthonormal null space (k, d) of the ``rows`` (r, k), up to singular values of ``least``."""
    if not len(rows):
        return np.eye(rows.shape[1])
    # The R factor has the same singular values and is much smaller.
    _, values, right = np.linalg.svd(np.linalg.qr(rows, mode="r"))
    basis: FloatArray = right[int((values > least).sum()) :].T
    return basis
