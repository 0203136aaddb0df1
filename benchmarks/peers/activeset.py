"""Signorini and Coulomb contact at the multipliers of a mortar coupling, by a primal-dual active set.

Unknown are the nodal pressures p, tractions t, and the motion d = (dx, dy) of a rigid platen that carries
prescribed forces. A ``solve`` callable hides whether a step factorises a sparse saddle point problem or uses
a dense compliance; the states decide which equations it gets.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scenes import Array

Bools = NDArray[np.bool_]

MAX_TRIALS = 300
PATIENCE = 25
CHATTER = 1e-7  # of the largest: with less tension, overlap, excess or slip a node stays as it is


@dataclass(frozen=True)
class State:
    """Per multiplier: ``closed``, ``sliding`` (0 sticks, else the sign of the traction), ``slip`` (m,)."""

    closed: Bools
    sliding: NDArray[np.int8]
    slip: Array
    pressure: Array
    traction: Array


@dataclass(frozen=True)
class Answer:
    """One linear step: ``pressure``, ``traction``, weak ``gap`` and ``slip`` (m,) each."""

    pressure: Array
    traction: Array
    gap: Array
    slip: Array


Solve = Callable[[State, tuple[float, float]], Answer]


def start(closed: Bools) -> State:
    """Nothing has slipped yet; all that is closed sticks."""
    zeros = np.zeros(len(closed))
    return State(closed, np.zeros(len(closed), np.int8), zeros, zeros, zeros)


def equilibrium(solve: Solve, state: State, forces: tuple[float, float], friction: float) -> State:
    """State under resultants (x, y) of the contact after ``state``; backward Euler for the slip."""
    step = state
    for trial in range(MAX_TRIALS):
        answer = solve(step, forces)
        tension, overlap = CHATTER * answer.pressure.max(), CHATTER * np.abs(answer.gap).max()
        closed = np.where(step.closed, answer.pressure > -tension, answer.gap < -overlap)
        sliding = step.sliding
        if friction:
            sliding = friction_states(step, answer, state.slip, friction)
            # What closes slides as it moves: stuck it could be torn open again, without end.
            sliding = np.where(closed & ~step.closed, -np.sign(answer.slip - state.slip), sliding)
            sliding = np.where(closed, sliding, 0).astype(np.int8)
        if np.array_equal(closed, step.closed) and np.array_equal(sliding, step.sliding):
            return replace(step, slip=answer.slip, pressure=answer.pressure, traction=answer.traction)
        if trial > PATIENCE:  # the set cycles: only the first change of all is made (Murty's least index)
            first = np.flatnonzero((closed != step.closed) | (sliding != step.sliding))[0]
            keep = np.arange(len(closed)) != first
            closed = np.where(keep, step.closed, closed)
            sliding = np.where(keep, step.sliding, sliding).astype(np.int8)
        step = replace(step, closed=closed, sliding=sliding)
    raise RuntimeError(f"the active set has not settled at platen forces {forces}")


def friction_states(step: State, answer: Answer, before: Array, friction: float) -> Array:
    """Sticking multipliers beyond the cone slide, sliding ones that went with their traction stick."""
    residual_vector = np.abs(answer.traction) - friction * np.maximum(answer.pressure, 0.0)
    breaks = (step.sliding == 0) & (residual_vector > CHATTER * friction * answer.pressure.max())
    turned = (answer.slip - before) * step.sliding > CHATTER * np.abs(answer.slip).max()
    return np.where(breaks, np.sign(answer.traction), np.where(turned, 0, step.sliding))
