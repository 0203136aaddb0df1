"""Exact contact states at the ends of the stages, which scale, refine and judge a path before it begins."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import suppress

import numpy as np

from mlsanm_cli.arrays import BoolArray, FloatArray, IntArray
from mlsanm_cli.case import Case
from mlsanm_cli.contact.laws.active_set import FEW_PASSES, ExactState, solve_exact
from mlsanm_cli.contact.laws.contact_status import ContactStatus
from mlsanm_cli.contact.laws.coulomb import CoulombState, increment, residual, unloaded
from mlsanm_cli.contact.laws.set_search import EndlessError, NoStateError, UnbalancedError
from mlsanm_cli.contact.response.condensed import Condensed
from mlsanm_cli.errors import NumericalError
from mlsanm_cli.mechanics.scene import Scene
from mlsanm_cli.solve.contact_grids import Wanted
from mlsanm_cli.solve.limit_loads import beyond_limit, near_limit
from mlsanm_cli.solve.load_factors import factors_at
from mlsanm_cli.solve.rolling import RollingError, turned_by_loads

MOST_LEVELS = 40
"""Of more levels with fields some decide how fine contact grids have to be."""
FEW_LEVELS = 8
"""Of more stages some decide how fine grids are at first; those that are fine enough for these are looked at
in all of them."""


STRAIGHT = 1e-9
"""Loads go on in the same direction where the cosine of the angle between two stages is less below 1."""
ASTRAY = 0.25
"""Angle (radian) by which normals turn over slips that no contact at small strain can follow."""
FIRST_PARTS = (0.5, 0.1, 0.01)
"""Parts of the first stage that give a contact with friction its scales if its end cannot be reached."""


def searched_ends(
    case: Case,
    scene: Scene,
    stages: FloatArray,
    condensed: Condensed,
    starts: Sequence[ContactStatus],
    which: Wanted,
    known: Sequence[ExactState] = (),
) -> tuple[ExactState, ...]:
    """Exact states at the ends of the stages, with friction only of the ``starts``, without it of some, if no
    more are to be ``known``, or every state that counts with those where fields are wanted;
    or some between the ends, but for friction, whose path would have to be followed. Without friction those
    ``known`` at the same load factors are taken as they are. Where a stage cannot be carried to its end the
    last state is one near its limit load."""
    factors, every = stages, which not in ("ends", "known")
    rubbing = len(condensed.friction_nodes) > 0
    if which == "between":
        if rubbing:
            return ()
        most = max(2, min(BETWEEN, MOST_LEVELS // (len(stages) - 1)))
        parts = np.maximum(1, -(-most // _in_line(stages)))
        inner = (k + j / count for k, count in enumerate(parts.tolist()) for j in range(1, count))
        factors = np.stack([factors_at(stages, position) for position in (0.0, *inner)])
    elif every:
        every_so_many = -(-len(case.output.at) // MOST_LEVELS) or 1
        positions = sorted({*range(len(stages)), *case.output.at[::every_so_many]})
        factors = np.stack([factors_at(stages, position) for position in positions])
    elif which == "known" and not rubbing and len(stages) - 1 > FEW_LEVELS:
        chosen = np.unique(np.linspace(0, len(stages) - 1, FEW_LEVELS + 1).round().astype(int))
        factors = stages[chosen]
        starts = [starts[k - 1] for k in chosen[1:]] if len(starts) == len(stages) - 1 else starts
    if rubbing:
        # Where friction let go at a stage's end, it takes all guesses to find that out anew.
        followed = factors[: len(starts) + 1] if which == "known" else factors
        try:
            held = _friction_ends(scene, condensed, followed, starts)
            check_slips(condensed, held)
            return held
        except EndlessError:
            raise
        except NoStateError as error:
            raise beyond_limit(scene, condensed, stages[:2], error) from error
    if len(starts) not in (1, len(factors) - 1):
        starts = ()  # of other states
    ends: list[ExactState] = []
    lost: NumericalError | None = None
    for number, wanted in enumerate(factors[1:]):
        found = next((one for one in known if np.array_equal(one.factors, wanted)), None)
        if found is not None:
            ends.append(found)
            continue
        start = next(iter(starts[number:]), None)
        last = ends[-1].active if ends else None
        first = last if start is None else start.closed
        try:
            ends.append(_solved_exactly(scene, condensed, wanted, first))
        except UnbalancedError as error:
            lost = lost or error
            if not every:
                near = near_limit(condensed, stages)
                if near is None:
                    break
                return (*ends, _solved_exactly(scene, condensed, near[0], last))
        except NumericalError as error:
            # A body that floats on its way has no exact state there.
            lost = lost or error
            if not every:
                break
    if lost is None or (every and ends):
        return tuple(ends)
    raise beyond_limit(scene, condensed, stages, lost) if isinstance(lost, UnbalancedError) else lost


def _in_line(stages: FloatArray) -> IntArray:
    """Of how many stages (s,) in a row the loads go on in the same direction, at each of the ``stages``
    (s + 1, L)."""
    way = np.diff(stages, axis=0)
    size = np.sqrt((way**2).sum(axis=1))
    turns = (way[1:] * way[:-1]).sum(axis=1) < (1.0 - STRAIGHT) * size[1:] * size[:-1]
    row = np.concatenate([[0], np.cumsum(turns)])
    return np.asarray(np.bincount(row)[row])


def check_slips(condensed: Condensed, ends: Sequence[ExactState]) -> None:
    """UnbalancedError where forces drive round bodies along each other until their normals have turned: where
    they come to rest is unknown to contacts whose pairs are those drawn."""
    if not len(condensed.balance.constant):
        return
    for name, tangential in condensed.tangential.items():
        grid, span = condensed.pairing_of(name).grid, condensed.spans[name]
        if grid is None or grid.facing.other is None:
            continue
        curvature = [float(one.curvature(np.array([0.5 * one.length]))[0]) for one in grid.facing.curves]
        if min(curvature) <= 0.0:
            continue
        for end in ends:
            slip = condensed.slip(end.factors, end.motion, end.pressure, end.traction)[tangential]
            largest = float(np.abs(slip[end.pressure[span] > 0.0]).max(initial=0.0))
            # As that of the line between the centers of two disks.
            turn = largest / sum(1.0 / one for one in curvature)
            if turn > ASTRAY:
                raise UnbalancedError(
                    f"contact {name}: friction does not hold the bodies in their drawn position: they slide "
                    f"by {largest:.3g} before the loads are balanced, and normals rotate by "
                    f"{np.degrees(turn):.3g} degrees meanwhile",
                    "raise friction, reduce tangential loads, or fix the bodies by supports",
                )


def _solved_exactly(
    scene: Scene, condensed: Condensed, factors: FloatArray, first: BoolArray | None
) -> ExactState:
    """The exact state, searched from a ``first`` set, or where that lets go of a body from the closest.
    UnbalancedError where loads roll bodies away in it."""
    try:
        found = solve_exact(condensed, factors, first)
    except NumericalError:
        found = solve_exact(condensed, factors)
    none = np.zeros(0)
    sets = ContactStatus(found.active, none.astype(bool), none)
    turned = turned_by_loads(scene, condensed, (found.motion, found.pressure, none), sets)
    if turned and turned.error:
        raise UnbalancedError(turned.error.message, turned.error.hint)
    return found


def exact_ends(scene: Scene, condensed: Condensed, stages: FloatArray) -> tuple[ExactState, ...]:
    if len(condensed.friction_nodes):
        return _friction_ends(scene, condensed, stages)
    ends: list[ExactState] = []
    for factors in stages[1:]:
        ends.append(solve_exact(condensed, factors, ends[-1].active if ends else None))
    return tuple(ends)


def _friction_ends(
    scene: Scene, condensed: Condensed, stages: FloatArray, starts: Sequence[ContactStatus] = ()
) -> tuple[ExactState, ...]:
    """One increment per stage as far as the loads can be carried; of the first at least a part that rolls
    nothing away."""
    ends: list[ExactState] = []
    state = unloaded(condensed, stages[0])
    for number, factors in enumerate(stages[1:]):
        try:
            found, solves = _incremented(condensed, state, factors, next(iter(starts[number:]), None))
        except NoStateError:
            break
        if not ends and _rolling(scene, condensed, found):
            break
        state = found
        ends.append(_end(condensed, state, solves))
    return tuple(ends) if ends else (_first_end(scene, condensed, state, stages[1]),)


def _rolling(scene: Scene, condensed: Condensed, state: CoulombState) -> RollingError | None:
    """The error that loads roll bodies away, None where they do not."""
    v = state.values
    turned = turned_by_loads(scene, condensed, (v.motion, v.pressure, v.traction), state.sets)
    return turned.error if turned else None


def _incremented(
    condensed: Condensed, state: CoulombState, factors: FloatArray, guess: ContactStatus | None
) -> tuple[CoulombState, int]:
    if guess is not None:
        with suppress(NoStateError):
            return increment(condensed, state, factors, guess=guess)
    try:
        return increment(condensed, state, factors)
    except NoStateError as lost:
        # What touches without friction is near to what does with it, if loads balance without it.
        try:
            free = solve_exact(condensed, factors, passes=FEW_PASSES)
        except NumericalError:
            raise lost from None
        closed, none = free.active, np.zeros(len(condensed.friction_nodes))
        slip = condensed.slip(factors, free.motion, free.pressure, none) - state.values.slip
        for stuck in (closed[condensed.friction_nodes], np.zeros(len(none), dtype=bool)):
            slip_sign = np.where(closed[condensed.friction_nodes] & ~stuck, -np.sign(slip), 0.0)
            with suppress(NoStateError):
                return increment(condensed, state, factors, guess=ContactStatus(closed, stuck, slip_sign))
        raise lost from None


def _first_end(scene: Scene, condensed: Condensed, state: CoulombState, end: FloatArray) -> ExactState:
    """The state after a part of a stage whose end cannot be reached."""
    failure: NoStateError
    for part in FIRST_PARTS:
        try:
            found, solves = increment(condensed, state, state.factors + part * (end - state.factors))
        except NoStateError as error:
            failure = error
            continue
        rolling = _rolling(scene, condensed, found)
        if rolling is None:
            return _end(condensed, found, solves)
        failure = rolling
    raise failure


def _end(condensed: Condensed, state: CoulombState, solves: int) -> ExactState:
    v, stuck = state.values, np.zeros(len(condensed.weight), dtype=bool)
    stuck[condensed.friction_nodes[state.sets.stuck]] = True
    kkt_residual = residual(condensed, state)
    return ExactState(
        state.factors, v.pressure, v.gap, v.motion, v.traction, state.sets.closed, stuck, solves, kkt_residual
    )


def touched_nodes(condensed: Condensed, ends: tuple[ExactState, ...]) -> Mapping[str, BoolArray]:
    """Per contact, which paired nodes (w,) are no candidates and yet overlap in one of the states."""
    found = [condensed.touched(state.factors, state.motion, state.pressure, state.traction) for state in ends]
    return {pair.name: np.any([masks[pair.name] for masks in found], axis=0) for pair in condensed.pairings}


def reach_error(contact: str, gap: float) -> NumericalError:
    """A node that was left out of a contact overlaps the other surface."""
    return NumericalError(
        f"contact {contact}: a node left out because of its initial gap has come into contact",
        f'set contact.{contact}.reach above {gap:.3g}, or to "auto"'
        if gap > 0.0
        else f"there the surfaces of contact {contact} overlap as drawn, by {-gap:.3g}: draw them touching",
    )


BETWEEN = 8
"""Between the ends of a stage contacts are looked at so many times less one, or less often where there are
many stages, whether they pass beyond the ranges of their grids."""
