"""Unilateral contact with Coulomb friction of a condensed scene: states, increments, and the exact path with
its history. Equation (14) of docs/method.md."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.contact.complementarity import history
from mlsanm_cli.contact.complementarity.basis import Ray
from mlsanm_cli.contact.complementarity.problem import GRAZING, ContactStatus, Problem
from mlsanm_cli.contact.complementarity.solution import solve, touching
from mlsanm_cli.contact.laws.contact_state import ContactSolution, kkt_residual
from mlsanm_cli.contact.laws.failures import NoStateError, SlidingError
from mlsanm_cli.contact.laws.sliding import slides_freely
from mlsanm_cli.contact.response.condensed import Condensed
from mlsanm_cli.errors import NumericalError
from mlsanm_cli.records import dataclass
from mlsanm_cli.roundoff import ROUND_OFF

NEGLIGIBLE = 1e-3
"""Part of typical pressures below which those of overlaps as drawn, as of curves through points, may depend
on how the bodies move apart."""
MIN_SPEED = 0.01
"""Motions slower than this part of the fastest do not count as driven."""
OVERLAP = (
    "surfaces with friction overlap as drawn, and forces alone do not determine how the bodies move apart"
)
OVERLAP_HINT = (
    "move one body so that the surfaces at most touch, or prescribe its platen's displacement; for a press "
    "fit give contact.NAME.interference"
)


@dataclass(frozen=True, eq=False)
class CoulombState:
    """One state of the history: load ``factors`` (L,), ``values``, ``sets``, the slips (n,) at which nodes
    stick, and the energy ``work`` (n,) dissipated by friction so far, per length of surface. It is at the
    ``fraction`` of a stage, came after so many ``solves``, and may have ``jumped`` from another state."""

    factors: FloatArray
    values: ContactSolution
    sets: ContactStatus
    stick_reference: FloatArray
    work: FloatArray
    fraction: float = 0.0
    solves: int = 0
    jumped: bool = False


def unloaded(condensed: Condensed, factors: FloatArray) -> CoulombState:
    """The state before the first load, without pressure and slip; initial overlaps are resolved by the first
    increment."""
    state = history.unloaded(condensed.problem, condensed.free_rows(factors))
    return _unscaled(condensed, state, factors)


def acts(condensed: Condensed, change: FloatArray) -> bool:
    """Whether a change of the load factors (L,) affects contacts or motions."""
    return bool(condensed.free_rows(change, rates=True).any())


def increment(
    condensed: Condensed,
    state: CoulombState,
    factors: FloatArray,
    slipping: bool = True,
    guess: ContactStatus | None = None,
) -> CoulombState | None:
    """The state after a finite increment to ``factors`` (L,), with slips opposed from those of the ``state``;
    None if there is none. The search starts from a ``guess``, if given, and from the ``state``. Without
    ``slipping`` all closed nodes stick."""
    p, before = condensed.problem, _scaled(condensed, state)
    closed = state.sets.closed | (state.values.gap <= ROUND_OFF * condensed.weight)
    starts = [_without_undecided(p, replace(state.sets, closed=closed))]
    if guess is not None:
        starts.insert(0, _without_undecided(p, guess))
    free, none = condensed.free_rows(factors), np.zeros(p.n, dtype=bool)
    try:
        if slipping:
            found = history.increments(p, before, free, *starts)
        else:
            allowed = replace(p.everything, forward=none, backward=none)
            found = history.increment(p, before, free, 0.0, *starts, allowed=allowed)
    except Ray:
        return None
    return _unscaled(condensed, found, factors)


def _without_undecided(problem: Problem, status: ContactStatus) -> ContactStatus:
    """A status whose closed nodes with friction stick if they do not slip."""
    p, on, sign = problem, status.closed[problem.nodes], status.slip_sign
    rests = on & (status.stuck | (sign == 0.0))
    return ContactStatus(
        status.closed, rests & p.rubs, np.where(rests & ~p.rubs, 1.0, np.where(on, sign, 0.0))
    )


def residual(
    condensed: Condensed, state: CoulombState, stress: float = 0.0, forces: FloatArray | float = 0.0
) -> float:
    """Largest violation of contact conditions, friction and balances, see :func:`kkt_residual`."""
    v, sets = state.values, state.sets
    unknowns, held = (state.factors, v.motion, v.pressure, v.traction), state.stick_reference
    return kkt_residual(condensed, unknowns, sets.closed, np.where(sets.stuck, held, np.nan), stress, forces)


def start(condensed: Condensed, factors: FloatArray, typical: float = 0.0) -> CoulombState:
    """The state before the first stage; initial overlaps push the surfaces apart. Raises NumericalError if
    the result is not unique, unless its pressures are negligible against ``typical`` ones."""
    state = unloaded(condensed, factors)
    if not condensed.overlap(state.values.gap):
        return state
    floats = len(condensed.balance.constant) > 0
    parted = _parted(condensed, state) if floats else None
    if parted is not None:
        return parted
    # Wedged bodies move straight out without slip as far as possible: friction would admit many positions.
    tries = ((False, np.inf), (True, NEGLIGIBLE * typical)) if floats else ((True, np.inf),)
    for slipping, most in tries:
        found = increment(condensed, state, factors, slipping)
        if found is None or found.values.pressure.max() > most:
            continue
        if not floats or residual(condensed, found) <= GRAZING:
            return found
    raise NumericalError(OVERLAP, OVERLAP_HINT) if floats else NoStateError


def _parted(condensed: Condensed, state: CoulombState) -> CoulombState | None:
    """The pressure-free state in which free bodies have moved by the least distance that resolves their
    overlaps; None if there is none. The least distance is a frictionless contact problem of bodies held by
    unit springs."""
    p, k, m = condensed.problem, condensed.problem.k, condensed.problem.m
    stiff = np.abs(p.matrix[p.contacts :, p.contacts :]).max(axis=0, initial=0.0) > GRAZING
    moved = np.where(stiff, 0.0, p.matrix[:m, p.contacts :])
    gap = (state.values.gap - ROUND_OFF * condensed.weight) * p.rows[:m]
    springs = Problem.of(
        np.block([[np.zeros((m, m)), moved], [-moved.T, np.eye(k)]]), p.nodes[:0], p.friction[:0], m
    )
    free = springs.rows * np.append(gap, np.zeros(k))
    try:
        found = solve(springs, free, touching(springs, gap < 0.0))
    except Ray:
        return None
    motion = p.columns[p.contacts :] * springs.columns[m:] * found.x[m:]
    v = state.values
    opened = condensed.gap.motion @ motion
    values = replace(v, motion=motion, gap=v.gap + opened, slip=condensed.slip.motion @ motion)
    moved_state = replace(state, values=values, stick_reference=values.slip)
    return moved_state if residual(condensed, moved_state) <= GRAZING else None


def event_driven_path(
    condensed: Condensed,
    state: CoulombState,
    end: FloatArray,
    stops: Sequence[float],
    begin: FloatArray | None = None,
    fraction: float = 0.0,
    typical: float | None = None,
) -> Iterator[CoulombState]:
    """All events of a stage from ``state`` to load factors ``end`` (L,), and the states at ``stops``.

    ``stops`` are increasing fractions up to 1, the last one 1. A resumed path gives the load factors
    ``begin`` (L,) at the start of the stage and the ``fraction`` already passed; ``typical`` pressures
    tell which gaps as drawn are round-off. Raises SlidingError if the
    contact slides as a whole under a force, NoStateError if no state continues the path.
    """
    begin = state.factors if begin is None else begin
    change = end - begin
    if not acts(condensed, change):
        for stop in stops:
            yield replace(state, factors=begin + stop * change, fraction=stop, solves=0, jumped=False)
        return
    constant, load = condensed.free_rows(begin), condensed.free_rows(change, rates=True)
    now, settled = _scaled(condensed, state, fraction), bool(state.sets.closed.any())
    path = history.follow(condensed.problem, now, constant, load, stops, typical)
    try:
        for found in path:
            if found.rates is not None and _slides(condensed, now, found, begin, change):
                raise SlidingError(now.lam)
            jumped, settled = found.jumped and settled, settled or not found.jumped
            yield replace(_unscaled(condensed, found, begin + found.lam * change), jumped=jumped)
            now = found
    except Ray as ray:
        raise SlidingError(now.lam) if _moves_along(condensed.problem, now, ray) else NoStateError from ray


def _moves_along(problem: Problem, state: history.State, ray: Ray) -> bool:
    """Whether a mechanism moves the closed nodes of a state more along their surfaces than off them."""
    p, rates = problem, problem.product(ray.direction) / problem.rows
    on = state.status.closed
    off, along = np.abs(rates[: p.m][on]), np.abs(rates[p.m : p.contacts][on[p.nodes]])
    return bool(along.max(initial=0.0) > off.max(initial=0.0))


def _slides(
    condensed: Condensed,
    before: history.State,
    after: history.State,
    begin: FloatArray,
    change: FloatArray,
) -> bool:
    """Whether the rates from one state to the next are those of a contact that slides as a whole and is
    driven by loads, not of bodies that others graze."""
    assert after.rates is not None
    p, status = condensed.problem, after.status
    rates = ContactSolution.unscaled(p, after.rates.x, after.rates.w)
    pressed = after.x[: p.m] > GRAZING * p.size(after.x)
    loaded = replace(status, slip_sign=np.where(pressed[p.nodes], status.slip_sign, 0.0))
    if not slides_freely(condensed, loaded, rates):
        return False
    moved = np.abs(after.rates.x[p.contacts :])
    size = np.abs(begin + before.lam * change) + np.abs(change)
    load = np.abs(condensed.balance.load) @ size
    return bool(load[moved > MIN_SPEED * moved.max()].any())


def _unscaled(condensed: Condensed, state: history.State, factors: FloatArray) -> CoulombState:
    p = condensed.problem
    slips = p.rows[p.m : p.contacts]
    values, reference, work = ContactSolution.unscaled(p, state.x, state.w), state.reference, state.work
    counts = state.lam, state.systems, state.jumped
    return CoulombState(factors, values, state.status, reference / slips, work / slips, *counts)


def _scaled(condensed: Condensed, state: CoulombState, lam: float = 0.0) -> history.State:
    p, v = condensed.problem, state.values
    x = np.concatenate([v.pressure, v.traction, v.motion]) / p.columns
    w = p.rows * np.concatenate([v.gap, v.slip, np.zeros(p.k)])
    slips = p.rows[p.m : p.contacts]
    return history.State(state.sets, x, w, slips * state.stick_reference, slips * state.work, lam)
