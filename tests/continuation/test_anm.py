"""Paths with known answers: folds, targets, reasons to stop, counts; contact problems."""

from __future__ import annotations

from itertools import islice, pairwise
from typing import Literal

import numpy as np
import pytest

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.continuation import follow
from mlsanm_cli.continuation.path import Step, StopReason
from mlsanm_cli.continuation.problem import AnmOptions, NewtonOptions, Problem
from mlsanm_cli.continuation.series import Branch

from .problems import Circle, Contact, Scalar, Truss, Yielding, first_at, hertz
from .test_corrector import watched


def walked(
    problem: Problem, x: FloatArray, lam: float, end: float, options: AnmOptions | NewtonOptions | None = None
) -> list[Step]:
    follower = follow(problem, x, lam, end, options)
    steps = list(follower.steps())
    assert follower.reached, follower.message
    return steps


@pytest.mark.parametrize("exponent", [6, 10, 14, 15, 16, 20, 200])
def test_all_but_straight_path(exponent: int) -> None:
    """High coefficients of 1e-285 promise a range without end; the path is one step all the same."""
    problem = Scalar(0.0, 1.0, 10.0**-exponent)
    follower = follow(problem, np.zeros(1), 0.0, 1.0)
    assert len(list(follower.steps())) == 1
    assert follower.reached
    assert follower.x == pytest.approx([1.0], rel=2.0 * 10.0**-exponent + 1e-12)


@pytest.mark.parametrize("pade", [False, True])
def test_circle_is_gone_round_through_both_folds(pade: bool) -> None:
    problem = Circle()
    follower = follow(problem, np.ones(1), 0.0, 5.0, AnmOptions(pade=pade))
    angle, turned = 0.0, 0.0
    for step in islice(follower.steps(), 60):
        assert step.x[0] ** 2 + step.lam**2 == pytest.approx(1.0, abs=1e-8)
        now = float(np.arctan2(step.lam, step.x[0]))
        advance = (now - angle) % (2.0 * np.pi)
        assert advance < np.pi / 2.0  # always forward: the parameter is a projection on the tangent
        turned, angle = turned + advance, now
    assert turned > 4.0 * np.pi


def test_target_beyond_a_fold_is_reached_and_the_direction_behind_it_kept() -> None:
    upward = Branch(np.array([[0.8], [0.0]]), np.array([0.6, 1.0]), 0.1)
    steps = list(follow(Circle(), np.array([0.8]), 0.6, 0.5, previous=upward).steps())
    assert steps[-1].lam == 0.5
    assert steps[-1].x[0] == pytest.approx(-np.sqrt(0.75), abs=1e-9)
    assert max(step.lam for step in steps) > 0.6
    last = next(step for step in steps if step.x[0] < 0.0)
    assert last.lam > 0.5
    # Without the previous piece the path would leave toward lam = 0.99, back over the fold.
    onward = follow(Circle(), last.x, last.lam, 0.99, previous=last.branch)
    assert next(onward.steps()).x[0] < last.x[0]


def test_target_just_below_a_fold_is_not_stepped_over() -> None:
    steps = walked(Circle(), np.array([0.8]), 0.6, 1.0 - 1e-9, AnmOptions(order=8))
    assert steps[-1].lam == 1.0 - 1e-9
    assert steps[-1].x[0] == pytest.approx(np.sqrt(2e-9), rel=2e-2)


@pytest.mark.parametrize(
    "options", [AnmOptions(), NewtonOptions(control="arc-length")], ids=["anm", "newton"]
)
def test_truss_snaps_through_both_folds(options: AnmOptions | NewtonOptions) -> None:
    target = 2.0 / (3.0 * np.sqrt(3.0))  # twice the load at the fold
    steps = walked(Truss(), np.ones(1), 0.0, target, options)
    roots = np.roots([-0.5, 0.0, 0.5, -target])
    expected = float(roots[np.abs(roots.imag) < 1e-9].real[0])
    assert expected < -1.0
    assert steps[-1].x[0] == pytest.approx(expected, abs=1e-8)
    assert np.all(np.diff([step.x[0] for step in steps]) < 0.0)
    pieces = [step.branch for step in steps]
    lam = [piece.weights(np.linspace(0, piece.length, 500)) @ piece.terms[1] for piece in pieces]
    assert np.concatenate(lam).min() == pytest.approx(
        -0.5 * target, abs=1e-5 if isinstance(options, AnmOptions) else 0.05 * target
    )


def test_pieces_join_and_hold_every_load_factor() -> None:
    problem = hertz(40, 1e-3)
    steps = walked(problem, problem.guess, 0.0, 1.0, AnmOptions(order=12))
    branches = [step.branch for step in steps]
    for before, after in pairwise(branches):
        x, lam = before.evaluate(before.length)
        assert lam == after.lam[0]
        np.testing.assert_array_equal(x, after.x[0])
    for level in np.random.default_rng(0).uniform(0.0, 1.0, 100):
        x, lam = first_at(branches, level)
        assert lam == pytest.approx(level, rel=1e-13)
        assert np.abs(problem.residual(x, level)).max() <= 1.01e-8


@pytest.mark.parametrize("scale", [1e-2, 1e-4, 1e-6])
def test_what_is_hardly_held_turns_no_path_back(scale: float) -> None:
    """A residual within the tolerance moves it by more than a step is long."""
    problem = Yielding(1e-9, scale)
    walked(problem, np.array([1e-4, 1e-5]), 1e-4, 1.0, AnmOptions(pade=False))


def test_residuals_left_at_the_ends_do_not_pile_up() -> None:
    problem = hertz(40, 1e-4)
    steps = walked(problem, problem.guess, 0.0, 1.0, AnmOptions(order=8))
    assert len(steps) > 60
    residuals = np.array([step.residual for step in steps])
    assert residuals.max() <= 1e-8
    assert np.median(residuals[:-1]) > 1e-9  # steps go to the limit
    assert all(step.counts[0] == 0 and step.counts[1] <= 1 for step in steps[1:-1])
    assert residuals[-1] <= 1e-10


def test_a_path_taken_up_again_goes_on_as_before() -> None:
    problem = hertz(40, 1e-3)
    whole = walked(problem, problem.guess, 0.0, 1.0, AnmOptions())
    middle = whole[len(whole) // 2]
    rest = list(follow(problem, middle.x, middle.lam, 1.0, AnmOptions(), previous=middle.branch).steps())
    for one, two in zip(whole[len(whole) // 2 + 1 :], rest, strict=True):
        np.testing.assert_allclose(two.x, one.x, rtol=1e-9, atol=1e-9)
        assert two.lam == pytest.approx(one.lam, rel=1e-12)


def test_units_of_the_unknowns_change_nothing() -> None:
    factor, plain = 1e3, hertz(30, 1e-2)
    geometry = (plain.compliance / factor, plain.gap, plain.push)
    other = Contact(*geometry, plain.eta * factor, plain.opening, plain.pressure * factor, plain.length)
    one = walked(plain, plain.guess, 0.0, 1.0, AnmOptions())
    two = walked(other, other.guess, 0.0, 1.0, AnmOptions())
    assert len(one) == len(two)
    np.testing.assert_allclose(two[-1].x / other.scale, one[-1].x / plain.scale, rtol=0.0, atol=1e-9)


@pytest.mark.parametrize("control", ["load", "arc-length"])
def test_levels_are_ends_of_steps(control: Literal["load", "arc-length"]) -> None:
    levels = (0.3, 1.0 / 3.0, 7.0, 49.999)
    options = NewtonOptions(control=control)
    follower = follow(Scalar(0.0, 1.0, 1.0), np.zeros(1), 0.0, 50.0, options, levels=levels)
    steps = {step.lam: step for step in follower.steps()}
    assert follower.reached
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


def test_load_control_says_that_it_cannot_pass_a_fold() -> None:
    follower = follow(Circle(), np.ones(1), 0.0, 1.5, NewtonOptions())
    steps = list(follower.steps())
    assert not follower.reached
    assert follower.reason in (StopReason.CORRECTION_FAILED, StopReason.SINGULAR_TANGENT)
    assert 0.99 < steps[-1].lam <= 1.0 + 1e-8


def test_round_off_of_the_tangent_shortens_steps_only() -> None:
    """First coefficients off by 3e-8 leave residuals that grow linearly, not as the power N + 1."""

    class Inexact(Scalar):
        def matrix(self, x: FloatArray) -> FloatArray:
            return super().matrix(x) * (1.0 + 3e-8)

    assert walked(Inexact(0.0, 1.0, 0.01), np.zeros(1), 0.0, 3.0, AnmOptions(tolerance=1e-8))


def test_no_trial_leaves_the_admissible_region() -> None:
    problem = watched(1e-4, 3)  # asserts so itself
    follower = follow(problem, problem.guess, 0.0, 1.0, NewtonOptions())
    steps = list(follower.steps())
    assert follower.reached
    assert max(step.residual for step in steps) <= 1e-8


@pytest.mark.parametrize("pade", [True, False])
@pytest.mark.parametrize("eta", [1e-2, 1e-4])
def test_residual_holds_everywhere_between_the_ends_of_steps(pade: bool, eta: float) -> None:
    problem = hertz(60, eta)
    steps, rng = walked(problem, problem.guess, 0.0, 1.0, AnmOptions(pade=pade)), np.random.default_rng(11)
    assert any(step.branch.denominator is not None for step in steps) is pade
    for _ in range(200):
        branch = steps[rng.integers(len(steps))].branch
        x, lam = branch.evaluate(rng.uniform(0.0, branch.length))
        assert problem.admissible(x, lam)
        assert np.abs(problem.residual(x, lam)).max() <= 1e-8


def test_pieces_end_before_round_off_spoils_them() -> None:
    # The first pieces have their poles close together ahead, as along a branch cut.
    problem = hertz(120, 1e-4)
    steps = walked(problem, problem.guess, 0.0, 1.0)
    for step in steps[:3]:
        branch = step.branch
        near = np.linspace(0.99, 1.0, 50) * branch.length
        values = np.array([np.abs(problem.residual(*branch.evaluate(a))).max() for a in near])
        assert values.max() <= 1e-8
        assert np.abs(np.diff(values, 2)).max() <= 5e-10  # smooth: truncation, not noise


def test_unloading_leads_back() -> None:
    problem = hertz(60, 1e-3)
    steps = walked(problem, problem.guess, 0.0, 1.0)
    back = follow(problem, steps[-1].x, 1.0, 0.0)
    lams = [step.lam for step in back.steps()]
    assert back.reached
    assert np.all(np.diff(lams) < 0.0)
    start = steps[0].branch.x[0]
    assert np.abs((back.x - start) / problem.scale).max() <= 1e-7


@pytest.mark.parametrize("eta", [1e-1, 1e-6])
@pytest.mark.parametrize("tolerance", [1e-4, 1e-8, 1e-12])
@pytest.mark.parametrize("order", [5, 20, 40])
def test_every_accepted_step_keeps_the_tolerance(order: int, tolerance: float, eta: float) -> None:
    problem = hertz(20, eta)
    options = AnmOptions(order=order, tolerance=tolerance)
    follower = follow(problem, problem.guess, 0.0, 1.0, options)
    for step in islice(follower.steps(), 150):
        assert step.residual <= tolerance
        assert np.abs(problem.residual(step.x, step.lam)).max() == step.residual
    short = order == 5 and tolerance < 1e-4  # a low order may take thousands of steps
    assert follower.reached or short
