"""What the tests of all contact laws differentiate alike."""

from __future__ import annotations

import numpy as np

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.continuation import Problem
from mlsanm_cli.continuation.problem import SeriesTangent


def tangent_times(problem: Problem, x: FloatArray, lam: float, v: FloatArray) -> FloatArray:
    """The derivative of the residual along v; central differences are exact for quadratic equations."""
    return 0.5 * (problem.residual(x + v, lam) - problem.residual(x - v, lam))


def lack_of_orders(problem: Problem, tangent: SeriesTangent, x: FloatArray, seed: int) -> float:
    """By how much the tangent's own high orders miss those solved one by one, relative to each order."""
    rng, order = np.random.default_rng(seed), 6
    slope, normal, size = rng.normal(size=problem.size), rng.normal(size=problem.size), 3.0
    series = np.concatenate([x[None], rng.normal(size=(order, problem.size))])
    lam = rng.normal(size=order + 1)
    own, own_lam = series.copy(), lam.copy()
    tangent.orders(own, own_lam, slope, normal, size)
    for k in range(2, order + 1):
        free = tangent.solve(problem.series_rhs(series[:k], lam[:k]))
        lam[k] = -float(normal @ free) / size
        series[k] = free + lam[k] * slope
    sizes = np.abs(series).max(axis=1)
    return float(max((np.abs(own - series).max(axis=1) / sizes).max(), (np.abs(own_lam - lam) / sizes).max()))
