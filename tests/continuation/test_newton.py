"""Newton-Raphson from state to state: levels, folds, events, counts, and what it cannot reach."""

from __future__ import annotations

from typing import Literal

import numpy as np
import pytest

from mlsanm_cli.continuation import NewtonOptions, StopReason, follow

from .contact_problems import open_start
from .problems import Circle, Scalar, Truss
from .test_corrector import watched


@pytest.mark.parametrize("control", ["load", "arc-length"])
def test_levels_are_ends_of_steps(control: Literal["load", "arc-length"]) -> None:
    levels = (0.3, 1.0 / 3.0, 7.0, 49.999)
    options = NewtonOptions(control=control)
    follower = follow(Scalar(0.0, 1.0, 1.0), np.zeros(1), 0.0, 50.0, options, levels=levels)
    steps = {step.lam: step for step in follower.steps()}
    assert follower.outcome.reached
    assert {*levels, 50.0} <= steps.keys()
    for lam, step in steps.items():
        assert step.x[0] == pytest.approx(0.5 * (np.sqrt(1.0 + 4.0 * lam) - 1.0), rel=1e-9)
        assert step.order == 0
        x, reached = step.branch.evaluate(step.branch.length)
        assert (x[0], reached) == pytest.approx((step.x[0], lam), rel=1e-13)
        weights = step.branch.derivative_weights(np.array([0.0, step.branch.length]))
        slope = (weights @ step.branch.terms[0])[:, 0] / (weights @ step.branch.terms[1])
        ends = step.branch.weights(np.array([0.0, step.branch.length])) @ step.branch.terms[0][:, 0]
        assert slope == pytest.approx(1.0 / (1.0 + 2.0 * ends), rel=1e-6)


def test_the_truss_snaps_through_both_folds() -> None:
    target = 2.0 / (3.0 * np.sqrt(3.0))
    follower = follow(Truss(), np.ones(1), 0.0, target, NewtonOptions(control="arc-length"))
    steps = list(follower.steps())
    assert follower.outcome.reached
    assert np.all(np.diff([step.x[0] for step in steps]) < 0.0)
    assert min(step.lam for step in steps) < -0.45 * target
    roots = np.roots([-0.5, 0.0, 0.5, -target])
    assert follower.outcome.x[0] == pytest.approx(float(roots[np.abs(roots.imag) < 1e-9].real[0]), abs=1e-8)


def test_load_control_says_that_it_cannot_pass_a_fold() -> None:
    follower = follow(Circle(), np.ones(1), 0.0, 1.5, NewtonOptions())
    steps = list(follower.steps())
    assert not follower.outcome.reached
    assert follower.outcome.reason in (StopReason.CORRECTION_FAILED, StopReason.SINGULAR_TANGENT)
    assert 0.99 < steps[-1].lam <= 1.0 + 1e-8


def test_no_trial_leaves_the_admissible_region() -> None:
    problem = watched(1e-4, 3)  # asserts so itself
    follower = follow(problem, open_start(problem), 0.0, 1.0, NewtonOptions(first=1.0))
    steps = list(follower.steps())
    assert follower.outcome.reached
    assert max(step.residual for step in steps) <= 1e-8
