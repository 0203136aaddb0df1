"""Exact contact states at given loads, mostly the ends of the stages: for scales, refinement and checks
before the path begins; and limit loads beyond which there are none: what slides, tips or separates, and at
which part of the loads."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from mlsanm_cli.arrays import BoolArray, FloatArray
from mlsanm_cli.contact.complementarity.equilibrium import BALANCED, equilibrium
from mlsanm_cli.contact.complementarity.problem import ContactStatus
from mlsanm_cli.contact.laws.contact_state import ContactState, NoStateError, SlidingError, UnbalancedError
from mlsanm_cli.contact.laws.coulomb import increment, unloaded
from mlsanm_cli.contact.laws.frictionless import solve_exact
from mlsanm_cli.contact.response.condensed import Condensed
from mlsanm_cli.errors import NumericalError
from mlsanm_cli.mechanics.rigid import ROTATION
from mlsanm_cli.mechanics.scene import Scene
from mlsanm_cli.roundoff import COARSE_ROUND_OFF, ROUND_OFF
from mlsanm_cli.solve.condensed_scene import factors_at
from mlsanm_cli.solve.direction_updates import rolling

MAX_NORMAL_TURN = 0.25
"""Rotation (radian) of normals over slips above which contact at small strain is not valid."""
FIRST_PARTS = (0.5, 0.1, 0.01)
"""Parts of the first stage that give a contact with friction its scales if its end cannot be reached."""
MIN_REACHED = 0.85
"""Part of a limit load at which a path that ends is reported as having reached it."""
LAST_LEVEL = 0.9
"""Part of a limit load of the last state that scales and refines the path."""
MIN_MOTION = 1e-3
"""Least motion of a body, relative to the largest, in a mechanism."""
SLIDES = "slide"
"""What messages call it."""
MIN_FRICTION_WORK = 0.5
"""Part of the work of the loads dissipated by friction above which the mechanism is sliding."""


def contact_states(
    scene: Scene,
    condensed: Condensed,
    stages: FloatArray,
    levels: FloatArray,
    starts: Sequence[ContactStatus] = (),
    skips: bool = False,
) -> tuple[ContactState, ...]:
    """Exact states at load factors ``levels`` (N, L) of a path along ``stages`` (T + 1, L), with friction by
    one increment to each, searched from sets ``starts``: one each, or that of the first. The states end at
    the first level without one, without friction in one near the limit load, unless such levels are to be
    skipped. Raises NumericalError if there are none."""
    starts = starts if len(starts) in (1, len(levels)) or len(condensed.friction_nodes) else ()
    if len(condensed.friction_nodes):
        return _increments(scene, condensed, stages, levels, starts)
    states: list[ContactState] = []
    lost: NumericalError | None = None
    for number, factors in enumerate(levels):
        last = states[-1].closed if states else None
        try:
            first = starts[number].closed if number < len(starts) else last
            states.append(_resting(scene, condensed, factors, first))
        except NumericalError as error:
            # Loads beyond their limit, or a body not in contact.
            lost = lost or error
            if not skips:
                break
    if lost is None or (skips and states):
        return tuple(states)
    near = near_limit(condensed, stages) if isinstance(lost, UnbalancedError) and not skips else None
    if near is None:
        raise beyond_limit(scene, condensed, stages, lost)
    factors = factors_at(stages, near.stage + LAST_LEVEL * near.part)
    return (*states, _resting(scene, condensed, factors, last))


def _resting(
    scene: Scene, condensed: Condensed, factors: FloatArray, start: BoolArray | None
) -> ContactState:
    """The state without friction at load ``factors`` (L,), in which no load rotates a body on."""
    state = solve_exact(condensed, factors, start)
    if error := rolling(scene, condensed, state):
        raise error
    return state


def _check_slips(condensed: Condensed, ends: Sequence[ContactState]) -> None:
    """UnbalancedError if forces move round bodies along each other until their normals have rotated: contacts
    with initial pairs do not know where they come to rest."""
    if not len(condensed.balance.constant):
        return
    for name, tangential in condensed.tangential.items():
        pairing, span = condensed.pairing_of(name), condensed.spans[name]
        if pairing.nodal or pairing.grid.facing.other is None:
            continue
        curvature = [
            float(one.curvature(np.array([0.5 * one.length]))[0]) for one in pairing.grid.facing.curves
        ]
        if min(curvature) <= 0.0:
            continue
        for end in ends:
            slip = condensed.slip(*end.unknowns)[tangential]
            largest = float(np.abs(slip[end.pressure[span] > 0.0]).max(initial=0.0))
            # As the line between the centres of two disks.
            turn = largest / sum(1.0 / one for one in curvature)
            if turn > MAX_NORMAL_TURN:
                raise UnbalancedError(
                    f"contact {name}: friction does not hold the bodies in their drawn position: they slide "
                    f"by {largest:.3g} before the loads are balanced, and normals rotate by "
                    f"{np.degrees(turn):.3g} degrees meanwhile",
                    "raise friction, reduce tangential loads, or fix the bodies by supports",
                )


def _increments(
    scene: Scene,
    condensed: Condensed,
    stages: FloatArray,
    levels: FloatArray,
    starts: Sequence[ContactStatus],
) -> tuple[ContactState, ...]:
    """One increment to each level as far as loads can be carried; to the first one at least a part without
    rolling."""
    begin = stages[0]

    def rolls(state: ContactState) -> UnbalancedError | None:
        # More nodes slip in one increment than on the path.
        return rolling(scene, condensed, replace(state, status=condensed.problem.touching(state.closed)))

    state, ends = unloaded(condensed, begin), list[ContactState]()
    failure: NumericalError | None = None
    for factors, guess in itertools.zip_longest(levels, starts[: len(levels)]):
        found = increment(condensed, state, factors, guess=guess)
        if found is None or (not ends and rolls(found)):
            break
        state = found
        ends.append(state)
    for part in FIRST_PARTS if not ends else ():
        found = increment(condensed, state, begin + part * (levels[0] - begin))
        failure = NoStateError() if found is None else rolls(found)
        if found is not None and failure is None:
            ends.append(found)
            break
    if not ends and failure is not None:
        raise beyond_limit(scene, condensed, stages[:2], failure)
    _check_slips(condensed, ends)
    return tuple(ends)


def reach_error(contact: str, gap: float) -> NumericalError:
    """Error of a node excluded from a contact that overlaps the other surface."""
    return NumericalError(
        f"contact {contact}: a node left out because of its initial gap has come into contact",
        f'set contact.{contact}.reach above {gap:.3g}, or to "auto"'
        if gap > 0.0
        else f"there the surfaces of contact {contact} overlap as drawn, by {-gap:.3g}: draw them touching",
    )


class Limit(NamedTuple):
    """The ``part`` up to 1 of the change of loads in a ``stage`` that pressures and tractions ``forces`` (m +
    n,) carry, and the ``motion`` (k,), up to a factor, that more would cause, and its ``work``."""

    stage: int
    part: float
    forces: FloatArray
    motion: FloatArray
    work: float

    @property
    def reached(self) -> bool:
        """Whether not all of the change is carried."""
        return self.part <= 1.0 - BALANCED


def _limit(condensed: Condensed, stages: FloatArray, stage: int) -> Limit | None:
    """The limit of a stage; None if its first loads cannot be carried, or if no motion is unknown."""
    balance, nodes, m = condensed.balance, condensed.friction_nodes, len(condensed.weight)
    start = balance.constant + balance.load @ stages[stage]
    more = balance.load @ (stages[stage + 1] - stages[stage])
    if not len(start) or not m or not (start.any() or more.any()):
        return None
    rows = np.hstack([balance.pressure, balance.traction, balance.motion])
    largest = np.abs(rows[:, : m + len(nodes)]).max(axis=1)
    scale = np.where(largest > 0.0, largest, np.abs(rows).max(axis=1))
    scale = np.where(scale > 0.0, scale, 1.0)
    found = equilibrium(rows / scale[:, None], nodes, condensed.friction, start / scale, more / scale)
    if found is None:
        return None
    part, forces, mechanism = found
    motion = mechanism / scale
    return Limit(stage, part, forces, motion, part * abs(float(more @ motion)))


def _first_limit(condensed: Condensed, stages: FloatArray) -> Limit | None:
    """The first limit load of ``stages`` (T + 1, L)."""
    limits = (_limit(condensed, stages, stage) for stage in range(len(stages) - 1))
    return next((limit for limit in limits if limit is not None and limit.reached), None)


def near_limit(condensed: Condensed, stages: FloatArray) -> Limit | None:
    """The first limit load of ``stages`` (T + 1, L), if a part of it can be carried."""
    limit = _first_limit(condensed, stages)
    return limit if limit is not None and limit.part > COARSE_ROUND_OFF else None


def beyond_limit(
    scene: Scene, condensed: Condensed, stages: FloatArray, error: NumericalError
) -> NumericalError:
    """The error of a state that is not found, or the limit load if none balances the loads."""
    limit = _first_limit(condensed, stages) if isinstance(error, UnbalancedError) else None
    return error if limit is None else UnbalancedError(*_named(scene, condensed, stages, limit))


def at_limit(
    scene: Scene, condensed: Condensed, stages: FloatArray, last: float, error: NumericalError
) -> NumericalError:
    """The error that ended a path along ``stages`` (T + 1, L) at position ``last``, or the limit load that it
    came close to."""
    stage = min(int(last), len(stages) - 2)
    limit = _limit(condensed, stages, stage)
    if limit is None or not limit.reached or last - stage < MIN_REACHED * limit.part:
        return error
    text, hint = _named(scene, condensed, stages, limit)
    if isinstance(error, SlidingError) and f" {SLIDES}" in text:
        return error
    return NumericalError(f"{text} (the path ended at {last:.6g}: {error.message})", hint)


def _named(scene: Scene, condensed: Condensed, stages: FloatArray, limit: Limit) -> tuple[str, str]:
    """Message and hint of the limit load of a stage: which bodies move, and how."""
    bodies, turns = moving_bodies(scene, limit.motion)
    names, several = ", ".join(bodies[:-1]) + " and " * (len(bodies) > 1) + bodies[-1], len(bodies) > 1
    motion, balance = limit.motion, condensed.balance
    pressure, traction = np.split(limit.forces, [len(condensed.weight)])
    opening, along = condensed.gap.motion @ motion, np.abs(condensed.slip.motion @ motion)
    # Where nothing is carried the direction of motion decides.
    slides = along.max(initial=0.0) > np.abs(opening).max(initial=0.0)
    if limit.work:
        dissipated = float(np.abs(traction * (balance.traction.T @ motion)).sum())
        slides = dissipated / limit.work > MIN_FRICTION_WORK
    moved = pressure[np.abs(balance.pressure.T @ motion) + np.abs(opening) > 0.0]
    pressed = moved.max(initial=0.0) > ROUND_OFF * pressure.max(initial=0.0)
    # A motion that opens contacts would close others without its rotations.
    straight = condensed.gap.motion @ np.where(turns, 0.0, motion) * np.sign(opening.sum())
    pushed = straight.min(initial=0.0) < -COARSE_ROUND_OFF * np.abs(opening).max(initial=0.0)
    tips = turns.any() and (pressed or pushed)
    verb, rest = (SLIDES, "") if slides else ("tip", " over") if tips else ("lose", " contact")
    how = f"{verb}{rest}" if several else f"{verb}s{rest}"
    if limit.part <= COARSE_ROUND_OFF:
        hint = f"fix {names} with a [[support]]" + (", or raise friction" if slides else "")
        return f"{names} {how}: the contacts cannot carry any load added in stage {limit.stage + 1}", hint
    changes = zip(scene.loads, stages[limit.stage], stages[limit.stage + 1], strict=True)
    loads = ", ".join(name for name, a, b in changes if a != b)
    return (
        f"{names} {how} at position {limit.stage + limit.part:.6g}: beyond this limit load no pressures and "
        f"tractions balance the loads",
        f"apply at most {100.0 * limit.part:.3g} % of the change of {loads} in stage {limit.stage + 1}, or "
        f"fix {names} with a [[support]]",
    )


def moving_bodies(scene: Scene, motions: FloatArray) -> tuple[list[str], BoolArray]:
    """Bodies and obstacles that ``motions`` (k,) move, and which motions (k,) are rotations."""
    sizes: dict[str, float] = {}
    turns = np.zeros(len(motions), dtype=bool)
    for number, (constraint, motion) in enumerate(scene.unknown_motions):
        part = abs(float(motions[number]))
        points = {f"body {n}": scene.bodies[n].model.cloud.points for n in constraint.bodies}
        points = points or {f"the obstacle of contact {constraint.name}": np.zeros((1, 2))}
        for name, places in points.items():
            pattern = motion.pattern(places, constraint.center)
            moved = part * float(np.hypot(*pattern.T).max())
            sizes[name] = max(sizes.get(name, 0.0), moved)
            turns[number] |= motion.component == ROTATION and moved > 0.0
    largest = max(sizes.values())
    return [name for name, size in sizes.items() if size > MIN_MOTION * largest], turns
