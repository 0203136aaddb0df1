"""Coefficients of the series against closed forms and against the path itself."""

from __future__ import annotations

import numpy as np
import pytest

from mlsanm_cli.continuation import Branch, Problem, correct
from mlsanm_cli.continuation.expansion import Metric, expand, expansion_point

from .problems import Circle, Contact, Scalar, Truss, random_contact


def series_at(problem: Problem, x: np.ndarray, lam: float, order: int, unit: float = 1.0) -> Branch:
    metric = Metric(problem.scale)
    upward = (np.zeros(problem.size), 1.0)
    return expand(problem, metric, expansion_point(problem, x, lam), order, upward, unit)[0]


def residual_orders(problem: Problem, series: Branch) -> list[float]:
    """Return log2 of the fall of the residual when the parameter is halved, for each truncation order."""
    rates = []
    for order in range(1, series.lam.size):
        errors = []
        for a in (0.2, 0.1):
            powers = a ** np.arange(order + 1.0)
            residual = problem.residual(
                powers @ series.x[: order + 1], float(powers @ series.lam[: order + 1])
            )
            errors.append(float(np.abs(residual).max()))
        rates.append(float(np.log2(errors[0] / errors[1])))
    return rates


def test_circle_has_the_series_of_its_tangent_parameter() -> None:
    # From (0.8, 0.6): X = (0.8, 0.6) sqrt(1 - a^2) + (-0.6, 0.8) a
    series = series_at(Circle(), np.array([0.8]), 0.6, 8)
    root = np.array([1.0, 0.0, -1 / 2, 0.0, -1 / 8, 0.0, -1 / 16, 0.0, -5 / 128])
    linear = np.eye(9)[1]
    np.testing.assert_allclose(series.x[:, 0], 0.8 * root - 0.6 * linear, atol=1e-15)
    np.testing.assert_allclose(series.lam, 0.6 * root + 0.8 * linear, atol=1e-15)


@pytest.mark.parametrize(
    ("problem", "x", "lam"),
    [
        (Scalar(0.0, 1.0, 0.4, 0.2), np.zeros(1), 0.0),
        (Truss(), np.array([0.9]), Truss().load(0.9)),
        (random_contact(6, 0.3, 4), None, 0.1),
    ],
    ids=["cubic", "truss", "contact"],
)
def test_residual_of_order_k_truncation_falls_with_power_k_plus_1(
    problem: Problem, x: np.ndarray | None, lam: float
) -> None:
    if x is None:
        assert isinstance(problem, Contact)
        x = correct(problem, problem.guess, lam).x
    unit = 0.1 if isinstance(problem, Contact) else 0.5
    rates = residual_orders(problem, series_at(problem, x, lam, 5, unit))
    for order, rate in enumerate(rates, start=1):
        assert rate > order + 0.5, rates


def test_residual_of_the_start_is_led_to_zero() -> None:
    problem = random_contact(8, 0.2, 3)
    x = correct(problem, problem.guess, 0.0).x + 1e-5
    start = problem.residual(x, 0.0)
    series = series_at(problem, x, 0.0, 20, unit=0.02)
    for a in (0.0, 0.5, 1.0, 1.5):
        powers = a ** np.arange(21.0)
        residual = problem.residual(powers @ series.x, float(powers @ series.lam))
        np.testing.assert_allclose(residual, (1.0 - a) * start, atol=1e-13)
