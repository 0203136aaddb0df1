"""Moving least-squares weights: one small weighted QR per evaluation point."""

from __future__ import annotations

import math

import numpy as np

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.kernels.jit import inner, kernel
from mlsanm_cli.kernels.signature import Float1, Float2, FloatOut1, FloatOut2, FloatOut3, Int1


@inner
def _monomials(degree: int, x: float, y: float, row: FloatArray) -> None:
    """All x^i y^j of total degree up to ``degree``, ordered by degree, then by the power of y."""
    column = 0
    for total in range(degree + 1):
        for power in range(total + 1):
            row[column] = x ** (total - power) * y**power
            column += 1


@inner
def _functional(degree: int, dx: int, dy: int, x: float, y: float, row: FloatArray) -> None:
    """The derivative d^(dx+dy)/dx^dx dy^dy of every monomial at (x, y)."""
    column = 0
    for total in range(degree + 1):
        for power in range(total + 1):
            i = total - power
            j = power
            if i < dx or j < dy:
                row[column] = 0.0
            else:
                value = x ** (i - dx) * y ** (j - dy)
                for step in range(dx):
                    value *= i - step
                for step in range(dy):
                    value *= j - step
                row[column] = value
            column += 1


@inner
def _householder(matrix: FloatArray, rows: int, columns: int, tau: FloatArray, diagonal: FloatArray) -> None:
    """QR in place: reflectors below the diagonal (unit first entry kept apart in ``tau``), R above it."""
    for c in range(columns):
        norm = 0.0
        for r in range(c, rows):
            norm += matrix[r, c] * matrix[r, c]
        norm = math.sqrt(norm)
        if norm == 0.0:
            tau[c] = 0.0
            diagonal[c] = 0.0
            continue
        alpha = -norm if matrix[c, c] > 0.0 else norm
        pivot = matrix[c, c] - alpha
        for r in range(c + 1, rows):
            matrix[r, c] /= pivot
        tau[c] = -pivot / alpha
        diagonal[c] = alpha
        for other in range(c + 1, columns):
            dot = matrix[c, other]
            for r in range(c + 1, rows):
                dot += matrix[r, c] * matrix[r, other]
            dot *= tau[c]
            matrix[c, other] -= dot
            for r in range(c + 1, rows):
                matrix[r, other] -= dot * matrix[r, c]


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
    order: int,
    weights: FloatOut2,
    ratio: FloatOut1,
) -> None:
    """Weights of the local polynomial's value and derivatives at ``targets``.

    The polynomial of ``degree`` in (x - centre)/R is fitted to the values at ``points[indices[...]]`` with
    the Gaussian exp(-2 sharpness r^2) on the squared residual. ``order`` 0, 1 or 2 says how many of value,
    d/dx, d/dy, d2/dx2, d2/dxdy, d2/dy2 are wanted; ``weights`` is (nnz, 1 | 3 | 6). ``ratio`` receives the
    smallest over the largest diagonal entry of R: zero where the stencil cannot carry the polynomial.
    """
    columns = (degree + 1) * (degree + 2) // 2
    widest = 0
    for e in range(centers.shape[0]):
        widest = max(widest, indptr[e + 1] - indptr[e])
    matrix = np.empty((widest, columns))
    gauss = np.empty(widest)
    tau = np.empty(columns)
    diagonal = np.empty(columns)
    wanted = np.empty(columns)
    vector = np.empty(widest)
    for e in range(centers.shape[0]):
        start = indptr[e]
        rows = indptr[e + 1] - start
        scale = 1.0 / radii[e]
        for r in range(rows):
            x = (points[indices[start + r], 0] - centers[e, 0]) * scale
            y = (points[indices[start + r], 1] - centers[e, 1]) * scale
            gauss[r] = math.exp(-sharpness * (x * x + y * y))
            _monomials(degree, x, y, matrix[r])
            for c in range(columns):
                matrix[r, c] *= gauss[r]
        if rows < columns:
            ratio[e] = 0.0
            continue
        _householder(matrix, rows, columns, tau, diagonal)
        smallest = math.inf
        largest = 0.0
        for c in range(columns):
            smallest = min(smallest, abs(diagonal[c]))
            largest = max(largest, abs(diagonal[c]))
        ratio[e] = smallest / largest
        if smallest == 0.0:
            continue
        x = (targets[e, 0] - centers[e, 0]) * scale
        y = (targets[e, 1] - centers[e, 1]) * scale
        which = 0
        for total in range(order + 1):
            for dy in range(total + 1):
                _functional(degree, total - dy, dy, x, y, wanted)
                for c in range(columns):
                    value = wanted[c]
                    for r in range(c):
                        value -= matrix[r, c] * vector[r]
                    vector[c] = value / diagonal[c]
                for r in range(columns, rows):
                    vector[r] = 0.0
                for c in range(columns - 1, -1, -1):
                    dot = vector[c]
                    for r in range(c + 1, rows):
                        dot += matrix[r, c] * vector[r]
                    dot *= tau[c]
                    vector[c] -= dot
                    for r in range(c + 1, rows):
                        vector[r] -= dot * matrix[r, c]
                factor = scale**total
                for r in range(rows):
                    weights[start + r, which] = vector[r] * gauss[r] * factor
                which += 1


@kernel
def apply_weights(indptr: Int1, indices: Int1, weights: Float2, field: Float2, result: FloatOut3) -> None:
    """``result`` (e, kinds, c), zero at first: the sums by ``weights`` (nnz, kinds) of a ``field`` (n, c)."""
    for e in range(len(indptr) - 1):
        for entry in range(indptr[e], indptr[e + 1]):
            for kind in range(weights.shape[1]):
                for c in range(field.shape[1]):
                    result[e, kind, c] += weights[entry, kind] * field[indices[entry], c]
