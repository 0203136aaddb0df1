"""What the tests of all contact laws differentiate alike."""

from __future__ import annotations

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.continuation import Problem


def tangent_times(problem: Problem, x: FloatArray, lam: float, v: FloatArray) -> FloatArray:
    """The derivative of the residual along v; central differences are exact for quadratic equations."""
    return 0.5 * (problem.residual(x + v, lam) - problem.residual(x - v, lam))
