"""LU factorisation of matrices with a symmetric pattern over the fronts of a nested dissection, with pivoting
among the unknowns of a front."""

from __future__ import annotations

from functools import cached_property

import numpy as np
import scipy.sparse as sparse

from mlsanm_cli.arrays import FloatArray, IndexArray, IntArray
from mlsanm_cli.errors import NumericalError
from mlsanm_cli.kernels.unsymmetric import factorise_general, solve_general
from mlsanm_cli.operators.linear.cholesky import Fronts
from mlsanm_cli.operators.structure import structure
from mlsanm_cli.records import dataclass


@dataclass(frozen=True)
class LUFactor:
    """Panels of the factor, one after the other in ``values`` at offsets ``panel`` (f + 1,), and the
    exchanges of rows ``swaps`` (2n,) among pivots."""

    fronts: Fronts
    panel: IntArray
    values: FloatArray
    swaps: IndexArray
    note: str = ""

    @cached_property
    def sign(self) -> int:
        """Sign of the determinant of the matrix."""
        fronts, negative = self.fronts, 0
        for f, first in enumerate(self.panel[:-1]):
            pivots = 2 * int(fronts.start[f + 1] - fronts.start[f])
            height = pivots + 2 * int(fronts.begin[f + 1] - fronts.begin[f])
            negative += int((self.values[first + (height + 1) * np.arange(pivots)] < 0.0).sum())
        place = np.arange(1, len(self.swaps) + 1) - np.repeat(
            2 * fronts.start[:-1], 2 * np.diff(fronts.start)
        )
        return -1 if (negative + int((self.swaps != place).sum())) % 2 else 1

    def solve(self, rhs: FloatArray) -> FloatArray:
        """Solution for (n,) or (n, c) right-hand sides."""
        fronts, solution = self.fronts, np.empty(rhs.shape)
        if not rhs.size:
            return solution
        x = np.ascontiguousarray(rhs[fronts.unknowns], dtype=float)
        panels = (fronts.start, fronts.begin, fronts.border, self.panel, self.values, self.swaps)
        solve_general(*panels, x.ravel(), rhs.size // len(rhs))
        solution[fronts.unknowns] = x
        return solution


def mirrored(graph: sparse.bsr_array) -> IntArray:
    """Numbers (e,) of the transposed blocks of a ``graph`` with a symmetric pattern."""
    count = len(graph.indptr) - 1
    row, column = np.repeat(np.arange(count), np.diff(graph.indptr)), graph.indices.astype(np.int64)
    found = np.empty(len(row), dtype=np.int64)
    found[np.argsort(column * count + row)] = np.argsort(row * count + column)
    return found


def factor_general(matrix: sparse.bsr_array, fronts: Fronts, transposed: IntArray) -> LUFactor:
    """Factorise a ``matrix`` (2n, 2n) in 2 x 2 blocks; ``transposed`` are the numbers of :func:`mirrored`.
    Raises NumericalError if it is singular."""
    pivots, edge = 2 * np.diff(fronts.start), 2 * np.diff(fronts.begin)
    panel = np.concatenate([np.zeros(1, dtype=np.int64), np.cumsum(pivots * (pivots + 2 * edge))])
    values, swaps = np.empty(int(panel[-1])), np.empty(matrix.shape[0], dtype=np.int32)
    failed = factorise_general(
        *(fronts.start, fronts.parent, fronts.begin, fronts.border, panel, fronts.waiting),
        *(*structure(matrix), np.ascontiguousarray(matrix.data), transposed),
        *(fronts.order, fronts.place, values, swaps),
    )
    if failed >= 0 or not np.isfinite(values.sum()):
        raise NumericalError(
            "the tangent of a body is singular",
            "a body may be able to move freely, or its cloud may be too coarse for mls.degree",
        )
    return LUFactor(fronts, panel, values, swaps)
