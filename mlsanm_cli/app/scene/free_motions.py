"""Free rigid modes: fixed at zero without a load, an error with one.

The motions of platens, obstacles and bodies held by contact only are unknowns. A contact resists a relative
motion of its sides in the direction of its normals, with friction every relative motion. Two kinds of motion
are free: those that move surfaces along themselves, as the rotation of a disk, and those without a component
along any contact normal. They are the null vectors of a matrix over all unknown motions, and so independent
of the axes; one mode may move several bodies.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np

from mlsanm_cli.app.scene.loads import Acting
from mlsanm_cli.app.scene.rigid_modes import (
    QUADRATURE,
    UnknownMotion,
    contact_resistance,
    sliding_resistance,
    unknown_motion,
)
from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.case import Case
from mlsanm_cli.cloud.cloud import Cloud
from mlsanm_cli.contact.geometry.pairing import Pairing
from mlsanm_cli.errors import CaseError, CaseProblem
from mlsanm_cli.mechanics.rigid import ROTATION, independent_rows, rigid_pattern
from mlsanm_cli.mechanics.scene import RigidConstraint
from mlsanm_cli.records import dataclass
from mlsanm_cli.roundoff import COARSE_ROUND_OFF
from mlsanm_cli.solve.condensed_scene import stage_factors

WEAK_RESISTANCE = 0.05
"""Motions whose component normal to the surfaces is below this part of themselves are weakly resisted, also
if they move along both surfaces of a contact."""
NEGLIGIBLE = 1e-5
"""Parts of a free motion below this part of the largest are round-off."""
TIE_BREAK = 1e-6
MOTIONS = ("ux", "uy", "rotation")


@dataclass(frozen=True)
class Restrained:
    """The rigid constraints, ``notes`` on fixed motions, and these motions: for each the velocities (3,) of
    every body in it, in x, y and rotation about the origin. ``loose`` are those of floating bodies only,
    ``weak`` warnings about weakly resisted ones."""

    rigid_constraints: tuple[RigidConstraint, ...]
    notes: tuple[str, ...]
    held: tuple[Mapping[str, FloatArray], ...]
    loose: tuple[Mapping[str, FloatArray], ...]
    weak: tuple[str, ...]


def constrain_free_rigid_modes(
    case: Case,
    clouds: Mapping[str, Cloud],
    pairings: Sequence[Pairing],
    rigid_constraints: Sequence[RigidConstraint],
    loads: Acting,
    exact: Collection[str] = (),
) -> Restrained:
    """The rigid constraints with free modes prescribed at zero, and notes about them. The directions of
    contacts named ``exact`` are those of their surfaces, of others those at the nodes. Raises CaseError if a
    load drives a free mode."""
    kept = [
        unknown_motion(constraint, motion, clouds, pairings, loads)
        for constraint in rigid_constraints
        for motion in constraint.motions
        if motion.prescribed is None
    ]
    held, notes, problems = dict[int, dict[int, FloatArray]](), list[str](), list[CaseProblem]()
    # At finite strain the unknowns are those along the axes.
    oblique = case.model.strain == "small"
    unresisted, loose = list[Mapping[str, FloatArray]](), list[Mapping[str, FloatArray]]()
    for slid in (True, False):
        fixed = []
        if slid:
            free = free_motions(sliding_resistance(kept, pairings, clouds))
        else:
            free = free_motions(contact_resistance(kept, pairings, clouds, exact))
        for pivot, direction in sorted(free, key=lambda motion: kept[motion[0]].motion.component != ROTATION):
            problems += _driven(case, kept, pivot, direction)
            owner, component = kept[pivot].constraint, kept[pivot].motion.component
            along = _velocity(kept, owner, direction) if oblique else np.eye(3)[component, :2]
            notes.append(_note(kept, pivot, direction, along))
            held.setdefault(id(owner), {})[component] = along
            unresisted.append(_of_bodies(kept, direction))
            if all(unknown.constraint.floats for unknown in _moving(kept, direction)):
                loose.append(unresisted[-1])
            fixed.append(kept[pivot])
        kept = [unknown for unknown in kept if unknown not in fixed]
    if problems:
        raise CaseError(tuple(dict.fromkeys(problems)))
    weak = free_motions(sliding_resistance(kept, pairings, clouds, at_once=True), WEAK_RESISTANCE)
    return Restrained(
        tuple(_held_at_zero(owner, held.get(id(owner), {})) for owner in rigid_constraints),
        tuple(notes),
        tuple(filter(None, unresisted)),
        tuple(loose),
        tuple(_weakly_resisted(kept, pivot, direction) for pivot, direction in weak),
    )


def _held_at_zero(constraint: RigidConstraint, held: Mapping[int, FloatArray]) -> RigidConstraint:
    """The ``constraint`` with the components that ``held`` names prescribed at zero: those by which motions
    are fixed that move its centre along ``held[component]`` (2,). Of a motion oblique to x and y its own
    direction is fixed: with x or y alone, displacements would depend on the axes."""
    axes, motions = _own_axes(constraint, held), []
    for motion in constraint.motions:
        if motion.component in axes:
            axis = axes[motion.component]
            forces = [part.force for part in constraint.motions if part.component != ROTATION]
            motion = replace(motion, axis=axis, force=np.array(axis) @ forces)
        still = motion.component in held
        motions.append(replace(motion, prescribed=np.zeros(len(motion.force))) if still else motion)
    return replace(constraint, motions=tuple(motions))


def _own_axes(constraint: RigidConstraint, held: Mapping[int, FloatArray]) -> dict[int, tuple[float, float]]:
    """Axes of the translations by component, if just one of two unknown ones is ``held`` and oblique."""
    unknown = {motion.component for motion in constraint.motions if motion.prescribed is None} - {ROTATION}
    pivots = unknown & held.keys()
    if len(unknown) < 2 or len(pivots) != 1:
        return {}
    pivot = pivots.pop()
    if not held[pivot].all():
        return {}
    x, y = (float(part) for part in held[pivot] / np.hypot(*held[pivot]))
    return {pivot: (x, y), 1 - pivot: (-y, x)}


def free_motions(resistance: FloatArray, least: float = COARSE_ROUND_OFF) -> list[tuple[int, FloatArray]]:
    """The motions that a ``resistance`` (k, k) leaves free, or resists by less than ``least``: for each the
    number of an unknown by which it is fixed, and the motion (k,), 1 in this unknown and 0 in those of the
    other motions."""
    if not len(resistance):
        return []
    sizes, directions = np.linalg.eigh(resistance)
    free = directions[:, sizes <= least**2]
    if not free.size:
        return []
    # Of equivalent unknowns the first is chosen, whatever the round-off.
    order = 1.0 - TIE_BREAK * np.arange(len(free))
    pivots = independent_rows(order[:, None] * free)
    motions = free @ np.linalg.inv(free[pivots])
    motions[np.abs(motions) <= NEGLIGIBLE * np.abs(motions).max(axis=0)] = 0.0
    motions[pivots] = np.eye(len(pivots))
    columns = sorted(range(len(pivots)), key=lambda column: pivots[column])
    return [(pivots[column], motions[:, column]) for column in columns]


def _driven(
    case: Case, unknowns: Sequence[UnknownMotion], pivot: int, direction: FloatArray
) -> Iterator[CaseProblem]:
    """A problem if the loads drive a free motion at the end of some stage."""
    share = direction / np.array([unknown.lever for unknown in unknowns])
    force = share @ np.array([unknown.force for unknown in unknowns])
    size = np.abs(share) @ np.array([unknown.size for unknown in unknowns])
    stages = stage_factors(case)
    driving = np.abs(stages @ force)
    if (driving > QUADRATURE * (np.abs(stages) @ size)).any():
        worst = stages[int(np.argmax(driving))] * force / share[pivot]
        load = case.moved[int(np.argmax(np.abs(worst)))]
        unknown, together = unknowns[pivot], _together(unknowns, pivot, direction)
        what = "moment" if unknown.motion.component == ROTATION else "force"
        whom = f"{_owner(unknown)} in {_way(unknown)}"
        if together:
            whom += f", which moves {together} with it"
        yield CaseProblem(
            f"load.{load}",
            f"nothing resists its force on {whom}, where loads add up to a {what} of {worst.sum():.4g}: "
            f"no support acts there, and contact normals have almost no component in this direction",
            hint=f"add a [[support]] there{_prescribe_hint(unknown)}",
        )


def _note(unknowns: Sequence[UnknownMotion], pivot: int, direction: FloatArray, along: FloatArray) -> str:
    unknown, together = unknowns[pivot], _together(unknowns, pivot, direction)
    way = _way(unknown)
    if unknown.motion.component != ROTATION and along.all():
        x, y = along / np.hypot(*along)
        way = f"the displacement along ({x:.3g}, {y:.3g})"
    if together:
        return (
            f"{_owner(unknown)}: {way} is fixed at 0 (no load and no stiffness): it moves together with "
            f"{together}; their relative motion stays free"
        )
    return f"{_owner(unknown)}: {way} is fixed at 0 (no load and no stiffness in this direction)"


def _weakly_resisted(unknowns: Sequence[UnknownMotion], pivot: int, direction: FloatArray) -> str:
    """Warning about a weakly resisted motion."""
    unknown, together = unknowns[pivot], _together(unknowns, pivot, direction)
    moves = f", which moves {together} with it," if together else ""
    return (
        f"{_owner(unknown)}: {_way(unknown)}{moves} is hardly resisted, because it follows the surfaces in "
        "contact: results depend on the exact positions of supported nodes and on the contact width; fix it "
        f"with a [[support]]{_prescribe_hint(unknown)}"
    )


def _together(unknowns: Sequence[UnknownMotion], pivot: int, direction: FloatArray) -> str:
    """The names of what else moves in a motion besides the unknowns by which it is fixed."""
    names = dict.fromkeys(_owner(unknown) for unknown in _moving(unknowns, direction))
    return " and ".join(name for name in names if name != _owner(unknowns[pivot]))


def _moving(unknowns: Sequence[UnknownMotion], direction: FloatArray) -> list[UnknownMotion]:
    """The unknowns that a motion involves."""
    return [unknown for unknown, part in zip(unknowns, direction, strict=True) if part]


def _velocity(
    unknowns: Sequence[UnknownMotion], constraint: RigidConstraint, direction: FloatArray
) -> FloatArray:
    """Velocity (2,) of a constraint's centre in a motion."""
    return sum(
        (
            part / unknown.lever * unknown.motion.direction[:2]
            for unknown, part in zip(unknowns, direction, strict=True)
            if unknown.constraint is constraint
        ),
        np.zeros(2),
    )


def _of_bodies(unknowns: Sequence[UnknownMotion], direction: FloatArray) -> dict[str, FloatArray]:
    """Velocities (3,) of all bodies in a motion, in x, y and rotation about the origin."""
    found: dict[str, FloatArray] = {}
    for unknown, part in zip(unknowns, direction, strict=True):
        for body in unknown.bodies if part else ():
            x, y = rigid_pattern(np.zeros((1, 2)), unknown.constraint.center, unknown.motion.component)[0]
            turn = 1.0 if unknown.motion.component == ROTATION else 0.0
            found[body] = found.get(body, np.zeros(3)) + part / unknown.lever * np.array([x, y, turn])
    return found


def _owner(unknown: UnknownMotion) -> str:
    name = unknown.constraint.name
    if unknown.constraint.floats:
        return f"body {name}"
    return f"platen on {name}" if unknown.bodies else f"the obstacle of contact {name}"


def _way(unknown: UnknownMotion) -> str:
    return MOTIONS[unknown.motion.component]


def _prescribe_hint(unknown: UnknownMotion) -> str:
    if unknown.constraint.floats or unknown.motion.component == ROTATION:
        return ""
    return f", or prescribe {_way(unknown)} of the {'platen' if unknown.bodies else 'obstacle'}"
