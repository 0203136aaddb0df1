"""How paths end: named reasons, failures, the caller, senseless options."""

from __future__ import annotations

import numpy as np
import pytest

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.continuation import follow
from mlsanm_cli.continuation.path import StopReason
from mlsanm_cli.continuation.problem import AnmOptions, SingularTangentError, Tangent

from .problems import Circle, Scalar


class Wall(Scalar):
    """x = lam, allowed up to x = 0.5 only."""

    def admissible(self, x: FloatArray, lam: float) -> bool:
        return bool(x[0] < 0.5)


class Hole(Scalar):
    """x = lam, not allowed for 0.4 < x < 0.6."""

    def admissible(self, x: FloatArray, lam: float) -> bool:
        return not 0.4 < x[0] < 0.6


class Kink(Scalar):
    """x = lam with a residual that jumps at x = 0.5, where no series holds."""

    def residual(self, x: FloatArray, lam: float) -> FloatArray:
        return super().residual(x, lam) + 0.1 * (x > 0.5)


class Broken(Scalar):
    """x + x^2 = lam that can be factorised at the start only."""

    def tangent(self, x: FloatArray, lam: float) -> Tangent:
        if x[0] != 0.0:
            raise SingularTangentError("broken")
        return super().tangent(x, lam)


class Steep(Scalar):
    """x + x^2 = lam with a load derivative that beyond the start is that of a fold."""

    def load_derivative(self, x: FloatArray, lam: float) -> FloatArray:
        return super().load_derivative(x, lam) * (1.0 if x[0] == 0.0 else 1e9)


@pytest.mark.parametrize(
    ("problem", "options", "reason", "last"),
    [
        (Wall(0.0, 1.0), AnmOptions(), StopReason.NOT_ADMISSIBLE, 0.5),
        (Hole(0.0, 1.0), AnmOptions(), StopReason.NOT_ADMISSIBLE, 0.4),
        (Kink(0.0, 1.0), AnmOptions(), StopReason.STEP_TOO_SMALL, 0.5),
        (Broken(0.0, 1.0, 1.0), AnmOptions(), StopReason.SINGULAR_TANGENT, 0.0),
        (Steep(0.0, 1.0, 1.0), AnmOptions(), StopReason.SINGULAR_TANGENT, 0.0),
    ],
)
def test_reasons_to_stop_are_named(
    problem: Scalar, options: AnmOptions, reason: StopReason, last: float
) -> None:
    follower = follow(problem, np.zeros(1), 0.0, 1.0, options)
    steps = list(follower.steps())
    assert follower.reason is reason
    assert not follower.reached
    assert follower.message
    assert follower.lam == pytest.approx(last, abs=1e-6)
    if steps:
        assert (follower.lam, follower.residual) == (steps[-1].lam, steps[-1].residual)
    assert follower.residual <= options.tolerance


def test_end_that_cannot_be_corrected_keeps_the_tolerance() -> None:
    options = AnmOptions(order=4, tolerance=1e-3, pade=False)
    follower = follow(Broken(0.0, 1.0, 1.0), np.zeros(1), 0.0, 0.2, options)
    step = next(follower.steps())
    assert step.lam == 0.2
    assert options.goal < step.residual <= options.tolerance


def test_start_at_a_fold_is_a_singular_tangent() -> None:
    follower = follow(Circle(), np.zeros(1), 1.0, 0.0)
    assert list(follower.steps()) == []
    assert follower.reason is StopReason.SINGULAR_TANGENT


def test_start_at_the_target_takes_no_step() -> None:
    follower = follow(Scalar(0.0, 1.0), np.zeros(1), 0.3, 0.3)
    assert list(follower.steps()) == []
    assert follower.reached
    assert follower.x[0] == pytest.approx(0.3, abs=1e-15)
