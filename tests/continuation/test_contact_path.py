"""Quadratic contact problems: the method's main use, against exact contact and the line-contact formula."""

from __future__ import annotations

from itertools import islice

import numpy as np
import pytest

from mlsanm_cli.continuation import AnmOptions, Follower, Step, follow

from .problems import Contact, hertz


def pressed(problem: Contact, options: AnmOptions | None = None) -> tuple[list[Step], Follower]:
    follower = follow(problem, problem.guess, 0.0, 1.0, options)
    steps = list(follower.steps())
    assert follower.reached, follower.message
    return steps, follower


def residuals_inside(problem: Contact, steps: list[Step], count: int) -> np.ndarray:
    """Return the largest residuals at random parameters of random steps; gaps must be open there."""
    rng = np.random.default_rng(11)
    values = []
    for _ in range(count):
        branch = steps[rng.integers(len(steps))].branch
        x, lam = branch.evaluate(rng.uniform(0.0, branch.length))
        assert problem.admissible(x, lam)
        values.append(float(np.abs(problem.residual(x, lam)).max()))
    return np.array(values)


@pytest.mark.parametrize("pade", [True, False])
@pytest.mark.parametrize("eta", [1e-2, 1e-4])
def test_residual_holds_everywhere_between_the_ends_of_steps(pade: bool, eta: float) -> None:
    problem = hertz(60, eta)
    steps, _ = pressed(problem, AnmOptions(pade=pade))
    assert any(step.branch.denominator is not None for step in steps) is pade
    values = residuals_inside(problem, steps, 200)
    assert values.max() <= 1e-8


def test_pieces_end_before_round_off_spoils_them() -> None:
    # The first pieces have their poles close together ahead, as along a branch cut.
    problem = hertz(120, 1e-4)
    steps, _ = pressed(problem)
    for step in steps[:3]:
        branch = step.branch
        near = np.linspace(0.99, 1.0, 50) * branch.length
        values = np.array([np.abs(problem.residual(*branch.evaluate(a))).max() for a in near])
        assert values.max() <= 1e-8
        assert np.abs(np.diff(values, 2)).max() <= 5e-10  # smooth: truncation, not noise


def test_unloading_leads_back() -> None:
    problem = hertz(60, 1e-3)
    steps, end = pressed(problem)
    back = follow(problem, end.x, 1.0, 0.0)
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
