"""Unilateral contact with Coulomb friction: which nodes are open, stick or slip, and the state that follows.

With given sets everything is linear: open nodes carry nothing; closed ones keep h = 0; sticking ones keep
the slip they came to rest at, s = anchor; slipping ones carry t = d mu p with the sense d = +-1. What the
sets are is found by exchanging the nodes that break their own rule (Hüeber, Stadler and Wohlmuth 2008,
doi:10.1137/060671061), many at once at first, one by one should a set come back.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from mlsanm_cli.arrays import BoolArray, FloatArray, IntArray
from mlsanm_cli.contact.condensed import Condensed
from mlsanm_cli.contact.dense import DenseSystem, SingularSystemError
from mlsanm_cli.errors import NumericalError

OPEN, STICK, SLIP = 0, 1, 2
ROUND_OFF = 1e-10


@dataclass(frozen=True, eq=False)
class Sets:
    """``closed`` (m,), and of the nodes with friction ``stuck`` (n,) and the ``sense`` (n,) in which friction
    acts on those that are closed and slip; 0 on the others."""

    closed: BoolArray
    stuck: BoolArray
    sense: FloatArray

    @property
    def key(self) -> bytes:
        """Equal for equal sets."""
        return self.closed.tobytes() + self.stuck.tobytes() + self.sense.tobytes()

    def status(self, rubbing: IntArray) -> NDArray[np.int8]:
        """What every node (m,) does; closed nodes without friction slip."""
        status = np.where(self.closed, SLIP, OPEN).astype(np.int8)
        status[rubbing[self.stuck]] = STICK
        return status


@dataclass(frozen=True, eq=False)
class Values:
    """Pressures (m,), tractions (n,), motions (k,), gaps (m,) and slips (n,), or rates of them."""

    pressure: FloatArray
    traction: FloatArray
    motion: FloatArray
    gap: FloatArray
    slip: FloatArray


@dataclass(frozen=True, eq=False)
class Watch:
    """Which rules count: closed nodes that may open (m,), open ones that may close (m,), sticking ones that
    may slip (n,) and to which ``side`` (n,): 1, -1, or 0 for both."""

    opening: BoolArray
    closing: BoolArray
    slipping: BoolArray
    side: FloatArray


class NoStateError(NumericalError):
    """No sets of open, sticking and slipping nodes obey all rules; ``sliding`` where nothing sticks."""

    def __init__(self, sliding: bool) -> None:
        super().__init__(
            "no contact state balances the loads",
            "a force-controlled platen may push its body away from the contact, or nothing resists its "
            "direction; prescribe that direction's displacement instead",
        )
        self.sliding = sliding


class SetSystem:
    """The linear equations of one choice of sets, factorised. Raises SingularSystemError."""

    def __init__(self, condensed: Condensed, sets: Sets) -> None:
        self._condensed, self._sets = condensed, sets
        gap, slip, balance = condensed.gap, condensed.slip, condensed.balance
        closed, stuck = np.flatnonzero(sets.closed), np.flatnonzero(sets.stuck)
        sliding = np.flatnonzero(sets.sense)
        self._closed, self._stuck, self._sliding = closed, stuck, sliding
        place = np.cumsum(sets.closed) - 1
        under = place[condensed.rubbing[sliding]]
        drag = sets.sense[sliding] * condensed.friction[sliding]

        def row(map_pressure: FloatArray, map_traction: FloatArray, map_motion: FloatArray) -> FloatArray:
            on_closed = map_pressure[:, closed]
            # A slipping node's traction goes with its pressure.
            on_closed[:, under] += map_traction[:, sliding] * drag
            return np.hstack([on_closed, map_traction[:, stuck], map_motion])

        matrix = np.vstack(
            [
                row(gap.pressure[closed], gap.traction[closed], gap.motion[closed]),
                row(slip.pressure[stuck], slip.traction[stuck], slip.motion[stuck]),
                row(balance.pressure, balance.traction, balance.motion),
            ]
        )
        self._drag, self._under = drag, under
        self._system = DenseSystem(matrix, len(closed) + len(stuck))

    def state(self, factors: FloatArray, anchor: FloatArray) -> Values:
        """The state at load ``factors`` (L,) with sticking nodes held at their ``anchor`` (n,)."""
        c = self._condensed
        free_gap = c.gap.constant + c.gap.load @ factors
        free_slip = c.slip.constant + c.slip.load @ factors
        lack = c.balance.constant + c.balance.load @ factors
        return self._solve(free_gap, free_slip, lack, anchor)

    def rate(self, change: FloatArray) -> Values:
        """The rates when the load factors move by ``change`` (L,)."""
        c = self._condensed
        still = np.zeros(len(c.slip.constant))
        return self._solve(c.gap.load @ change, c.slip.load @ change, c.balance.load @ change, still)

    def _solve(
        self, free_gap: FloatArray, free_slip: FloatArray, lack: FloatArray, anchor: FloatArray
    ) -> Values:
        c, closed, stuck = self._condensed, self._closed, self._stuck
        rhs = np.concatenate([-free_gap[closed], anchor[stuck] - free_slip[stuck], -lack])
        solution = self._system.solve(rhs)
        a, b = len(closed), len(closed) + len(stuck)
        pressure, traction = np.zeros(len(free_gap)), np.zeros(len(free_slip))
        pressure[closed], traction[stuck], motion = solution[:a], solution[a:b], solution[b:]
        traction[self._sliding] = self._drag * solution[self._under]
        gap = free_gap + c.gap.motion @ motion + c.gap.pressure @ pressure + c.gap.traction @ traction
        slip = free_slip + c.slip.motion @ motion + c.slip.pressure @ pressure + c.slip.traction @ traction
        gap[closed], slip[stuck] = 0.0, anchor[stuck]
        return Values(pressure, traction, motion, gap, slip)


System = TypeVar("System")


def find_sets(
    condensed: Condensed,
    first: Sets,
    watch: Watch,
    solve: Callable[[Sets], tuple[System, Values, FloatArray]],
) -> tuple[Sets, System, Values, int]:
    """Sets that obey every watched rule, their system and values, and how many systems it took.

    ``solve`` gives the system of some sets, the values that the rules are about, and the slips (n,) whose
    signs must be against friction; SingularSystemError where there are none. Raises NoStateError.
    """
    sets, seen, one_by_one = first, set(), False
    limit = 60 + 6 * len(first.closed)
    for count in range(1, limit + 1):
        try:
            system, values, slipped = solve(sets)
        except SingularSystemError:
            if one_by_one:
                raise NoStateError(sliding=bool(sets.closed.any() and not sets.stuck.any())) from None
            # Too many exchanges at once have freed what friction holds.
            sets, one_by_one = first, True
            continue
        better, wrong = _exchange(condensed, sets, watch, values, slipped)
        if not wrong.any():
            return sets, system, values, count
        one_by_one |= sets.key in seen
        seen.add(sets.key)
        sets = _only(condensed, sets, better, int(np.flatnonzero(wrong)[0])) if one_by_one else better
    raise NoStateError(sliding=False)


def _exchange(
    condensed: Condensed, sets: Sets, watch: Watch, values: Values, slipped: FloatArray
) -> tuple[Sets, BoolArray]:
    """The sets with every node that breaks its rule exchanged, and which nodes (m,) these are.

    A node that closes, or slips with friction, is judged by the pressure and traction that its own compliance
    asks for to undo its overlap and its slip.
    """
    rub = condensed.rubbing
    own_normal, own_tangential = np.diagonal(condensed.gap.pressure), np.diagonal(condensed.slip.traction)
    p, t = values.pressure, values.traction
    force = ROUND_OFF * max(float(np.abs(p).max(initial=0.0)), float(np.abs(t).max(initial=0.0)))
    opening = sets.closed & watch.opening & (p < -force)
    closing = ~sets.closed & watch.closing & (values.gap < -ROUND_OFF * np.abs(values.gap).max(initial=0.0))
    closed = (sets.closed & ~opening) | closing
    asked = np.where(sets.stuck, t, t - slipped / own_tangential)
    limit = condensed.friction * np.where(closing, p - values.gap / own_normal, p)[rub]
    side = np.where(watch.side == 0.0, np.sign(asked), watch.side)
    over = side * asked - limit
    still = closed[rub] & sets.closed[rub]
    slips = still & sets.stuck & watch.slipping & (over > force)
    with_friction = sets.sense * slipped > ROUND_OFF * np.abs(slipped).max(initial=0.0)
    turns = still & with_friction & ((over <= 0.0) | (side == sets.sense))
    reverses = still & with_friction & ~turns
    holds = closing[rub] & (over <= 0.0)
    rubs = closing[rub] & ~holds
    stuck = (sets.stuck & still & ~slips) | turns | holds
    sense = np.where(slips | reverses | rubs, side, np.where(turns | ~closed[rub] | holds, 0.0, sets.sense))
    wrong = opening | closing
    wrong[rub] |= slips | turns | reverses
    return Sets(closed, stuck, sense), wrong


def _only(condensed: Condensed, sets: Sets, better: Sets, node: int) -> Sets:
    """The exchange of one node alone."""
    closed, stuck, sense = sets.closed.copy(), sets.stuck.copy(), sets.sense.copy()
    closed[node] = better.closed[node]
    own = condensed.rubbing == node
    stuck[own], sense[own] = better.stuck[own], better.sense[own]
    return Sets(closed, stuck, sense)


@dataclass(frozen=True, eq=False)
class CoulombState:
    """One state of the history: load ``factors`` (L,), ``values``, ``sets``, the slips (n,) at which sticking
    nodes rest, and the work (n,) that friction has dissipated per length of surface so far."""

    factors: FloatArray
    values: Values
    sets: Sets
    anchor: FloatArray
    work: FloatArray

    def moved(self, factors: FloatArray, values: Values, sets: Sets, anchor: FloatArray) -> CoulombState:
        """The next state; between the two, tractions and slips go straight."""
        mean = 0.5 * (self.values.traction + values.traction)
        work = self.work - np.where(sets.sense != 0.0, mean * (values.slip - self.values.slip), 0.0)
        return CoulombState(factors, values, sets, anchor, work)

    @property
    def slides(self) -> bool:
        """Whether some nodes are closed and all that have friction slip."""
        return bool((self.sets.sense != 0.0).any() and not self.sets.stuck.any())


def unloaded(condensed: Condensed, factors: FloatArray) -> CoulombState:
    """Before the first load: nothing touches, no slip; surfaces that overlap as drawn are seen by the first
    increment."""
    m, n = len(condensed.weight), len(condensed.rubbing)
    values = Values(
        np.zeros(m),
        np.zeros(n),
        np.zeros(len(condensed.balance.constant)),
        condensed.gap.constant + condensed.gap.load @ factors,
        np.zeros(n),
    )
    sets = Sets(np.zeros(m, dtype=bool), np.zeros(n, dtype=bool), np.zeros(n))
    return CoulombState(factors, values, sets, np.zeros(n), np.zeros(n))


def increment(condensed: Condensed, state: CoulombState, factors: FloatArray) -> tuple[CoulombState, int]:
    """The state after one finite increment to ``factors`` (L,), friction by return mapping; and the systems
    solved. Raises NoStateError."""
    before = state.values.slip
    closed = state.sets.closed | (state.values.gap <= 0.0)
    if len(condensed.balance.constant) and not closed.any():
        closed = _closest(condensed, state.values.gap)
    stuck = closed[condensed.rubbing] & (state.sets.sense == 0.0)
    sense = np.where(closed[condensed.rubbing], state.sets.sense, 0.0)
    both = np.ones(len(condensed.weight), dtype=bool)
    watch = Watch(both, both, both[condensed.rubbing], np.zeros(len(before)))

    def solve(sets: Sets) -> tuple[SetSystem, Values, FloatArray]:
        system = SetSystem(condensed, sets)
        values = system.state(factors, before)
        return system, values, values.slip - before

    sets, _, values, count = find_sets(condensed, Sets(closed, stuck, sense), watch, solve)
    return state.moved(factors, values, sets, np.where(sets.stuck, before, values.slip)), count


def _closest(condensed: Condensed, gap: FloatArray) -> BoolArray:
    closed = np.zeros(len(gap), dtype=bool)
    for span in condensed.spans.values():
        closed[span] |= gap[span] <= gap[span].min(initial=np.inf)
    return closed


def residual(condensed: Condensed, state: CoulombState) -> float:
    """Largest violation of contact conditions, friction and balances.

    Relative to the peak pressure, the elastic gap and the forces.
    """
    v, sets = state.values, state.sets
    arguments = (state.factors, v.motion, v.pressure, v.traction)
    typical = float(np.abs(v.pressure).max(initial=0.0)) or 1.0
    elastic = float(np.abs(condensed.gap.pressure @ v.pressure).max(initial=0.0)) or 1.0
    gap, slip, lack = condensed.gap(*arguments), condensed.slip(*arguments), condensed.balance(*arguments)
    balance = condensed.balance
    force = np.abs(balance.load @ state.factors) + np.abs(balance.pressure) @ np.abs(v.pressure)
    limit = condensed.friction * v.pressure[condensed.rubbing]
    force += np.abs(balance.traction) @ limit
    cone = np.abs(v.traction) - limit
    parts = (
        np.abs(gap[sets.closed]).max(initial=0.0) / elastic,
        max(0.0, -gap[~sets.closed].min(initial=0.0)) / elastic,
        max(0.0, -v.pressure.min(initial=0.0)) / typical,
        np.abs(slip[sets.stuck] - state.anchor[sets.stuck]).max(initial=0.0) / elastic,
        max(0.0, cone.max(initial=0.0)) / typical,
        (np.abs(lack) / np.maximum(force, np.finfo(float).tiny)).max(initial=0.0),
    )
    return float(max(parts))
