"""Moving least-squares weights: one small weighted QR factorisation per evaluation point. Stencils of equal
size are processed LANES at a time, with the lane as last dimension of every array, so that loops vectorise,
which the short sums within one stencil do not. Results do not depend on the grouping."""

from __future__ import annotations

import math

import numpy as np

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.kernels.aot.jit import inner, kernel
from mlsanm_cli.kernels.aot.signature import Float1, Float2, FloatOut1, FloatOut2, FloatOut3, Int1
from mlsanm_cli.kernels.dense import copy_to

LANES = 32
"""Stencils processed at once."""


@inner
def _monomials(degree: int, x: FloatArray, y: FloatArray, row: FloatArray, lanes: int) -> None:
    """All x^i y^j of total degree up to ``degree``, ordered by degree, then by the power of y, times the
    first entry of ``row`` (c, l)."""
    column = 1
    for total in range(1, degree + 1):
        for power in range(total + 1):
            lower, factor = row[column - total], x
            if power == total:
                lower, factor = row[column - total - 1], y
            entry = row[column]
            for lane in range(lanes):
                entry[lane] = lower[lane] * factor[lane]
            column += 1


@inner
def _reflect(
    reflector: FloatArray, c: int, rows: int, tau: FloatArray, x: FloatArray, dot: FloatArray, lanes: int
) -> None:
    """Apply the Householder reflector of column c, with unit first entry and factors ``tau`` (l,), to ``x``
    (rows, l)."""
    first = x[c]
    for lane in range(lanes):
        dot[lane] = first[lane]
    for r in range(c + 1, rows):
        v, entry = reflector[r], x[r]
        for lane in range(lanes):
            dot[lane] += v[lane] * entry[lane]
    for lane in range(lanes):
        dot[lane] *= tau[lane]
        first[lane] -= dot[lane]
    for r in range(c + 1, rows):
        v, entry = reflector[r], x[r]
        for lane in range(lanes):
            entry[lane] -= dot[lane] * v[lane]


@inner
def _householder(
    matrix: FloatArray, rows: int, tau: FloatArray, diagonal: FloatArray, dot: FloatArray, lanes: int
) -> None:
    """Householder QR of ``matrix`` (c, rows, l) in place: reflectors below the diagonal with factors ``tau``
    (c, l), R above it and in ``diagonal`` (c, l)."""
    for c in range(len(matrix)):
        own = matrix[c]
        for lane in range(lanes):
            dot[lane] = 0.0
        for r in range(c, rows):
            entry = own[r]
            for lane in range(lanes):
                dot[lane] += entry[lane] * entry[lane]
        for lane in range(lanes):
            norm = math.sqrt(dot[lane])
            alpha = -norm if own[c, lane] > 0.0 else norm
            pivot = own[c, lane] - alpha
            diagonal[c, lane] = alpha
            tau[c, lane] = -pivot / alpha if norm > 0.0 else 0.0
            dot[lane] = pivot if norm > 0.0 else 1.0
        for r in range(c + 1, rows):
            entry = own[r]
            for lane in range(lanes):
                entry[lane] /= dot[lane]
        for other in range(c + 1, len(matrix)):
            _reflect(own, c, rows, tau[c], matrix[other], dot, lanes)


@inner
def _solve(
    matrix: FloatArray,
    rows: int,
    tau: FloatArray,
    diagonal: FloatArray,
    x: FloatArray,
    dot: FloatArray,
    lanes: int,
) -> None:
    """Q R^-T ``x`` in place; the right-hand side is in the first rows of ``x`` (rows, l), one per column."""
    columns = len(matrix)
    for c in range(columns):
        entry, pivot = x[c], diagonal[c]
        for r in range(c):
            above, before = matrix[c, r], x[r]
            for lane in range(lanes):
                entry[lane] -= above[lane] * before[lane]
        for lane in range(lanes):
            entry[lane] /= pivot[lane]
    for r in range(columns, rows):
        entry = x[r]
        for lane in range(lanes):
            entry[lane] = 0.0
    for c in range(columns - 1, -1, -1):
        _reflect(matrix[c], c, rows, tau[c], x, dot, lanes)


@kernel
def mls_weights(
    points: Float2,
    indptr: Int1,
    indices: Int1,
    centers: Float2,
    targets: Float2,
    radii: Float1,
    degree: int,
    sharpness: float,
    least: int,
    order: int,
    weights: FloatOut2,
    ratio: FloatOut1,
) -> None:
    """Weights (nnz, kinds) of the local polynomial's derivatives at ``targets``, equally many per centre.

    The polynomial of ``degree`` in (x - centre)/R is fitted to the values at ``points[indices[...]]``, with
    the weight exp(-2 sharpness r^2) on squared residuals. Kinds are the derivatives of orders ``least`` to
    ``order`` <= 2 among value, d/dx, d/dy, d2/dx2, d2/dxdy, d2/dy2, target by target. ``ratio`` (e,) receives
    the smallest over the largest diagonal entry of R: zero where the stencil is rank-deficient.
    """
    columns, kinds = (degree + 1) * (degree + 2) // 2, weights.shape[1]
    several, widest = targets.shape[0] // max(centers.shape[0], 1), 0
    for e in range(centers.shape[0]):
        widest = max(widest, indptr[e + 1] - indptr[e])
    matrix, solved = np.empty((columns, widest, LANES)), np.empty((kinds, widest, LANES))
    local_x, local_y = np.empty((widest, LANES)), np.empty((widest, LANES))
    gauss, dot = np.empty((widest, LANES)), np.empty(LANES)
    tau, diagonal = np.empty((columns, LANES)), np.empty((columns, LANES))
    done = 0
    while done < centers.shape[0]:
        first, lanes, rows = done, 1, indptr[done + 1] - indptr[done]
        most = min(LANES, len(indptr) - 1 - first)
        while lanes < most and indptr[first + lanes + 1] - indptr[first + lanes] == rows:
            lanes += 1
        done += lanes
        if rows < columns:
            ratio[first:done] = 0.0
            continue
        for lane in range(lanes):
            e = first + lane
            scale = 1.0 / radii[e]
            for r in range(rows):
                node = indices[indptr[e] + r]
                x = (points[node, 0] - centers[e, 0]) * scale
                y = (points[node, 1] - centers[e, 1]) * scale
                local_x[r, lane], local_y[r, lane] = x, y
                gauss[r, lane] = math.exp(-sharpness * (x * x + y * y))
            which = 0
            for target in range(several * e, several * (e + 1)):
                x = (targets[target, 0] - centers[e, 0]) * scale
                y = (targets[target, 1] - centers[e, 1]) * scale
                for total in range(least, order + 1):
                    for dy in range(total + 1):
                        # The derivative of every monomial there.
                        dx, column = total - dy, 0
                        for whole in range(degree + 1):
                            for j in range(whole + 1):
                                i, value = whole - j, 0.0
                                if i >= dx and j >= dy:
                                    value = x ** (i - dx) * y ** (j - dy)
                                    for step in range(dx):
                                        value *= i - step
                                    for step in range(dy):
                                        value *= j - step
                                solved[which, column, lane] = value
                                column += 1
                        which += 1
        for r in range(rows):
            copy_to(matrix[0, r], gauss[r])
            _monomials(degree, local_x[r], local_y[r], matrix[:, r], lanes)
        _householder(matrix, rows, tau, diagonal, dot, lanes)
        for which in range(kinds):
            _solve(matrix, rows, tau, diagonal, solved[which], dot, lanes)
        for lane in range(lanes):
            e = first + lane
            smallest, largest = math.inf, 0.0
            for column in range(columns):
                size = abs(diagonal[column, lane])
                smallest, largest = min(smallest, size), max(largest, size)
            ratio[e] = smallest / largest
            if ratio[e] == 0.0:
                continue
            which = 0
            for _ in range(several):
                for total in range(least, order + 1):
                    factor = (1.0 / radii[e]) ** total
                    for _ in range(total + 1):
                        for r in range(rows):
                            weights[indptr[e] + r, which] = solved[which, r, lane] * gauss[r, lane] * factor
                        which += 1


@kernel
def apply_weights(indptr: Int1, indices: Int1, weights: Float2, field: Float2, result: FloatOut3) -> None:
    """Apply ``weights`` (nnz, kinds) to a ``field`` (n, c): ``result`` (e, kinds, c), zero at first."""
    for e in range(len(indptr) - 1):
        for entry in range(indptr[e], indptr[e + 1]):
            for kind in range(weights.shape[1]):
                for c in range(field.shape[1]):
                    result[e, kind, c] += weights[entry, kind] * field[indices[entry], c]
