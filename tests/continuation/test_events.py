"""Paths that end where their problem stops to hold."""

from __future__ import annotations

import numpy as np
import pytest

from mlsanm_cli.continuation import AnmOptions, Branch, FloatArray, StopReason, follow

from .problems import Scalar


def wall(level: float) -> tuple[list[Branch], object]:
    """An event where the unknown reaches ``level``, and the pieces it was asked about."""
    seen: list[Branch] = []

    def locate_event(piece: Branch) -> float:
        seen.append(piece)
        grid = np.linspace(0.0, piece.length, 200)
        past = np.flatnonzero((piece.weights(grid) @ piece.terms[0])[:, 0] >= level)
        return float(grid[past[0]]) if past.size else np.inf

    return seen, locate_event


@pytest.mark.parametrize("order", [8, 20])
@pytest.mark.parametrize("level", [0.01, 0.4])
def test_path_ends_at_the_barrier(order: int, level: float) -> None:
    problem = Scalar(0.0, 1.0, 1.0)
    seen, locate_event = wall(level)
    follower = follow(problem, np.zeros(1), 0.0, 1.0, AnmOptions(order=order), locate_event=locate_event)  # type: ignore[arg-type]
    steps = list(follower.steps())
    assert follower.outcome.reason is StopReason.EVENT
    assert not follower.outcome.reached
    assert seen
    assert level <= steps[-1].x[0] <= level + 0.02
    assert steps[-1].lam == pytest.approx(steps[-1].x[0] + steps[-1].x[0] ** 2, abs=1e-10)
    assert steps[-1].residual <= AnmOptions().goal


def test_a_path_goes_on_upwards_when_told_so() -> None:
    # Behind a piece along which the load factor fell, the direction asked for decides.
    problem = Scalar(0.0, 1.0, 1.0)
    back = follow(problem, np.array([0.5]), 0.75, 0.5)
    (piece, *_) = [step.branch for step in back.steps()]
    on = follow(problem, np.array([0.5]), 0.75, 1.0, AnmOptions(direction=1), previous=piece)
    assert [step.lam for step in on.steps()][-1] == 1.0
    astray = follow(problem, np.array([0.5]), 0.75, 1.0, AnmOptions(max_steps=1), previous=piece)
    assert [step.lam for step in astray.steps()][-1] < 0.75


@pytest.mark.parametrize("denominator", [None, np.array([1.0, 0.4, -0.1])])
def test_derivative_weights_are_derivatives(denominator: FloatArray | None) -> None:
    rng = np.random.default_rng(0)
    branch = Branch(rng.normal(size=(6, 3)), rng.normal(size=6), 0.8, denominator)
    a: FloatArray = np.array([0.0, 0.3, 0.8])
    step = 1e-6
    x, lam = branch.terms
    for values, place in ((x, 0), (lam[:, None], 1)):
        ahead, behind = (branch.weights(a + s) @ values for s in (step, -step))
        found = branch.derivative_weights(a) @ values
        assert found == pytest.approx((ahead - behind) / (2.0 * step), rel=1e-7, abs=1e-8), place
