"""Exact contact states at given loads, mostly the ends of the stages: for scales, refinement and checks
before the path begins."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from mlsanm_cli.arrays import BoolArray, FloatArray
from mlsanm_cli.contact.complementarity.problem import ContactStatus
from mlsanm_cli.contact.laws.contact_state import ContactState
from mlsanm_cli.contact.laws.coulomb import increment, unloaded
from mlsanm_cli.contact.laws.failures import NoStateError, UnbalancedError
from mlsanm_cli.contact.laws.frictionless import solve_exact
from mlsanm_cli.contact.response.condensed import Condensed
from mlsanm_cli.errors import NumericalError
from mlsanm_cli.mechanics.scene import Scene
from mlsanm_cli.solve.direction_updates import rolling
from mlsanm_cli.solve.limit_loads import beyond_limit, near_limit

MAX_NORMAL_TURN = 0.25
"""Rotation (radian) of normals over slips above which contact at small strain is not valid."""
FIRST_PARTS = (0.5, 0.1, 0.01)
"""Parts of the first stage that give a contact with friction its scales if its end cannot be reached."""


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
    return (*states, _resting(scene, condensed, near[0], last))


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
