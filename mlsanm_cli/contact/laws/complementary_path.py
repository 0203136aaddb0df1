"""Complementary pivoting: admissible sets along a path of one artificial load (Lemke 1965,
doi:10.1287/mnsc.11.7.681).

For arbitrary sets a state is constructed that satisfies their conditions but not the equations; the residual
is taken as a load and removed gradually. The state changes linearly between events, at each of which one node
changes status; the load may have to increase temporarily. Sets do not recur, however they depend on each
other through friction.

An open node closes as one that slips against its motion; a sticking one first slips, then opens.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.contact.laws.contact_status import ContactSolution, ContactStatus, SetSystem
from mlsanm_cli.contact.laws.failures import EndlessError, NoStateError
from mlsanm_cli.contact.laws.limit_load import slides_freely
from mlsanm_cli.contact.laws.set_search import AdmissibleChanges, exchange, moving
from mlsanm_cli.contact.response.condensed import Condensed
from mlsanm_cli.contact.response.dense import SingularSystemError

ROUND_OFF = 1e-10
GOLDEN = 0.5 * (np.sqrt(5.0) - 1.0)
MAX_EXCHANGES, MAX_STARTS = 30, 6
"""Exchanges of all violating nodes before single ones; and number of sets from which single exchanges
start."""
MAX_PIVOTS, PIVOTS_PER_NODE = 500, 2
"""Limit of single exchanges over all starts: MAX_PIVOTS plus PIVOTS_PER_NODE per node. Successful paths took
one per node, with few nodes up to four; without a solution paths may go on for minutes."""
OPENS, CLOSES, SLIPS, BACKWARD, RESTS = range(5)
"""Kinds of events: a node opens, closes, slips with friction 1 or -1, or comes to rest."""


class NoPathError(ArithmeticError):
    """The path does not end; its last ``sets`` and the number of systems."""

    def __init__(self, sets: ContactStatus, count: int) -> None:
        super().__init__()
        self.sets, self.count = sets, count


def admissible_sets(
    condensed: Condensed,
    first: ContactStatus,
    watch: AdmissibleChanges,
    solve: Callable[[ContactStatus], tuple[SetSystem, ContactSolution, FloatArray]],
    softened: Condensed | None = None,
    pivots: int | None = None,
) -> tuple[ContactStatus, SetSystem, ContactSolution, int]:
    """Sets that satisfy all watched conditions, their system and values, and the number of systems solved.

    ``solve`` returns the system of given sets, the values that the conditions refer to, and the slips (n,)
    that friction must oppose, or raises SingularSystemError. All violating nodes are exchanged at once as
    long as that leads to new sets; complementary paths start from the best of these. For regularised laws,
    with gaps everywhere, ``softened`` is the compliance, and open nodes are those without friction and with
    falling pressure, given as a gap. Raises NoStateError, also after so many ``pivots``, if given.
    """
    sets, last, seen, count = first, first, set[bytes](), 0
    starts = list[tuple[int, ContactStatus, ContactSolution, FloatArray]]()
    while sets.key not in seen and count < MAX_EXCHANGES:
        seen.add(sets.key)
        count += 1
        try:
            system, values, slipped = solve(sets)
        except SingularSystemError:
            # A contact that slides as a whole may come to rest.
            last, sets = sets, sets.resting(condensed.friction_nodes)
            continue
        better, wrong = exchange(condensed, sets, watch, values, slipped)
        if not wrong.any():
            return sets, system, values, count
        starts.append((int(wrong.sum()), sets, values, slipped))
        sets = better
    # Starts that stick give way node by node, where those that slide as a whole fail.
    fewest = sorted(starts, key=lambda one: one[0])[:MAX_STARTS]
    tried = [*fewest[:1], *(one for one in starts[:1] if one is not fewest[0]), *fewest[1:]]
    left = pivots or MAX_PIVOTS + PIVOTS_PER_NODE * len(first.closed)
    for _, sets, values, slipped in tried:
        try:
            sets, made = complementary_path(condensed, sets, watch, values, slipped, left, softened)
        except NoPathError as error:
            last, count, left = error.sets, count + error.count, left - error.count
            if left <= 0:
                break
            continue
        except SingularSystemError:
            continue
        last, count = sets, count + made
        try:
            system, values, slipped = solve(sets)
        except SingularSystemError:  # sets that slide as a whole, to within round-off
            continue
        if not exchange(condensed, sets, watch, values, slipped)[1].any():
            return sets, system, values, count
        raise EndlessError
    raise NoStateError(sliding=slides_freely(condensed, last))


@dataclass(frozen=True, eq=False)
class _Event:
    """The status change of a ``node``."""

    kind: int
    node: int


@dataclass(frozen=True, eq=False)
class _Rules:
    """Distances to the limits of conditions, per kind of event and node (5, m), infinite for none."""

    condensed: Condensed
    watch: AdmissibleChanges
    reference: FloatArray
    smooth: bool

    def equations(self, sets: ContactStatus) -> ContactStatus:
        """The sets for the equations; regularised laws have equations of gaps at all nodes."""
        return replace(sets, closed=np.ones_like(sets.closed)) if self.smooth else sets

    def left(self, sets: ContactStatus, v: ContactSolution) -> FloatArray:
        """Distances in a state, or for a zero reference their rates."""
        c, w = self.condensed, self.watch
        nodes, m = c.friction_nodes, len(sets.closed)
        found = np.full((5, m), np.inf)
        slips_first = np.zeros(m, dtype=bool)
        slips_first[nodes] = sets.stuck & w.slipping
        opens, closes = sets.closed & w.opening & ~slips_first, ~sets.closed & w.closing
        found[OPENS, opens] = v.pressure[opens]
        found[CLOSES, closes] = -v.pressure[closes] if self.smooth else v.gap[closes]
        for event, side in ((SLIPS, 1.0), (BACKWARD, -1.0)):
            may = sets.stuck & w.slipping & (w.side != -side)
            found[event, nodes[may]] = (c.friction * v.pressure[nodes] - side * v.traction)[may]
        slides = sets.slip_sign != 0.0
        found[RESTS, nodes[slides]] = (-sets.slip_sign * (v.slip - self.reference))[slides]
        return found

    def obeying(self, sets: ContactStatus, v: ContactSolution) -> ContactSolution:
        """A state near ``v`` that satisfies the conditions of the sets."""
        c, w = self.condensed, self.watch
        nodes, m = c.friction_nodes, len(sets.closed)
        # Irregular factors, so that symmetric nodes do not change simultaneously.
        uneven = 1.0 + 0.5 * np.mod(GOLDEN * np.arange(m), 1.0)
        pressure = np.where(sets.closed & w.opening & (v.pressure < 0.0), -uneven * v.pressure, v.pressure)
        opened = ~sets.closed & w.closing
        gap = np.where(opened & (v.gap < 0.0), -uneven * v.gap, v.gap)
        if self.smooth:
            pressure = np.where(opened & (pressure > 0.0), -uneven * pressure, pressure)
        limit, traction = c.friction * pressure[nodes], v.traction
        for side in (1.0, -1.0):
            over = side * traction - limit
            may = sets.stuck & w.slipping & (w.side != -side) & (over > 0.0)
            above = np.where(may, limit + over, 1.0)
            within = np.where(w.side == 0.0, limit * limit / above, limit - over)
            traction = np.where(may, side * within, traction)
        traction = np.where(sets.slip_sign != 0.0, sets.slip_sign * limit, traction)
        slipped = v.slip - self.reference
        against = sets.slip_sign * slipped > 0.0
        slip = np.where(against, self.reference - uneven[nodes] * slipped, v.slip)
        return replace(v, pressure=pressure, traction=traction, gap=gap, slip=slip)

    def next_event(
        self, sets: ContactStatus, v: ContactSolution, rates: ContactSolution
    ) -> tuple[float, _Event | None]:
        """Distance along ``rates`` to the next limit of a condition, and the event there."""
        left = self.left(sets, v)
        falls = -replace(self, reference=np.zeros_like(self.reference)).left(sets, rates)
        force = max(np.abs(rates.pressure).max(initial=0.0), np.abs(rates.traction).max(initial=0.0))
        force = max(force, moving(self.condensed, rates.motion))
        length = max(np.abs(rates.gap).max(initial=0.0), np.abs(rates.slip).max(initial=0.0))
        least = ROUND_OFF * np.array([force, force if self.smooth else length, force, force, length])
        falling = np.isfinite(left) & (falls > least[:, None])
        steps = np.full(left.shape, np.inf)
        steps[falling] = np.maximum(left[falling], 0.0) / falls[falling]
        kind, node = np.unravel_index(int(np.argmin(steps)), steps.shape)
        step = float(steps[kind, node])
        return step, _Event(int(kind), int(node)) if np.isfinite(step) else None

    def after(self, sets: ContactStatus, at: _Event, v: ContactSolution) -> ContactStatus:
        """The sets after an event."""
        event, node = at.kind, at.node
        closed, stuck, slip_sign = sets.closed.copy(), sets.stuck.copy(), sets.slip_sign.copy()
        closed[node] = event != OPENS
        own = np.flatnonzero(self.condensed.friction_nodes == node)
        stuck[own], slip_sign[own] = event == RESTS, 0.0
        if event in (SLIPS, BACKWARD):
            slip_sign[own] = 1.0 if event == SLIPS else -1.0
        if event == CLOSES:
            slides = self.watch.slipping[own]
            sign = np.where(v.slip[own] > self.reference[own], -1.0, 1.0)
            stuck[own], slip_sign[own] = ~slides, np.where(slides, sign, 0.0)
        return ContactStatus(closed, stuck, slip_sign)


def complementary_path(
    condensed: Condensed,
    sets: ContactStatus,
    watch: AdmissibleChanges,
    values: ContactSolution,
    slipped: FloatArray,
    most: int,
    softened: Condensed | None = None,
) -> tuple[ContactStatus, int]:
    """Sets that satisfy the watched conditions, starting from ``sets`` with their ``values``, and the number
    of systems solved. Raises NoPathError, also after ``most`` systems, and SingularSystemError."""
    rules = _Rules(condensed, watch, values.slip - slipped, softened is not None)
    if softened is not None:
        values = replace(
            values, pressure=values.pressure - values.gap / condensed.own[0], gap=np.zeros_like(values.gap)
        )
    solved = softened or condensed
    v, system = rules.obeying(sets, values), SetSystem(solved, rules.equations(sets), force=watch.force)
    # Residual of the equations in the state constructed near the solution.
    m, n = len(v.pressure), len(v.traction)
    moved = [v.pressure - values.pressure, v.traction - values.traction, np.zeros(len(v.motion))]
    gap, slip, imbalance = np.split(solved.blocks @ np.concatenate(moved), [m, m + n])
    rest = v.gap - values.gap - gap, v.slip - values.slip - slip, -imbalance

    def passed(event: _Event, step: float, rates: ContactSolution) -> tuple[ContactSolution, ContactStatus]:
        """State and sets after an event."""
        there = v.advanced(step, rates)
        after = rules.after(sets, event, there)
        return there.obeying(condensed, rules.equations(after), rules.reference), after

    load, way, response = 1.0, -1.0, system.response(*rest)
    for count in range(1, most + 1):
        rates = response.times(way)
        step, event = rules.next_event(sets, v, rates)
        if way < 0.0 and step >= load:
            return sets, count
        if event is None:
            raise NoPathError(sets, count)
        load, before = load + way * step, sets
        v, sets = passed(event, step, rates)
        try:
            system = SetSystem(solved, rules.equations(sets), system, watch.force)
        except SingularSystemError:
            # At constant load the new variable of the node increases.
            rates = _by_itself(solved, system, before, sets, event, rules.smooth)
            step, event = rules.next_event(sets, v, rates)
            if event is None:
                raise NoPathError(sets, count) from None
            before = sets
            v, sets = passed(event, step, rates)
            try:
                system = SetSystem(solved, rules.equations(sets), system, watch.force)
            except SingularSystemError:
                raise NoPathError(sets, count) from None
        response = system.response(*rest)
        way = 1.0 if _departure_rate(condensed, response, event, before, sets, rules.smooth) > 0.0 else -1.0
    raise NoPathError(sets, most)


def _by_itself(
    condensed: Condensed,
    system: SetSystem,
    before: ContactStatus,
    sets: ContactStatus,
    event: _Event,
    smooth: bool,
) -> ContactSolution:
    """Rates of a state driven only by the new variable of a node after its event."""
    node, m, n = event.node, len(sets.closed), len(sets.stuck)
    own = np.flatnonzero(condensed.friction_nodes == node)
    gap, slip, pressure, traction = np.zeros(m), np.zeros(n), np.zeros(m), np.zeros(n)
    if smooth and event.kind in (OPENS, CLOSES):
        traction[own] = (before if event.kind == OPENS else sets).slip_sign[own]
    elif event.kind == OPENS:
        gap[node] = 1.0
    elif event.kind == CLOSES:
        pressure[node], traction[own] = 1.0, sets.slip_sign[own] * condensed.friction[own]
    elif event.kind == RESTS:
        traction[own] = -before.slip_sign[own]
    else:
        slip[own] = -sets.slip_sign[own]
    caused = condensed.blocks @ np.concatenate([pressure, traction, np.zeros(len(condensed.whole) - m - n)])
    found = system.response(caused[:m] - gap, caused[m : m + n] - slip, caused[m + n :])
    return replace(
        found,
        pressure=found.pressure + pressure,
        traction=found.traction + traction,
        gap=found.gap + gap,
        slip=found.slip + slip,
    )


def _departure_rate(
    condensed: Condensed,
    rates: ContactSolution,
    event: _Event,
    before: ContactStatus,
    sets: ContactStatus,
    smooth: bool,
) -> float:
    """Rate, with the load, at which the node leaves the limit of its condition: gap if it opens, pressure if
    it closes, slip if it slips, remaining friction if it comes to rest."""
    if event.kind == OPENS:
        return float(-rates.pressure[event.node] if smooth else rates.gap[event.node])
    if event.kind == CLOSES:
        return float(rates.pressure[event.node])
    own = int(np.flatnonzero(condensed.friction_nodes == event.node)[0])
    if event.kind == RESTS:
        sign, limit = before.slip_sign[own], condensed.friction[own] * rates.pressure[event.node]
        return float(limit - sign * rates.traction[own])
    return float(-sets.slip_sign[own] * rates.slip[own])
