"""Exact contact states at the ends of the stages, for scales, refinement and checks before the path
begins."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from mlsanm_cli.arrays import BoolArray, FloatArray, IntArray
from mlsanm_cli.case import Case
from mlsanm_cli.contact.complementarity.problem import ContactStatus
from mlsanm_cli.contact.laws.contact_state import ContactState
from mlsanm_cli.contact.laws.coulomb import increment, unloaded
from mlsanm_cli.contact.laws.failures import NoStateError, UnbalancedError
from mlsanm_cli.contact.laws.frictionless import solve_exact
from mlsanm_cli.contact.response.condensed import Condensed
from mlsanm_cli.errors import NumericalError
from mlsanm_cli.mechanics.scene import Scene
from mlsanm_cli.roundoff import ROUND_OFF
from mlsanm_cli.solve.condensed_scene import factors_at
from mlsanm_cli.solve.contact_grids import Wanted
from mlsanm_cli.solve.direction_updates import rolling
from mlsanm_cli.solve.limit_loads import beyond_limit, check_resisted, near_limit

MAX_LEVELS = 40
"""Largest number of levels of output that determine contact grids."""
LEVELS_BETWEEN = 8
"""Subdivisions of a stage at which contacts are checked to stay in the ranges of their grids; fewer with many
stages."""
MAX_NORMAL_TURN = 0.25
"""Rotation (radian) of normals over slips above which contact at small strain is not valid."""
FIRST_PARTS = (0.5, 0.1, 0.01)
"""Parts of the first stage that give a contact with friction its scales if its end cannot be reached."""


def searched_ends(
    case: Case,
    scene: Scene,
    stages: FloatArray,
    condensed: Condensed,
    starts: Sequence[ContactStatus],
    which: Wanted,
    known: Sequence[ContactState] = (),
) -> tuple[ContactState, ...]:
    """Exact states at those levels of the stages that are wanted (:data:`Wanted`). States ``known`` at equal
    load factors are reused, with friction those of a whole path. If a stage cannot be completed the last
    state is one near its limit load."""
    every_so_many = -(-len(case.output.at) // MAX_LEVELS) or 1
    positions = sorted({*range(len(stages)), *case.output.at[::every_so_many]})
    levels = np.stack([factors_at(stages, position) for position in positions])
    if len(condensed.friction_nodes):
        counted = stages if which == "ends" else levels
        reached = [one for one in known if (counted == one.factors).all(axis=1).any()]
        if which == "between":
            return ()
        if which == "ends" and known:
            return tuple(reached or known)
        if which == "every" and len(reached) == len(known) == len(positions) - 1:
            return tuple(known)
        if which == "ends":
            check_resisted(scene, condensed, stages)
        # After a separation at the end of a stage all guesses are needed again.
        followed = stages[: len(starts) + 1] if which == "known" else counted
        try:
            held = _friction_ends(scene, condensed, followed, starts)
        except UnbalancedError as error:
            raise beyond_limit(scene, condensed, stages[:2], error) from error
        check_slips(condensed, held)
        return held
    every = which in ("every", "between")
    factors = levels if which == "every" else stages
    if which == "between":
        most = max(2, min(LEVELS_BETWEEN, MAX_LEVELS // (len(stages) - 1)))
        parts = np.maximum(1, -(-most // _in_line(stages)))
        inner = (k + j / count for k, count in enumerate(parts.tolist()) for j in range(1, count))
        factors = np.stack([factors_at(stages, position) for position in (0.0, *inner)])
    if len(starts) not in (1, len(factors) - 1):
        starts = ()  # of other states

    def solved(wanted: FloatArray, first: BoolArray | None) -> ContactState:
        found = solve_exact(condensed, wanted, first)
        if error := rolling(scene, condensed, found):
            raise error
        return found

    ends: list[ContactState] = []
    lost: NumericalError | None = None
    for number, wanted in enumerate(factors[1:]):
        found = next((one for one in known if np.array_equal(one.factors, wanted)), None)
        if found is not None:
            ends.append(found)
            continue
        last = ends[-1].closed if ends else None
        try:
            first = starts[number].closed if number < len(starts) else last
            ends.append(solved(wanted, first))
        except NumericalError as error:
            # Loads beyond their limit, or a body not in contact.
            lost = lost or error
            if every:
                continue
            near = near_limit(condensed, stages) if isinstance(error, UnbalancedError) else None
            if near is None:
                break
            return (*ends, solved(near[0], last))
    if lost is None or (every and ends):
        return tuple(ends)
    raise beyond_limit(scene, condensed, stages, lost) if isinstance(lost, UnbalancedError) else lost


def _in_line(stages: FloatArray) -> IntArray:
    """Number of consecutive stages (s,) with the same direction of loads, from each of the ``stages`` (s + 1,
    L)."""
    way = np.diff(stages, axis=0)
    size = np.sqrt((way**2).sum(axis=1))
    turns = (way[1:] * way[:-1]).sum(axis=1) < (1.0 - ROUND_OFF) * size[1:] * size[:-1]
    row = np.concatenate([[0], np.cumsum(turns)])
    return np.asarray(np.bincount(row)[row])


def check_slips(condensed: Condensed, ends: Sequence[ContactState]) -> None:
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


def _friction_ends(
    scene: Scene, condensed: Condensed, stages: FloatArray, starts: Sequence[ContactStatus] = ()
) -> tuple[ContactState, ...]:
    """One increment per stage as far as loads can be carried; of the first stage at least a part without
    rolling."""

    def rolls(state: ContactState) -> UnbalancedError | None:
        # More nodes slip in one increment than on the path.
        return rolling(scene, condensed, replace(state, status=condensed.problem.touching(state.closed)))

    state, ends = unloaded(condensed, stages[0]), list[ContactState]()
    failure: NumericalError | None = None
    for factors, guess in itertools.zip_longest(stages[1:], starts[: len(stages) - 1]):
        found = increment(condensed, state, factors, guess=guess)
        if found is None or (not ends and rolls(found)):
            break
        state = found
        ends.append(state)
    for part in FIRST_PARTS if not ends else ():
        found = increment(condensed, state, state.factors + part * (stages[1] - state.factors))
        failure = NoStateError() if found is None else rolls(found)
        if found is not None and failure is None:
            return (found,)
    if failure is not None:
        raise failure
    return tuple(ends)


def reach_error(contact: str, gap: float) -> NumericalError:
    """Error of a node excluded from a contact that overlaps the other surface."""
    return NumericalError(
        f"contact {contact}: a node left out because of its initial gap has come into contact",
        f'set contact.{contact}.reach above {gap:.3g}, or to "auto"'
        if gap > 0.0
        else f"there the surfaces of contact {contact} overlap as drawn, by {-gap:.3g}: draw them touching",
    )
