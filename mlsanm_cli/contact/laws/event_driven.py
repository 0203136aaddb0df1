"""Exact path of a frictional contact, from event to event.

Between changes of status the state is linear in the load, and the path is followed exactly: the rates
determine how the sets continue, and the next event is where a gap or pressure vanishes or a sticking node
reaches its friction limit. Slipping nodes whose rate would reverse come to rest. There are no increments to
choose.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np

from mlsanm_cli.arrays import BoolArray, FloatArray
from mlsanm_cli.contact.laws.complementary_path import admissible_sets
from mlsanm_cli.contact.laws.contact_status import ContactSolution, ContactStatus, SetSystem
from mlsanm_cli.contact.laws.coulomb import CoulombState, acts, increment, residual, unloaded
from mlsanm_cli.contact.laws.limit_load import SlidingError, slides_freely
from mlsanm_cli.contact.laws.set_search import AdmissibleChanges, NoStateError
from mlsanm_cli.contact.response.condensed import Condensed
from mlsanm_cli.errors import NumericalError
from mlsanm_cli.roundoff import ROUND_OFF

LIMIT_TOLERANCE = 1e-9
"""Tolerance for a condition at its limit, relative to peak pressure and elastic gap."""
LAST_DIGITS = 50.0 * float(np.finfo(float).eps)
INCREMENTS = tuple(10.0**power for power in range(-6, 0))
"""Finite increments, as fractions of the stage, tried in turn where no rates continue the path."""
SETTLING = 1e-3
"""Part of a stage within which a scene begun without contact settles: which of the surfaces drawn touching
come to carry first depends on the grid, and a path that ends there is begun with a larger increment."""
FEW_PIVOTS = 300
"""Limit of single exchanges of an increment within which a scene settles, before any number is tried."""
STANDSTILL, MIN_SPEED = 1e-13, 0.01
NEGLIGIBLE = 1e-3
"""Part of typical pressures below which those of overlaps as drawn, as of curves through points, may depend
on how the bodies move apart."""
OVERLAP = (
    "surfaces with friction overlap as drawn, and forces alone do not determine how the bodies move apart"
)
OVERLAP_HINT = (
    "move one body so that the surfaces at most touch, or prescribe its platen's displacement; for a press "
    "fit give contact.NAME.interference"
)


@dataclass(frozen=True, eq=False)
class Event:
    """The state at ``fraction`` of a stage, the number of dense ``solves`` to get there, and whether it
    ``jumped`` from another contact state."""

    fraction: float
    state: CoulombState
    solves: int
    jumped: bool = False


@dataclass(frozen=True, eq=False)
class _Course:
    """Continuation of a state along a stage: sets, their system, and rates."""

    sets: ContactStatus
    system: SetSystem
    rates: ContactSolution


def start(condensed: Condensed, factors: FloatArray, typical: float = 0.0) -> Event:
    """The state before the first stage; initial overlaps push the surfaces apart. Raises NumericalError if
    the result is not unique, unless its pressures are negligible against ``typical`` ones."""
    state = unloaded(condensed, factors)
    if not condensed.overlap(state.values.gap):
        return Event(0.0, state, 0)
    if not len(condensed.balance.constant):
        return Event(0.0, *increment(condensed, state, factors))
    parted = _parted(condensed, state)
    if parted is not None:
        return Event(0.0, parted, 0)
    # Wedged bodies move straight out without slip as far as possible: friction would admit many positions.
    for slipping, most in ((False, np.inf), (True, NEGLIGIBLE * typical)):
        with suppress(NoStateError):
            found, solves = increment(condensed, state, factors, slipping)
            if residual(condensed, found) <= LIMIT_TOLERANCE and found.values.pressure.max() <= most:
                return Event(0.0, found, solves)
    raise NumericalError(OVERLAP, OVERLAP_HINT)


def _parted(condensed: Condensed, state: CoulombState) -> CoulombState | None:
    """The pressure-free state in which free bodies have moved by the least distance that resolves their
    overlaps; None if there is none. By non-negative least squares (Lawson and Hanson 1974,
    doi:10.1137/1.9781611971217, chapter 23)."""
    from scipy.optimize import nnls  # for few runs

    gap, balance = condensed.gap, condensed.balance
    size = np.abs(np.vstack([gap.motion, condensed.slip.motion])).max(axis=0)
    forces = np.abs(balance.pressure).max(axis=1)[:, None]
    stiff = (np.abs(balance.motion) / np.where(forces > 0.0, forces, 1.0)).max(axis=0)
    free = (size > 0.0) & (stiff * condensed.largest_compliance <= LIMIT_TOLERANCE * size)
    widest = float(np.abs(state.values.gap).max())
    rows = gap.motion[:, free] / size[free]
    depth = (ROUND_OFF * condensed.weight - state.values.gap) / widest
    target = np.append(np.zeros(rows.shape[1]), 1.0)
    multipliers, missed = nnls(np.vstack([rows.T, depth]), target)
    rest = np.vstack([rows.T, depth]) @ multipliers - target
    if missed <= LIMIT_TOLERANCE:
        return None
    motion = np.zeros(len(size))
    motion[free] = -rest[:-1] / rest[-1] * widest / size[free]
    v = state.values
    values = replace(v, motion=motion, gap=v.gap + gap.motion @ motion, slip=condensed.slip.motion @ motion)
    moved = replace(state, values=values, stick_reference=values.slip)
    return moved if residual(condensed, moved) <= LIMIT_TOLERANCE else None


def event_driven_path(
    condensed: Condensed,
    state: CoulombState,
    end: FloatArray,
    stops: Sequence[float],
    begin: FloatArray | None = None,
    fraction: float = 0.0,
) -> Iterator[Event]:
    """All events of a stage from ``state`` to load factors ``end`` (L,), and the states at ``stops``.

    ``stops`` are increasing fractions up to 1, the last one 1. A resumed path gives the load factors
    ``begin`` (L,) at the start of the stage and the ``fraction`` already passed. Raises SlidingError if the
    contact slides as a whole under a force, NumericalError if no state continues the path.
    """
    begin = state.factors if begin is None else begin
    change = end - begin
    if not acts(condensed, change):
        yield from (Event(stop, replace(state, factors=begin + stop * change), 0) for stop in stops)
        return
    pending, standing = list(stops), 0
    course: _Course | None = None
    origin, since = state, fraction
    while pending:
        if origin.sets.closed.any() or fraction > since + SETTLING:
            origin, since = state, fraction
        limits = _limits(condensed, state.values)
        try:
            course, solves = _course(condensed, state, limits, change, course)
            if standing > 4 * len(condensed.weight) + 50:
                raise NoStateError(sliding=False)
            if slides_freely(condensed, course.sets, course.rates):
                if origin is state and _loaded(condensed, state.factors, change, course.rates):
                    raise SlidingError(fraction)
                raise NoStateError(sliding=True)
        except NoStateError as error:
            try:
                state, fraction, solves = _jump(
                    condensed, origin, begin, change, since, fraction - since, pending[0]
                )
            except NoStateError as failure:
                if error.sliding or failure.sliding or slides_freely(condensed, state.sets):
                    raise SlidingError(fraction) from error
                raise
            standing, course = 0, None
            while pending and pending[0] <= fraction:
                pending.pop(0)
            yield Event(fraction, state, solves, jumped=bool(origin.sets.closed.any()))
            continue
        sets = course.sets
        # A node that comes to rest sticks where it is now.
        stick_reference = np.where(sets.stuck & ~state.sets.stuck, state.values.slip, state.stick_reference)
        step = min(_next_event(condensed, state, limits, course), pending[0] - fraction)
        standing = standing + 1 if step < STANDSTILL else 0
        fraction += step
        if pending[0] - fraction <= STANDSTILL:
            fraction = pending.pop(0)
        state = _moved(condensed, state, begin + fraction * change, course, step, stick_reference)
        yield Event(fraction, state, solves)


def _moved(
    condensed: Condensed,
    state: CoulombState,
    factors: FloatArray,
    course: _Course,
    step: float,
    stick_reference: FloatArray,
) -> CoulombState:
    """The state at load ``factors`` (L,), a ``step`` further along the course.

    Extrapolated, so that the quantity of the event vanishes to the accuracy of its location: on grids graded
    towards corners pressures themselves are accurate to 1e-7 only. If the accumulated residual is too large,
    the state is solved for.
    """
    sets = course.sets
    values = state.values.advanced(step, course.rates).obeying(condensed, sets, stick_reference)
    straight = state.moved(factors, values, sets, stick_reference, course.system)
    if residual(condensed, straight) <= LIMIT_TOLERANCE:
        return straight
    solved = course.system.state(factors, stick_reference, state.values.motion)
    anew = state.moved(factors, solved, sets, stick_reference, course.system)
    return min(straight, anew, key=lambda one: residual(condensed, one))


def _limits(condensed: Condensed, values: ContactSolution) -> tuple[float, FloatArray]:
    """Pressure and gaps (m,) that count as zero: gaps that such a pressure opens at a node by itself, or
    round-off."""
    force = LIMIT_TOLERANCE * float(values.pressure.max(initial=0.0))
    elastic = condensed.elastic_gap(values.pressure)
    own = force * condensed.own[0]
    length = np.minimum(np.maximum(own, LAST_DIGITS * elastic), LIMIT_TOLERANCE * elastic)
    if not force:
        length += LAST_DIGITS * float(np.abs(condensed.gap.motion @ values.motion).max(initial=0.0))
    return force, length


def _slack(condensed: Condensed, values: ContactSolution, side: float) -> FloatArray:
    """Remaining friction (n,) towards one side."""
    result: FloatArray = (
        condensed.friction * values.pressure[condensed.friction_nodes] - side * values.traction
    )
    return result


def _course(
    condensed: Condensed,
    state: CoulombState,
    limits: tuple[float, FloatArray],
    change: FloatArray,
    last: _Course | None,
) -> tuple[_Course, int]:
    """Continuation of the state for a ``change`` (L,) of the load factors, and the number of systems built;
    ``limits`` belong to the state. The sets of the ``last`` course, which led to the state along the same
    change, are tried first."""
    v, before, (force, length) = state.values, state.sets, limits
    bare = v.pressure <= force
    near = {side: _slack(condensed, v, side) <= force for side in (1.0, -1.0)}
    grazing = bare[condensed.friction_nodes]
    # A node under pressure can only slip towards the side on which friction is exhausted.
    side = np.where(grazing, 0.0, np.where(near[1.0], 1.0, -1.0))
    watch = AdmissibleChanges(
        bare,
        v.gap <= length,
        grazing | near[1.0] | near[-1.0] | (before.slip_sign != 0.0),
        side,
        condensed.balance.load @ change,
    )
    watch.side[before.slip_sign != 0.0] = np.where(grazing, 0.0, before.slip_sign)[before.slip_sign != 0.0]

    made, known = 0, state.system

    def solve(sets: ContactStatus) -> tuple[SetSystem, ContactSolution, FloatArray]:
        nonlocal made, known
        if last is not None and sets.key == last.sets.key:
            return last.system, last.rates, last.rates.slip
        made += 1
        known = SetSystem(condensed, sets, known, watch.force)
        rates = known.rate(change)
        return known, rates, rates.slip

    sets, system, rates, _ = admissible_sets(condensed, before, watch, solve)
    return _Course(sets, system, rates), made


def _next_event(
    condensed: Condensed, state: CoulombState, limits: tuple[float, FloatArray], course: _Course
) -> float:
    """Distance to the next change of the sets, as a fraction of the stage."""
    sets, rates, v, (force, length) = course.sets, course.rates, state.values, limits
    sides = (1.0, -1.0)
    return min(
        _until(v.gap, rates.gap, length, ~sets.closed),
        _until(v.pressure, rates.pressure, force, sets.closed),
        *(_until(_slack(condensed, v, d), _slack(condensed, rates, d), force, sets.stuck) for d in sides),
    )


def _until(value: FloatArray, rate: FloatArray, limit: float | FloatArray, chosen: BoolArray) -> float:
    """Distance until the first of the ``chosen`` values vanishes; those at their limit are already
    handled."""
    falling = chosen & (value > limit) & (rate < 0.0)
    return float((value[falling] / -rate[falling]).min(initial=np.inf))


def _loaded(condensed: Condensed, factors: FloatArray, change: FloatArray, rates: ContactSolution) -> bool:
    """Whether any load acts on the fastest motions, which otherwise are those of bodies that others graze."""
    moved = np.abs(rates.motion) / condensed.scaled[1][len(condensed.whole) - len(rates.motion) :]
    load = np.abs(condensed.balance.load) @ (np.abs(factors) + np.abs(change))
    return bool(load[moved > MIN_SPEED * moved.max()].any())


def _jump(
    condensed: Condensed,
    state: CoulombState,
    begin: FloatArray,
    change: FloatArray,
    fraction: float,
    beyond: float,
    ceiling: float,
) -> tuple[CoulombState, float, int]:
    """The first state found by a finite increment of more than ``beyond`` ahead, its fraction, and the number
    of solves. Raises NoStateError."""
    failure: NoStateError = NoStateError(sliding=False)
    few = [] if state.sets.closed.any() else [(size, FEW_PIVOTS) for size in INCREMENTS if size <= SETTLING]
    for size, pivots in [*few, *((size, None) for size in INCREMENTS)]:
        if size <= beyond:
            continue
        ahead = min(fraction + size, ceiling)
        try:
            found, solves = increment(condensed, state, begin + ahead * change, pivots=pivots)
        except NoStateError as error:
            failure = error
            continue
        return found, ahead, solves
    raise failure
