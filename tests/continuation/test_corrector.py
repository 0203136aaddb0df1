"""Newton corrections of start points; coefficients of the series against closed forms and the path itself."""

from __future__ import annotations

import numpy as np
import pytest

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.continuation.corrector import Effort, correct
from mlsanm_cli.continuation.problem import Metric, Problem, Tangent, expand, expansion_point
from mlsanm_cli.continuation.series import Branch
from mlsanm_cli.errors import NumericalError

from .problems import Circle, Contact, DenseTangent, Scalar, Truss, random_contact


class Watched(Contact):
    """Contact problem that refuses to be evaluated at a closed gap."""

    def residual(self, x: FloatArray, lam: float) -> FloatArray:
        assert self.admissible(x, lam)
        return super().residual(x, lam)


def watched(eta: float, seed: int) -> Watched:
    plain = random_contact(20, eta, seed)
    return Watched(plain.compliance, plain.gap, plain.push, eta)


@pytest.mark.parametrize("seed", range(5))
def test_damping_never_lets_a_gap_close(seed: int) -> None:
    problem = watched(1e-3, seed)
    start = problem.guess
    # An undamped first update would go through the constraint.
    update = problem.tangent(start, 1.0).solve(-problem.residual(start, 1.0))
    assert not problem.admissible(start + update, 1.0)
    effort = Effort()
    found = correct(problem, start, 1.0, effort=effort)
    assert found.residual <= 1e-10
    assert float(np.abs(problem.residual(found.x, 1.0)).max()) == found.residual
    assert effort["updates"] == effort["factorizations"] == effort["solves"] > 3


def test_start_point_outside_is_refused() -> None:
    problem = random_contact(5, 1e-2, 0)
    x = problem.guess
    x[-1] = -1e-3
    with pytest.raises(NumericalError, match="not admissible") as caught:
        correct(problem, x, 0.0)
    assert caught.value.hint


@pytest.mark.parametrize(
    ("problem", "start", "lam", "words"),
    [
        (Scalar(0.0, 0.0, 1.0), 1.1, -1.0, "no solution found"),  # x^2 = -1
        (Circle(), 0.0, 0.5, "singular tangent"),
    ],
)
def test_failures_have_a_hint(problem: Problem, start: float, lam: float, words: str) -> None:
    with pytest.raises(NumericalError, match=words) as caught:
        correct(problem, np.array([start]), lam)
    assert caught.value.hint


class Arctan(Scalar):
    """arctan(x) = lam: plain Newton diverges from abs(x) > 1.39."""

    def residual(self, x: FloatArray, lam: float) -> FloatArray:
        return np.arctan(x) - lam

    def tangent(self, x: FloatArray, lam: float) -> Tangent:
        return DenseTangent(np.atleast_2d(1.0 / (1.0 + x * x)))


def test_damping_makes_the_residual_fall() -> None:
    found = correct(Arctan(0.0, 1.0), np.array([5.0]), 0.0)
    assert found.x[0] == pytest.approx(0.0, abs=1e-10)


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
