"""Newton corrections of start points and of ends of steps."""

from __future__ import annotations

import numpy as np
import pytest

from mlsanm_cli.continuation import AnmOptions, FloatArray, Tangent, correct
from mlsanm_cli.continuation.corrector import Effort, correct_end
from mlsanm_cli.continuation.expansion import expansion_point
from mlsanm_cli.continuation.problem import Problem
from mlsanm_cli.errors import NumericalError

from .problems import Circle, Contact, DenseTangent, Scalar, Truss, random_contact


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


def test_solution_is_left_alone() -> None:
    problem = Scalar(0.0, 1.0, 1.0)
    assert correct(problem, np.array([1.0]), 2.0).x[0] == 1.0
    assert problem.counts.tangents == 0


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


def test_end_of_step_keeps_the_load_factor() -> None:
    """From a point 1e-4 away from the truss path, with the tangent of the expansion point at w = 0.9."""
    problem, effort = Truss(), Effort()
    start = expansion_point(problem, np.array([0.9]), problem.load(0.9))
    found = correct_end(problem, start, np.array([0.8001]), problem.load(0.8), AnmOptions(), effort)
    assert found is not None
    assert found.lam == problem.load(0.8)
    assert found.x[0] == pytest.approx(0.8, abs=1e-10)


def test_old_tangent_is_used_first_and_a_fresh_one_when_it_stalls() -> None:
    near, far = Truss(), Truss()
    efforts = []
    for problem, w in ((near, 0.8999), (far, 0.65)):
        effort = Effort()
        start = expansion_point(problem, np.array([0.9]), problem.load(0.9))
        end = np.array([w + 1e-7]), problem.load(w)
        assert correct_end(problem, start, *end, AnmOptions(), effort) is not None
        # The expansion point took one factorisation and one solve of its own.
        assert problem.counts.tangents == effort["factorizations"] + 1
        assert problem.counts.solves == effort["solves"] + 1
        efforts.append(effort)
    assert efforts[0]["factorizations"] == 0
    assert efforts[1]["factorizations"] >= 1
    assert efforts[1]["updates"] == efforts[1]["factorizations"]  # the slow update was thrown away
