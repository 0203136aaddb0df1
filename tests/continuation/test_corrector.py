"""Newton corrections of start points and of ends of steps."""

from __future__ import annotations

import numpy as np
import pytest

from mlsanm_cli.continuation import FloatArray, Tangent, correct
from mlsanm_cli.continuation.corrector import Effort
from mlsanm_cli.continuation.problem import Problem
from mlsanm_cli.errors import NumericalError

from .problems import Circle, Contact, DenseTangent, Scalar, random_contact


class Watched(Contact):
    """Contact problem that refuses to be evaluated at a closed gap."""

    def equations(self, x: FloatArray, lam: float) -> FloatArray:
        assert self.admissible(x, lam)
        return super().equations(x, lam)


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
        return DenseTangent(np.atleast_2d(1.0 / (1.0 + x * x)), self.counts)


def test_damping_makes_the_residual_fall() -> None:
    found = correct(Arctan(0.0, 1.0), np.array([5.0]), 0.0)
    assert found.x[0] == pytest.approx(0.0, abs=1e-10)
