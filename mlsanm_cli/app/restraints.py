"""Rigid motions that nothing resists: held at zero where nothing drives them, refused where a load does.

Platens, obstacles and bodies held by contact alone move as unknowns. A contact resists a relative motion of
its two sides where its normals point along it, with friction every motion. Two kinds of motion find no
resistance: those that slide a body's surfaces along themselves, as a disk turns, and those that no contact's
normals tilt towards by more than ``TILT``. They are the null vectors of a matrix over all unknown motions, so
that axes mean nothing, and several bodies may have one in common.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np

from mlsanm_cli.app.loads import Acting
from mlsanm_cli.app.stages import stage_factors
from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.case import Case
from mlsanm_cli.cloud.cloud import Cloud
from mlsanm_cli.contact.near import turned
from mlsanm_cli.contact.observers import resultant
from mlsanm_cli.contact.pairing import Pairing
from mlsanm_cli.errors import CaseError, CaseProblem
from mlsanm_cli.mechanics.rigid import ROTATION, independent_rows, rigid_pattern
from mlsanm_cli.mechanics.scene import LooseBody, Mover, Obstacle, Platen, RigidMotion
from mlsanm_cli.values import dataclass

TILT = 0.2
"""A contact resists a direction where its normals' root mean square component along it is above this.

Below, the resistance comes from the surface's slight curvature alone: too little to tell the true motion from
the discretisation's asymmetry.
"""
SLIDES = 1e-6
"""Resistance below this is round-off."""
BALANCED = 1e-3
"""Forces that cancel but for this part of themselves do so but for the surfaces' quadrature."""


NONE = 1e-5
"""Parts of a free motion below this part of the largest are round-off."""
FIRST = 1e-6
SURE = 1e-3
"""The same as ``TILT`` of contacts whose directions are exact, so that nothing but the surface's curvature is
in them."""


@dataclass(frozen=True)
class Restrained:
    """The movers, ``notes`` on what is held, and the motions held: of each the velocities (3,) of every body
    in it, x, y and the rotation about the origin."""

    movers: tuple[Mover, ...]
    notes: tuple[str, ...]
    held: tuple[Mapping[str, FloatArray], ...]


@dataclass(frozen=True, eq=False)
class _Unknown:
    """One unknown motion: ``force`` (L,) that drives it at factor 1, ``size`` (L,) of that force's parts,
    ``elastic`` whether something besides contacts resists it, ``lever`` the largest displacement of a contact
    under a unit of it."""

    mover: Mover
    motion: RigidMotion
    force: FloatArray
    size: FloatArray
    elastic: bool
    lever: float = 1.0

    @property
    def body(self) -> str | None:
        """The body that it moves as a whole; None for obstacles."""
        return None if isinstance(self.mover, Obstacle) else self.mover.body

    def side(self, pairing: Pairing) -> float:
        """1 where it moves the slave of a contact, -1 where its master, else 0."""
        if isinstance(self.mover, Obstacle):
            return -1.0 if self.mover.contact == pairing.name else 0.0
        if self.elastic:
            return 0.0
        return float(self.body == pairing.slave_body) - float(self.body == pairing.master_body)

    def at(self, points: FloatArray) -> FloatArray:
        """Displacements (n, 2) of ``points`` (n, 2), at most 1 in contacts."""
        return rigid_pattern(points, self.mover.center, self.motion.component) / self.lever


def restrained(
    case: Case,
    clouds: Mapping[str, Cloud],
    pairings: Sequence[Pairing],
    movers: Sequence[Mover],
    loads: Acting,
    exact: Collection[str] = (),
) -> Restrained:
    """The movers with motions that nothing resists prescribed at zero, and notes about them.

    The directions of the contacts named ``exact`` are those of their surfaces; others know theirs at nodes.
    Raises CaseError where a load drives such a motion.
    """
    kept = [
        _unknown(mover, motion, clouds, pairings, loads)
        for mover in movers
        for motion in mover.motions
        if motion.prescribed is None
    ]
    held, notes, problems = list[_Unknown](), list[str](), list[CaseProblem]()
    unresisted = list[Mapping[str, FloatArray]]()
    for slid in (True, False):
        found = []
        resistance = (
            _sliding_resistance(kept, pairings, clouds)
            if slid
            else _contact_resistance(kept, pairings, clouds, exact)
        )
        for pivot, direction in free_motions(resistance):
            problems += _driven(case, kept, pivot, direction)
            notes.append(_note(kept, pivot, direction))
            unresisted.append(_of_bodies(kept, direction))
            found.append(kept[pivot])
        held += found
        kept = [one for one in kept if one not in found]
    if problems:
        raise CaseError(tuple(dict.fromkeys(problems)))
    still = {(id(one.mover), one.motion.component) for one in held}
    result = [
        replace(
            mover,
            motions=tuple(
                replace(m, prescribed=np.zeros(len(m.force))) if (id(mover), m.component) in still else m
                for m in mover.motions
            ),
        )
        for mover in movers
    ]
    return Restrained(tuple(result), tuple(notes), tuple(one for one in unresisted if one))


def free_motions(resistance: FloatArray) -> list[tuple[int, FloatArray]]:
    """The motions that a ``resistance`` (k, k) leaves free, as many as there are: the number of an unknown of
    its own, to hold it by, and the free motion (k,) with a unit of that unknown and none of the others'."""
    if not len(resistance):
        return []
    sizes, directions = np.linalg.eigh(resistance)
    free = directions[:, sizes <= SLIDES**2]
    if not free.size:
        return []
    # Of motions that serve alike the first is held, whatever round-off says.
    order = 1.0 - FIRST * np.arange(len(free))
    pivots = independent_rows(order[:, None] * free)
    own = free @ np.linalg.inv(free[pivots])
    own[np.abs(own) <= NONE * np.abs(own).max(axis=0)] = 0.0
    own[pivots] = np.eye(len(pivots))
    return sorted(((pivot, own[:, column]) for column, pivot in enumerate(pivots)), key=lambda one: one[0])


def _unknown(
    mover: Mover,
    motion: RigidMotion,
    clouds: Mapping[str, Cloud],
    pairings: Sequence[Pairing],
    loads: Acting,
) -> _Unknown:
    """The motion with all that drives it: its own force, tractions and body forces on what moves with it."""
    force, size = motion.force.copy(), np.abs(motion.force)
    elastic = not motion.alone
    if not isinstance(mover, Obstacle) and not elastic:
        springs = loads.springs[mover.body].values()
        elastic = any(any(k) if motion.component == ROTATION else k[motion.component] for k in springs)
        for number, forces, points in _nodal_forces(loads, clouds, mover.body):
            parts = resultant(forces, points, mover.center)[motion.component]
            force[number] += parts.sum()
            size[number] += np.abs(parts).sum()
    one = _Unknown(mover, motion, force, size, elastic)
    moved = [one.at(clouds[p.slave_body].points[p.node]) for p in pairings if one.side(p)]
    return replace(one, lever=max((float(np.hypot(*some.T).max()) for some in moved), default=1.0))


def _nodal_forces(
    loads: Acting, clouds: Mapping[str, Cloud], body: str
) -> Iterator[tuple[int, FloatArray, FloatArray]]:
    """Load numbers, forces (n, 2) and points (n, 2) of all tractions and body forces on a body."""
    cloud = clouds[body]
    for load in loads.surface_loads:
        if load.body == body and not load.held:
            surface = cloud.surfaces[load.surface]
            yield load.number, surface.weight[:, None] * load.values, cloud.points[surface.index]
    for force in loads.body_forces:
        if force.body == body:
            yield force.number, cloud.areas[:, None] * force.values, cloud.points


def _sliding_resistance(
    unknown: Sequence[_Unknown], pairings: Sequence[Pairing], clouds: Mapping[str, Cloud]
) -> FloatArray:
    """Mean squares (k, k) of what the motions do across the surfaces they move, with friction in all."""
    total = _elastic(unknown)
    for pairing in pairings:
        chosen = pairing.candidate
        points = clouds[pairing.slave_body].points[pairing.node[chosen]]
        own = pairing.slave.normal[pairing.position[chosen]]
        for side, at, normal in ((1.0, points, own), (-1.0, pairing.partner[chosen], pairing.normal[chosen])):
            moving = [(column, one) for column, one in enumerate(unknown) if one.side(pairing) == side]
            across = np.zeros((len(at), 2 if pairing.friction else 1, len(unknown)))
            for column, one in moving:
                across[:, 0, column] = (one.at(at) * normal).sum(axis=1)
                if pairing.friction:
                    across[:, 1, column] = (one.at(at) * turned(normal)).sum(axis=1)
            total += np.einsum("ndi,ndj->ij", across, across) / len(at)
    return total


def _contact_resistance(
    unknown: Sequence[_Unknown],
    pairings: Sequence[Pairing],
    clouds: Mapping[str, Cloud],
    exact: Collection[str],
) -> FloatArray:
    """Mean squares (k, k) of what the motions do in the directions that contacts resist."""
    total = _elastic(unknown)
    for pairing in pairings:
        chosen = pairing.candidate
        points = clouds[pairing.slave_body].points[pairing.node[chosen]]
        share = pairing.weight[chosen] / pairing.weight[chosen].sum()
        middle = share @ points
        arm = points - middle
        lever = float(np.sqrt(share @ (arm**2).sum(axis=1))) or 1.0
        n_x, n_y = pairing.normal[chosen].T
        across = np.column_stack([n_x, n_y, (n_y * arm[:, 0] - n_x * arm[:, 1]) / lever])
        sizes, directions = np.linalg.eigh(across.T @ (share[:, None] * across))
        least = SURE if pairing.name in exact else TILT
        resisted = np.eye(3) if pairing.friction else directions[:, sizes >= least**2].T
        relative = np.zeros((3, len(unknown)))
        for column, one in enumerate(unknown):
            turn = lever / one.lever if one.motion.component == ROTATION else 0.0
            relative[:, column] = one.side(pairing) * np.append(one.at(middle[None, :])[0], turn)
        total += relative.T @ resisted.T @ resisted @ relative
    return total


def _elastic(unknown: Sequence[_Unknown]) -> FloatArray:
    """The part of the resistance (k, k) that has nothing to do with contacts."""
    return np.diag([float(one.elastic) for one in unknown])


def _driven(
    case: Case, unknown: Sequence[_Unknown], pivot: int, direction: FloatArray
) -> Iterator[CaseProblem]:
    """A problem where the loads drive a free motion at the end of some stage."""
    share = direction / np.array([one.lever for one in unknown])
    force = share @ np.array([one.force for one in unknown])
    size = np.abs(share) @ np.array([one.size for one in unknown])
    stages = stage_factors(case)
    driving = np.abs(stages @ force)
    if (driving > BALANCED * (np.abs(stages) @ size)).any():
        worst = stages[int(np.argmax(driving))] * force / share[pivot]
        load = case.moved[int(np.argmax(np.abs(worst)))]
        one, together = unknown[pivot], _together(unknown, pivot, direction)
        what = "moment" if one.motion.component == ROTATION else "force"
        whom = f"{_owner(one)} in {_way(one)}"
        if together:
            whom += f", which moves {together} with it"
        yield CaseProblem(
            f"load.{load}",
            f"nothing resists its force on {whom}, where loads add up to a {what} of {worst.sum():.4g}: "
            f"no support holds it, and the contact's normals hardly tilt that way",
            hint=f"hold it there with a [[support]]{_instead(one)}",
        )


def _note(unknown: Sequence[_Unknown], pivot: int, direction: FloatArray) -> str:
    one, together = unknown[pivot], _together(unknown, pivot, direction)
    if together:
        return (
            f"{_owner(one)}: {_way(one)} is held at 0, for nothing resists that it moves together with "
            f"{together}, and no force drives them; they still move against each other"
        )
    return (
        f"{_owner(one)}: {_way(one)} is held at 0, for no force is applied in {_way(one)} and nothing "
        f"resists it"
    )


def _together(unknown: Sequence[_Unknown], pivot: int, direction: FloatArray) -> str:
    """What takes part in a motion besides what it is held by, in words."""
    names = dict.fromkeys(_owner(one) for one, part in zip(unknown, direction, strict=True) if part)
    return " and ".join(name for name in names if name != _owner(unknown[pivot]))


def _of_bodies(unknown: Sequence[_Unknown], direction: FloatArray) -> dict[str, FloatArray]:
    """Velocities (3,) of all bodies in a motion: x, y, and the rotation, about the origin."""
    found: dict[str, FloatArray] = {}
    for one, part in zip(unknown, direction, strict=True):
        if part and one.body is not None:
            x, y = rigid_pattern(np.zeros((1, 2)), one.mover.center, one.motion.component)[0]
            turn = 1.0 if one.motion.component == ROTATION else 0.0
            found[one.body] = found.get(one.body, np.zeros(3)) + part / one.lever * np.array([x, y, turn])
    return found


def _owner(one: _Unknown) -> str:
    if isinstance(one.mover, Platen):
        return f"platen on {one.mover.name}"
    if isinstance(one.mover, Obstacle):
        return f"the obstacle of contact {one.mover.contact}"
    return f"body {one.mover.body}"


def _way(one: _Unknown) -> str:
    return ("ux", "uy", "rotation")[one.motion.component]


def _instead(one: _Unknown) -> str:
    if isinstance(one.mover, LooseBody) or one.motion.component == ROTATION:
        return ""
    return f", or prescribe {_way(one)} of the {'obstacle' if one.body is None else 'platen'}"
