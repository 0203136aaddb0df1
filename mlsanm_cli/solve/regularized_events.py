"""Events on the path of regularised contact with friction, where the sets cease to hold, and the sets that
follow."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass

import numpy as np

from mlsanm_cli.arrays import BoolArray, FloatArray
from mlsanm_cli.contact.laws.complementary_path import admissible_sets
from mlsanm_cli.contact.laws.contact_status import ContactSolution, ContactStatus, SetSystem
from mlsanm_cli.contact.laws.regularized_friction import RegularizedFriction
from mlsanm_cli.contact.laws.set_search import AdmissibleChanges, exchange
from mlsanm_cli.contact.response.dense import SingularSystemError
from mlsanm_cli.continuation import Branch
from mlsanm_cli.continuation.roots import root
from mlsanm_cli.roundoff import COARSE_ROUND_OFF, ROUND_OFF

EVENT_SAMPLES = 17
"""Points of a piece of path at which events are searched."""


@dataclass(frozen=True, eq=False)
class EventFlags:
    """Friction nodes (n,) of an event: zero pressure, friction limit reached on one side (1 or -1, else 0),
    and zero slip rate."""

    bare: BoolArray
    limit: FloatArray
    rested: BoolArray

    @classmethod
    def none(cls, count: int) -> EventFlags:
        """No event."""
        return cls(np.zeros(count, dtype=bool), np.zeros(count), np.zeros(count, dtype=bool))


class EventLocator:
    """Finds the first event on a piece of path. Afterwards ``reached`` tells whether there was one, ``hits``
    its nodes."""

    def __init__(self, problem: RegularizedFriction) -> None:
        self._problem = problem
        self._stuck, self._sliding = (
            np.flatnonzero(problem.sets.stuck),
            np.flatnonzero(problem.sets.slip_sign),
        )
        self.hits = EventFlags.none(problem.n)
        self.reached = False

    def __call__(self, piece: Branch) -> float:
        """Path parameter of the first event, or inf."""
        self.reached = False
        values, rates = self._conditions(piece)
        count, grid = values.shape[1], np.linspace(0.0, piece.length, EVENT_SAMPLES)

        def levels(a: FloatArray) -> FloatArray:
            return np.hstack([piece.weights(a) @ values, piece.derivative_weights(a) @ rates])

        found = levels(grid)
        scale = self._scales(found[:, count:], values[0])
        most = np.where(np.arange(len(scale)) < count, 1.0, scale)
        slack = np.where(found[0] <= ROUND_OFF * scale, np.maximum(-found[0], 0.0) + ROUND_OFF * most, 0.0)
        past = (found[1:] + slack < 0.0).any(axis=1)
        if not past.any():
            return np.inf
        row = int(np.argmax(past)) + 1
        low, high = float(grid[row - 1]), float(grid[row])

        def first(column: int) -> float:
            def level(a: float) -> float:
                return float(levels(np.array([a]))[0, column] + slack[column])

            return low if level(low) <= 0.0 else root(level, low, high)

        a, column = min((first(k), k) for k in np.flatnonzero(found[row] + slack < 0.0).tolist())
        self.hits, self.reached = self._flags(column, count), a < piece.length
        return a

    def _conditions(self, piece: Branch) -> tuple[FloatArray, FloatArray]:
        """Coefficients of what must stay positive, and of what must grow: pressures (n, turned for open
        nodes), friction left on both sides of sticking nodes, slips of slipping ones against friction."""
        problem, c = self._problem, self._problem.condensed
        terms, load = piece.terms
        p, _, q, t = problem.split(terms)
        pressure = p[:, c.friction_nodes] / problem.law.pressure
        pressure[0] -= problem.law.threshold / problem.law.pressure
        sign = np.where(problem.sets.closed[c.friction_nodes], 1.0, -1.0)
        held = self._stuck
        limit, friction = c.friction[held] * pressure[:, held], t[:, held] / problem.law.pressure
        base, rows = problem.coupling, problem.m + self._sliding
        slip = np.hstack([p, t, q]) @ base.slips[self._sliding].T
        slip += np.outer(load, base.load[rows] @ problem.change)
        rates = -slip * problem.sets.slip_sign[self._sliding]
        return np.hstack([pressure * sign, limit - friction, limit + friction]), rates

    def _scales(self, rates: FloatArray, first: FloatArray) -> FloatArray:
        """What the conditions are small against: pressures of the scene, every node's own limit, rates."""
        n, held = self._problem.n, len(self._stuck)
        limit = np.maximum(0.5 * (first[n : n + held] + first[n + held :]), COARSE_ROUND_OFF)
        largest = np.full(rates.shape[1], np.abs(rates).max(initial=0.0) + np.finfo(float).tiny)
        return np.concatenate([np.ones(n), limit, limit, largest])

    def _flags(self, column: int, levels: int) -> EventFlags:
        hits, n, held = EventFlags.none(self._problem.n), self._problem.n, len(self._stuck)
        if column < n:
            hits.bare[column] = True
        elif column < levels:
            first = column < n + held
            hits.limit[self._stuck[column - n if first else column - n - held]] = 1.0 if first else -1.0
        else:
            hits.rested[self._sliding[column - levels]] = True
        return hits


def _expected(problem: RegularizedFriction, x: FloatArray, lam: float, hits: EventFlags) -> ContactStatus:
    """The sets that an event most likely leads to: closing nodes slip on as they did when they were open."""
    before, nodes = problem.sets, problem.condensed.friction_nodes
    closed = before.closed.copy()
    opens, closes = hits.bare & closed[nodes], hits.bare & ~closed[nodes]
    closed[nodes[hits.bare]] = closes[hits.bare]
    stuck = (before.stuck | hits.rested) & ~opens & (hits.limit == 0.0)
    slip_sign = np.where(hits.rested | opens, 0.0, np.where(hits.limit != 0.0, hits.limit, before.slip_sign))
    if closes.any():
        slip_sign = np.where(closes, -np.sign(problem.slip_rate(x, lam)), slip_sign)
    return ContactStatus(closed, stuck | (closes & (slip_sign == 0.0)), slip_sign)


def continued(
    problem: RegularizedFriction, x: FloatArray, lam: float, hits: EventFlags
) -> tuple[RegularizedFriction, FloatArray]:
    """The problem with the sets that hold beyond (x, lam), and the state with exact values of the event.
    NoStateError if there are none."""
    c, before = problem.condensed, problem.sets
    x = x.copy()
    p, _, _, t = problem.split(x)
    pressure, force = problem.pressed(p), ROUND_OFF * problem.law.pressure
    t[hits.limit != 0.0] = (hits.limit * c.friction * pressure)[hits.limit != 0.0]
    bare = hits.bare | (np.abs(pressure) <= force)
    slack = {side: c.friction * pressure - side * t <= force for side in (1.0, -1.0)}
    side = np.where(slack[1.0], 1.0, -1.0)
    side = np.where(hits.limit != 0.0, hits.limit, np.where(before.slip_sign != 0.0, before.slip_sign, side))
    side[bare] = 0.0
    anywhere = np.zeros(problem.m, dtype=bool)
    anywhere[c.friction_nodes] = bare
    at_limit = (
        slack[1.0] | slack[-1.0] | (hits.limit != 0.0) | (before.slip_sign != 0.0) | bare
    ) & ~hits.rested
    watch = AdmissibleChanges(anywhere, anywhere, at_limit, side)
    now = problem.stick_coordinate(x, lam)

    def over(sets: ContactStatus) -> RegularizedFriction:
        stick_reference = np.where(sets.stuck & ~before.stuck, now, problem.stick_reference)
        return problem.changed(sets=sets, stick_reference=stick_reference)

    expected = _expected(problem, x, lam, hits)
    system = over(expected)
    with suppress(SingularSystemError):
        rates = system.slope(x, lam)
        if not exchange(c, expected, watch, rates, rates.slip)[1].any():
            return system, system.on_limits(x)
    softened, known = problem.softened(x), None

    def solve(sets: ContactStatus) -> tuple[SetSystem, ContactSolution, FloatArray]:
        nonlocal known
        known, rates = problem.rates(softened, sets, known)
        return known, rates, rates.slip

    system = over(admissible_sets(c, expected, watch, solve, softened)[0])
    return system, system.on_limits(x)
