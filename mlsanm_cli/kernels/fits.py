"""Derivatives of nodal fields by local least-squares fits, without forming weights."""

from __future__ import annotations

import math

import numpy as np

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.kernels.aot.jit import inner, kernel
from mlsanm_cli.kernels.aot.signature import Float1, Float2, FloatOut1, FloatOut3, Int2


@inner
def _monomials(degree: int, x: float, y: float, row: FloatArray) -> None:
    """All x^i y^j of total degree up to ``degree``, ordered by degree, then by the power of y."""
    row[0] = 1.0
    first = 0
    for total in range(1, degree + 1):
        before = first
        first += total
        for power in range(total):
            row[first + power] = row[before + power] * x
        row[first + total] = row[before + total - 1] * y


@inner
def _gram(degree: int, moments: FloatArray, gram: FloatArray) -> None:
    """Lower triangle of the Gram matrix of all monomials, from ``moments`` of twice the degree."""
    row = 0
    for total in range(degree + 1):
        for power in range(total + 1):
            column = 0
            for other in range(total + 1):
                together = total + other
                first = together * (together + 1) // 2 + power
                for p in range(other + 1):
                    gram[row, column] = moments[first + p]
                    column += 1
            row += 1


@inner
def _cholesky(matrix: FloatArray, columns: int) -> float:
    """Lower Cholesky factor in place, with inverted diagonal; returns the ratio of its smallest to its
    largest diagonal entry, 0 if the matrix is not positive definite."""
    smallest = math.inf
    largest = 0.0
    for c in range(columns):
        for r in range(c):
            value = matrix[c, r]
            for k in range(r):
                value -= matrix[c, k] * matrix[r, k]
            matrix[c, r] = value * matrix[r, r]
        value = matrix[c, c]
        for k in range(c):
            value -= matrix[c, k] * matrix[c, k]
        if not value > 0.0:
            return 0.0
        root = math.sqrt(value)
        smallest = min(smallest, root)
        largest = max(largest, root)
        matrix[c, c] = 1.0 / root
    return smallest / largest


@inner
def _solve(factor: FloatArray, columns: int, vector: FloatArray) -> None:
    """Forward and backward substitution in place."""
    for c in range(columns):
        value = vector[c]
        for k in range(c):
            value -= factor[c, k] * vector[k]
        vector[c] = value * factor[c, c]
    for c in range(columns - 1, -1, -1):
        value = vector[c] * factor[c, c]
        vector[c] = value
        for k in range(c):
            vector[k] -= factor[c, k] * value


@kernel
def fit_derivatives(
    points: Float2,
    numbers: Int2,
    centers: Float2,
    radii: Float1,
    degree: int,
    sharpness: float,
    field: Float2,
    result: FloatOut3,
    ratio: FloatOut1,
) -> None:
    """Value and derivatives at ``centers`` (e, 2) of fits to a nodal ``field`` (n, c): ``result`` (e, 6, c).

    Fit i is a polynomial of ``degree`` >= 2 in (x - centre)/radius through the nodes ``points[numbers[i]]``,
    ``numbers`` (e, k), with the weight function and ``ratio`` (e,) of
    :func:`mlsanm_cli.kernels.stencils.mls_weights`. Solved by the normal equations and one step of iterative
    refinement, which restores the lost digits (Bjorck 1987, doi:10.1016/0024-3795(87)90101-7). The result is
    undefined where the ratio is 0.
    """
    count = numbers.shape[1]
    fields = field.shape[1]
    columns = (degree + 1) * (degree + 2) // 2
    wide = (2 * degree + 1) * (2 * degree + 2) // 2
    monomial = np.empty((count, wide))
    weight = np.empty(count)
    moments = np.empty(wide)
    gram = np.empty((columns, columns))
    coefficients = np.empty(columns)
    step = np.empty(columns)
    for e in range(centers.shape[0]):
        if count < columns:
            ratio[e] = 0.0
            continue
        scale = 1.0 / radii[e]
        moments[:] = 0.0
        for i in range(count):
            x = (points[numbers[e, i], 0] - centers[e, 0]) * scale
            y = (points[numbers[e, i], 1] - centers[e, 1]) * scale
            weight[i] = math.exp(-2.0 * sharpness * (x * x + y * y))
            row = monomial[i]
            _monomials(2 * degree, x, y, row)
            for t in range(wide):
                moments[t] += weight[i] * row[t]
        _gram(degree, moments, gram)
        ratio[e] = _cholesky(gram, columns)
        if ratio[e] == 0.0:
            continue
        for c in range(fields):
            coefficients[:] = 0.0
            for again in range(2):
                step[:] = 0.0
                for i in range(count):
                    rest = field[numbers[e, i], c]
                    if again:
                        for t in range(columns):
                            rest -= monomial[i, t] * coefficients[t]
                    rest *= weight[i]
                    for t in range(columns):
                        step[t] += rest * monomial[i, t]
                _solve(gram, columns, step)
                for t in range(columns):
                    coefficients[t] += step[t]
            result[e, 0, c] = coefficients[0]
            result[e, 1, c] = coefficients[1] * scale
            result[e, 2, c] = coefficients[2] * scale
            result[e, 3, c] = 2.0 * coefficients[3] * scale * scale
            result[e, 4, c] = coefficients[4] * scale * scale
            result[e, 5, c] = 2.0 * coefficients[5] * scale * scale
