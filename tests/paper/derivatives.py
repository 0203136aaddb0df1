"""Numerical derivatives shared by the tests of the contact laws."""

from __future__ import annotations

import numpy as np

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.continuation import Problem


def tangent_times(problem: Problem, x: FloatArray, lam: float, v: FloatArray) -> FloatArray:
    """The derivative of the residual along v; central differences are exact for quadratic equations."""
    return 0.5 * (problem.residual(x + v, lam) - problem.residual(x - v, lam))


def highest_terms(problem: Problem, x: FloatArray, lam: FloatArray) -> tuple[FloatArray, FloatArray, float]:
    """Along x(a) = sum x_r a^r, (order + 1, size), lam(a) likewise: the residual's coefficient of a^order,
    interpolated; what tangent, load derivative and right-hand side make of it; the largest coefficient."""
    order = len(lam) - 1
    nodes = np.cos(np.pi * (np.arange(2 * order + 1) + 0.5) / (2 * order + 1))
    powers = nodes[:, None] ** np.arange(order + 1)
    residuals = [problem.residual(p @ x, float(p @ lam)) for p in powers]
    coefficients = np.linalg.solve(nodes[:, None] ** np.arange(2 * order + 1), np.array(residuals))
    expected = tangent_times(problem, x[0], lam[0], x[order])
    expected += problem.load_derivative(x[0], lam[0]) * lam[order]
    expected -= problem.series_rhs(x[:order], lam[:order])
    return coefficients[order], expected, float(np.abs(coefficients).max())
