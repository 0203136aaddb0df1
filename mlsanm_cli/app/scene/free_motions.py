"""Free rigid modes: fixed at zero without a load, an error with one. The motions of platens, obstacles and
bodies held by contact only are unknowns. A contact resists a relative motion of its sides in the direction of
its normals, with friction every relative motion. Two kinds of motion are free: those that move surfaces along
themselves, as the rotation of a disk, and those without a component along any contact normal. They are the
null vectors of a matrix over all unknown motions, and so independent of the axes; one mode may move several
bodies."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from mlsanm_cli.app.scene.loads import Acting
from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.case import Case
from mlsanm_cli.cloud.cells import FINE, Halves
from mlsanm_cli.cloud.cloud import Cloud
from mlsanm_cli.cloud.membership import cross
from mlsanm_cli.cloud.surface import normals_towards
from mlsanm_cli.contact.geometry.pairing import Pairing
from mlsanm_cli.errors import CaseError, CaseProblem
from mlsanm_cli.mechanics.rigid import ROTATION, independent_rows, rigid_pattern
from mlsanm_cli.mechanics.scene import RigidConstraint, RigidMotion
from mlsanm_cli.records import dataclass
from mlsanm_cli.roundoff import COARSE_ROUND_OFF
from mlsanm_cli.solve.condensed_scene import stage_factors

MIN_NORMAL_COMPONENT = 0.2
"""Root mean square component of its normals above which a contact resists a direction. A smaller one is due
to slight curvature of the surface, and too small to distinguish the motion from asymmetry of the
discretisation."""
MIN_EXACT_COMPONENT = 1e-3
"""The same as ``MIN_NORMAL_COMPONENT`` for contacts with exact directions."""
QUADRATURE = 1e-3
"""Error of sums of forces by quadrature, relative to their magnitudes. Forces that all point to a centre, as
a pressure in a bore, have a moment by it only: this part of force times arm counts as terms that cancel."""
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


class UnknownMotion:
    """One unknown motion, its ``component`` and ``velocity`` (3,), in x, y and rotation about the origin: the
    unit motion over its ``lever``, at most 1 in contacts. The ``force`` (L,) on the unit motion by load at
    factor 1, its own, and tractions and body forces on the bodies that move; the sum ``size`` (L,) of the
    magnitudes of its terms; whether something besides contacts resists it (``elastic``). In words: what moves
    (``owner``), the ``way``, and a ``hint`` how to prescribe it other than by a support."""

    def __init__(
        self,
        constraint: RigidConstraint,
        motion: RigidMotion,
        clouds: Mapping[str, Cloud],
        pairings: Sequence[Pairing],
        loads: Acting,
    ) -> None:
        self.constraint, self.rotates = constraint, motion.component == ROTATION
        self.component, self.way = motion.component, MOTIONS[motion.component]
        self.force, self.size = motion.force.copy(), np.abs(motion.force)
        self.elastic, center = not motion.alone, np.array(constraint.center)
        for body in () if self.elastic else constraint.bodies:
            for spring in loads.springs[body].values():
                self.elastic |= any(spring) if self.rotates else bool(spring[motion.component])
            for number, forces, points in _forces(loads, clouds[body], body):
                work = (forces * rigid_pattern(points, constraint.center, motion.component)).sum(axis=1)
                self.force[number] += work.sum()
                self.size[number] += np.abs(work).sum()
                if self.rotates:
                    self.size[number] += QUADRATURE * np.hypot(*forces.T) @ np.hypot(*(points - center).T)
        self.lever = 1.0
        touching = [clouds[p.slave_body].points[p.node] for p in pairings if self.side(p)]
        if self.rotates and touching:
            self.lever = max(float(np.hypot(*(points - center).T).max()) for points in touching)
        (origin,) = rigid_pattern(np.zeros((1, 2)), constraint.center, motion.component)
        self.velocity = np.append(origin, float(self.rotates)) / self.lever
        kind, name = "platen" if constraint.bodies else "obstacle", constraint.name
        self.owner = f"platen on {name}" if constraint.bodies else f"the obstacle of contact {name}"
        self.owner = f"body {name}" if constraint.floats else self.owner
        known = constraint.floats or self.rotates
        self.hint = "" if known else f", or prescribe {self.way} of the {kind}"

    def side(self, pairing: Pairing) -> int:
        """1 if it moves the slave of a contact, -1 for the master, else 0."""
        bodies = self.constraint.bodies
        if not bodies:
            return -1 if self.constraint.name == pairing.name else 0
        return 0 if self.elastic else (pairing.slave_body in bodies) - (pairing.master_body in bodies)


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
        UnknownMotion(constraint, motion, clouds, pairings, loads)
        for constraint in rigid_constraints
        for motion in constraint.motions
        if motion.prescribed is None
    ]
    held, notes, problems = dict[int, dict[int, FloatArray]](), list[str](), list[CaseProblem]()
    unresisted, loose = list[Mapping[str, FloatArray]](), list[Mapping[str, FloatArray]]()
    for rows in (sliding_rows, partial(pressure_rows, exact=exact)):
        fixed = []
        free = free_motions(resistance(kept, pairings, clouds, rows))
        for pivot, direction in sorted(free, key=lambda motion: not kept[motion[0]].rotates):
            unknown, others = kept[pivot], _others(kept, pivot, direction)
            parts = [(one, part) for one, part in zip(kept, direction, strict=True) if part]
            problems += _driven(case, unknown, parts, others)
            # At finite strain the unknowns are those along the axes.
            along = np.eye(3)[unknown.component, :2]
            if case.model.strain == "small":
                translations = [
                    p for p in parts if p[0].constraint is unknown.constraint and not p[0].rotates
                ]
                along = sum((part * one.velocity[:2] for one, part in translations), np.zeros(2))
            way = unknown.way
            if not unknown.rotates and along.all():
                x, y = along / np.hypot(*along)
                way = f"the displacement along ({x:.3g}, {y:.3g})"
            why = "no load and no stiffness" + ("" if others else " in this direction")
            also = f": it moves together with {others}; their relative motion stays free" if others else ""
            notes.append(f"{unknown.owner}: {way} is fixed at 0 ({why}){also}")
            held.setdefault(id(unknown.constraint), {})[unknown.component] = along
            velocities: dict[str, FloatArray] = {}
            for one, part in parts:
                for body in one.constraint.bodies:
                    velocities[body] = velocities.get(body, np.zeros(3)) + part * one.velocity
            unresisted.append(velocities)
            if all(one.constraint.floats for one, _ in parts):
                loose.append(velocities)
            fixed.append(unknown)
        kept = [unknown for unknown in kept if unknown not in fixed]
    if problems:
        raise CaseError(tuple(dict.fromkeys(problems)))
    weak = []
    at_once = resistance(kept, pairings, clouds, partial(sliding_rows, at_once=True))
    for pivot, direction in free_motions(at_once, WEAK_RESISTANCE):
        unknown, others = kept[pivot], _others(kept, pivot, direction)
        moves = f", which moves {others} with it," if others else ""
        weak.append(
            f"{unknown.owner}: {unknown.way}{moves} is hardly resisted, because it follows the surfaces in "
            "contact: results depend on the exact positions of supported nodes and on the contact width; fix "
            f"it with a [[support]]{unknown.hint}"
        )
    constraints = tuple(_held_at_zero(owner, held.get(id(owner), {})) for owner in rigid_constraints)
    return Restrained(constraints, tuple(notes), tuple(filter(None, unresisted)), tuple(loose), tuple(weak))


def _forces(loads: Acting, cloud: Cloud, body: str) -> Iterator[tuple[int, FloatArray, FloatArray]]:
    """Load numbers, forces (n, 2) and points (n, 2) of all tractions and body forces on a body."""
    for load in loads.surface_loads:
        if load.body == body and load.between is not None:
            surface = cloud.surfaces[load.surface]
            halves = Halves.of(surface, FINE)
            points = surface.curve.points(halves.arc)
            yield load.number, (halves.length * cloud.around(points))[:, None] * load.between, points
    for force in loads.body_forces:
        if force.body == body:
            yield force.number, cloud.volumes[:, None] * force.values, cloud.points


def _held_at_zero(constraint: RigidConstraint, held: Mapping[int, FloatArray]) -> RigidConstraint:
    """The ``constraint`` with the components that ``held`` names prescribed at zero: those by which motions
    are fixed that move its centre along ``held[component]`` (2,). If just one of two unknown translations is
    held, and oblique to x and y, its own direction is fixed: with x or y alone, displacements would depend on
    the axes."""
    translations = [motion for motion in constraint.motions if motion.component != ROTATION]
    unknown = {motion.component for motion in translations if motion.prescribed is None}
    pivots, axes, motions = unknown & held.keys(), dict[int, tuple[float, float]](), []
    if len(unknown) == 2 and len(pivots) == 1 and held[min(pivots)].all():
        (pivot,) = pivots
        x, y = (float(part) for part in held[pivot] / np.hypot(*held[pivot]))
        axes = {pivot: (x, y), 1 - pivot: (-y, x)}
    for motion in constraint.motions:
        if motion.component in axes:
            axis = axes[motion.component]
            motion = replace(motion, axis=axis, force=np.array(axis) @ [part.force for part in translations])
        still = motion.component in held
        motions.append(replace(motion, prescribed=np.zeros(len(motion.force))) if still else motion)
    return replace(constraint, motions=tuple(motions))


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


def _others(unknowns: Sequence[UnknownMotion], pivot: int, direction: FloatArray) -> str:
    """The names of what else moves in a motion (k,) besides the unknown ``pivot`` by which it is fixed."""
    moving = [one.owner for one, part in zip(unknowns, direction, strict=True) if part]
    return " and ".join(name for name in dict.fromkeys(moving) if name != unknowns[pivot].owner)


def _driven(
    case: Case, unknown: UnknownMotion, parts: Sequence[tuple[UnknownMotion, float]], others: str
) -> Iterator[CaseProblem]:
    """A problem if the loads drive a free motion, with ``parts`` of unknowns, at the end of some stage."""
    share = np.array([part / one.lever for one, part in parts])
    force = share @ np.array([one.force for one, _ in parts])
    size = np.abs(share) @ np.array([one.size for one, _ in parts])
    stages = stage_factors(case)
    driving = np.abs(stages @ force)
    if (driving > QUADRATURE * (np.abs(stages) @ size)).any():
        worst = stages[int(np.argmax(driving))] * force * unknown.lever
        whom = f"{unknown.owner} in {unknown.way}" + (f", which moves {others} with it" if others else "")
        yield CaseProblem(
            f"load.{case.moved[int(np.argmax(np.abs(worst)))]}",
            f"nothing resists its force on {whom}, where loads add up to a "
            f"{'moment' if unknown.rotates else 'force'} of {worst.sum():.4g}: "
            "no support acts there, and contact normals have almost no component in this direction",
            hint=f"add a [[support]] there{unknown.hint}",
        )


class _Contact:
    """A contact in its own frame: rigid motions (3,) are the translation of the middle of its candidates and
    the rotation times their root mean square distance from it, so that their mean square displacement is the
    square of their length. ``moved`` are the motions (3, k) of slave and master per unit of each unknown,
    ``normals`` those of both surfaces, as rows (m, 3) of the mean square normal component."""

    def __init__(
        self, pairing: Pairing, clouds: Mapping[str, Cloud], unknowns: Sequence[UnknownMotion]
    ) -> None:
        self.pairing, chosen = pairing, pairing.candidate
        points, partner = clouds[pairing.slave_body].points[pairing.node[chosen]], pairing.partner[chosen]
        self.share = pairing.weight[chosen] / pairing.weight[chosen].sum()
        x, y = middle = self.share @ points
        self.arms = points - middle, partner - middle
        self.lever = float(np.sqrt(self.share @ (self.arms[0] ** 2).sum(axis=1))) or 1.0
        frame = np.array([[1.0, 0.0, -y], [0.0, 1.0, x], [0.0, 0.0, self.lever]])
        sides = np.array([unknown.side(pairing) for unknown in unknowns])
        velocities = frame @ np.array([unknown.velocity for unknown in unknowns]).T
        self.moved = velocities * (sides == 1), velocities * (sides == -1)
        outward, normal = pairing.slave.normal[pairing.position[chosen]], pairing.normal[chosen]
        if pairing.master is not None:  # pressures may act along the normals of the slave
            curve = pairing.master.curve
            normal = normals_towards(curve, curve.closest(partner), outward)
        self.normals = self.across(outward, 0), self.across(normal, 1)

    def across(self, normal: FloatArray, side: int) -> FloatArray:
        """Rows (m, 3) of the component of motions along normals (m, 2) at the points of a side."""
        rows = np.column_stack([normal, cross(self.arms[side], normal) / self.lever])
        return np.asarray(np.sqrt(self.share)[:, None] * rows)


def sliding_rows(contact: _Contact, at_once: bool = False) -> FloatArray:
    """Rows (r, k) of the motions normal to the surfaces they move; with friction, in all directions. If one
    of two surfaces is straight, bodies may slide along both ``at_once``, as a disk that rotates about a point
    above the plane on which it rests: only the width of the contact resists. Two straight surfaces touch
    along their length or at a corner, which crosses the other unknown."""
    if contact.pairing.friction:
        return np.concatenate(contact.moved)
    if at_once:
        sides = [np.linalg.eigh(rows.T @ rows) for rows in contact.normals]
        free = [directions[:, sizes <= COARSE_ROUND_OFF**2] for sizes, directions in sides]
        straight = [bool(null.shape[1] and np.abs(null[2]).max() <= COARSE_ROUND_OFF) for null in free]
        if sum(straight) == 1:
            directions, sizes, _ = np.linalg.svd(np.hstack(free))
            crossing = directions[:, int((sizes > COARSE_ROUND_OFF).sum()) :]
            return np.asarray(crossing.T @ (contact.moved[0] - contact.moved[1]))
    return np.concatenate([rows @ moved for rows, moved in zip(contact.normals, contact.moved, strict=True)])


def pressure_rows(contact: _Contact, exact: Collection[str]) -> FloatArray:
    """Rows (r, k) of the relative motions in the directions that the pressures of a contact resist."""
    pairing, relative = contact.pairing, contact.moved[0] - contact.moved[1]
    if pairing.friction:
        return np.asarray(relative)
    rows = contact.across(pairing.normal[pairing.candidate], 0)
    sizes, directions = np.linalg.eigh(rows.T @ rows)
    least = MIN_EXACT_COMPONENT if pairing.name in exact else MIN_NORMAL_COMPONENT
    return np.asarray(directions[:, sizes >= least**2].T @ relative)


def resistance(
    unknowns: Sequence[UnknownMotion],
    pairings: Sequence[Pairing],
    clouds: Mapping[str, Cloud],
    rows: Callable[[_Contact], FloatArray],
) -> FloatArray:
    """Mean squares (k, k) of the motions in the ``rows`` of directions that each contact resists."""
    total = np.diag([float(unknown.elastic) for unknown in unknowns])
    for pairing in pairings if unknowns else ():
        resisted = rows(_Contact(pairing, clouds, unknowns))
        total += resisted.T @ resisted
    return total
