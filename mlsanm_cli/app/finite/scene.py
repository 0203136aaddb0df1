"""Assembly of bodies at finite strain with their loads and contacts."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import field, replace
from functools import cached_property

import numpy as np

from mlsanm_cli.app.scene.assemble import SceneModel
from mlsanm_cli.app.scene.contact_pairs import shape_of
from mlsanm_cli.app.scene.corners import ends_of, void_center
from mlsanm_cli.app.scene.materials import laws_of
from mlsanm_cli.arrays import FloatArray, IntArray
from mlsanm_cli.case import Case, Displacement, ObstacleMotion, Platen, Pressure
from mlsanm_cli.cloud.cells import FINE, Halves
from mlsanm_cli.cloud.surface import Surface
from mlsanm_cli.contact.finite.contacts import (
    AnyContact,
    Contacts,
    DrivenObstacle,
    LooseMotions,
    Plate,
    ranges,
)
from mlsanm_cli.contact.finite.pair import BodyContact, Meeting, RigidContact
from mlsanm_cli.contact.finite.side_response import Compliance, rotated
from mlsanm_cli.contact.finite.sides import ContactSide, SideNodes
from mlsanm_cli.mechanics.assembly import assemble
from mlsanm_cli.mechanics.body import ElasticBody
from mlsanm_cli.mechanics.finite.body import FiniteBody
from mlsanm_cli.mechanics.finite.loads import Loads, Turning
from mlsanm_cli.mechanics.finite.projector import NO_ROWS, Projector, weights_of
from mlsanm_cli.mechanics.finite.stability import Loaded
from mlsanm_cli.mechanics.near_field import as_complex
from mlsanm_cli.mechanics.rigid import ROTATION, free_motions, pins
from mlsanm_cli.mechanics.scene import Probe
from mlsanm_cli.operators.factors import LinearSolver
from mlsanm_cli.records import dataclass
from mlsanm_cli.solve.condensed_scene import stage_factors
from mlsanm_cli.solve.state import State

TOUCH_TOLERANCE = 0.01
"""Initial gap to an obstacle, relative to the length of a node, below which the node touches."""
END_WEIGHT, END_NODES = 0.3, 4
"""Weight of the tractions near the ends of sides that friction holds up to their corners, relative to others,
and number of their nodes. Their error, where stresses are singular, would move the whole body."""


@dataclass(frozen=True)
class FiniteScene:
    """``bodies`` by name with their loads, whose factors at the ends of stages are ``stages`` (T + 1, L), the
    unknown motions (d,) of ``contacts``, and unit tractions x, y at the nodes of their sides. ``supports``
    names bodies and surfaces of every support and of every load that prescribes displacements. If the path is
    followed by increments, ``undeformed`` are the equations of the bodies before loading, and ``compliances``
    what they answer on the sides in contact. Up to the position ``located`` of the path the knots are as fine
    as its contacts need."""

    case: Case
    bodies: Mapping[str, FiniteBody]
    stages: FloatArray
    supports: Mapping[str, tuple[tuple[str, str], ...]]
    probes: tuple[Probe, ...]
    solver: LinearSolver
    contacts: Contacts
    undeformed: Mapping[str, Projector] = field(default_factory=dict)
    compliances: Sequence[Compliance] = ()
    located: float = np.inf

    @property
    def in_increments(self) -> bool:
        """Whether the path is followed by increments: several bodies, contacts or unknown motions."""
        return bool(self.contacts.pairs or self.contacts.free) or len(self.bodies) > 1

    @property
    def alone(self) -> tuple[str, FiniteBody]:
        """Name and body of a scene with one body."""
        ((name, body),) = self.bodies.items()
        return name, body

    @property
    def unknowns(self) -> int:
        """Number 2N of displacements of all bodies."""
        return sum(body.unknowns for body in self.bodies.values())

    @property
    def size(self) -> float:
        """Largest extent of a body."""
        clouds = (body.elastic.model.cloud.points for body in self.bodies.values())
        return max(float(np.ptp(points, axis=0).max()) for points in clouds)

    @property
    def undeformed_contacts(self) -> Meeting:
        """The contacts before loading."""
        contacts = self.contacts
        return contacts.meet(np.zeros(contacts.size), np.append(self.stages[0], np.zeros(contacts.free)))

    def parts(self, displacement: FloatArray) -> dict[str, FloatArray]:
        """Displacements (2N,) of all bodies divided by body."""
        places = ranges(body.unknowns for body in self.bodies.values())
        return {name: displacement[place] for name, place in zip(self.bodies, places, strict=True)}

    def shown(self, state: State) -> FloatArray:
        """Displacements (2N,) of all bodies with near fields, which clouds by themselves do not resolve."""
        displacement = state.displacement.copy()
        bodies, cloud = self.parts(displacement), self.parts(state.displacement)
        surfaces = [state.solver["surface"][there] for _, there in self.contacts.sides]
        both = list(zip(self.contacts.sides, surfaces, strict=True))
        for ((side, there), surface), inside in zip(both, self._inside, strict=True):
            traction = state.side_traction[there]
            if traction.any():
                turns, turn = self.bodies[side.body].turns(cloud[side.body]), side.deformed(surface)[0]
                bodies[side.body] += rotated(inside, turns, turn / np.abs(turn)) @ traction
        for (side, _), surface in both:
            onto = side.curve.rows(side.nodes.arc)[0]
            bodies[side.body].reshape(-1, 2)[side.nodes.index] = onto @ surface.reshape(-1, 2)
        return displacement

    @cached_property
    def _inside(self) -> list[FloatArray]:
        """What clouds miss of the responses (2N, 2g) of bodies to the tractions of each side."""
        both = zip(self.compliances, self.contacts.sides, strict=True)
        return [compliance.inside(side) for compliance, (side, _) in both]

    def acting(self, factors: FloatArray, traction: FloatArray) -> dict[str, FloatArray]:
        """Factors of all loads by body: ``factors`` (L + d,) of the case and of the free motions, then the
        body's part of the ``traction`` (2s,) at the knots of all sides in contact."""
        return {
            name: np.concatenate([factors, self.contacts.spread(name) @ traction]) for name in self.bodies
        }

    def loaded(self, state: State) -> dict[str, Loaded]:
        """The bodies with their displacements and load factors in a state."""
        acting, parts = self.acting(state.driven, state.side_traction), self.parts(state.displacement)
        return {name: (body, parts[name], acting[name]) for name, body in self.bodies.items()}

    @cached_property
    def weights(self) -> Mapping[str, FloatArray]:
        """Weights (r,) of the equations of the bodies, constant over the path."""
        found = {}
        for name, body in self.bodies.items():
            left_out = [NO_ROWS]
            for side in (one.nodes for one, _ in self.contacts.sides if one.body == name):
                # The other side of a corner has another traction, and no finite stress matches both.
                ends = zip((0, side.count - 1), side.wedges, strict=True)
                corners = [end for end, wedge in ends if wedge is not None]
                left_out.append(side.traction_rows(body.elastic, corners))
            found[name] = weights_of(body, np.concatenate(left_out))
            for side in self.upright.get(name, ()):
                near = [*range(END_NODES), *range(side.count - END_NODES, side.count)]
                found[name][side.traction_rows(body.elastic, near)] *= END_WEIGHT
        return found

    @cached_property
    def upright(self) -> Mapping[str, list[SideNodes]]:
        """Sides of held bodies that initially touch an obstacle with friction up to both corners."""
        found: dict[str, list[SideNodes]] = {}
        loose = {one.body for one in self.contacts.loose if one.components}
        for contact in self.contacts.pairs:
            side = contact.slave.nodes
            if not isinstance(contact, RigidContact) or not contact.friction or side.body in loose:
                continue
            gap = contact.seen(side.places, side.outward, np.zeros(contact.motion.shape[1]))[0]
            if None not in side.wedges and (gap < TOUCH_TOLERANCE * side.weight)[[0, -1]].all():
                found.setdefault(side.body, []).append(side)
        return found

    def projector(
        self, name: str, displacement: FloatArray, factors: FloatArray, keeps: bool = False
    ) -> Projector:
        """A body's equations by the rows of a state, its pins rotated with it. With ``keeps``, and always for
        bodies that friction holds up to corners, the equations keep the residual of that state, so that new
        equations do not move the body."""
        body = self.bodies[name]
        if body.pins:
            body = body.rotated(body.turn(displacement))
        args = (body, self.weights[name], displacement, factors, self.solver)
        return Projector(*args, keeps=keeps or name in self.upright)


def finite_scene(case: Case, prepared: SceneModel) -> FiniteScene:
    """Assemble a checked scene at finite strain."""
    solver, boundaries = case.solver.linear, prepared.boundaries
    contacts = unknown_motions(case, prepared)
    pairs = tuple(_contact(case, prepared, number, contacts) for number in range(len(prepared.pairings)))
    contacts, loose = replace(contacts, pairs=pairs), {one.body: one for one in contacts.loose}
    bodies, laws = {}, laws_of(case)
    for name, model in prepared.models.items():
        own = loose.get(name)
        pinned = own.pins if own is not None else ()
        held_nodes = (*prepared.held_nodes[name], *pinned)
        # Pins rotate with bodies that may rotate; those of others prevent the rotation.
        turning = len(pinned) if own is not None and len(pinned) == len(own.components) else 0
        springs = prepared.acting.springs[name]
        elastic = assemble(model, prepared.held[name], held_nodes, solver, springs, unloaded=turning)
        loads = _loads(case, prepared, name, elastic, contacts)
        if own is not None:
            # The rows of the pins are the last ones of single nodes.
            last = elastic.rows - 3 * elastic.pieces.count
            rows = np.arange(last - len(pinned), last)
            loads.sources[np.ix_(rows, len(case.moved) + own.numbers)] = own.moves
        bodies[name] = FiniteBody(elastic, laws[name], loads, turning)
    # By the label of a support or the name of a load that prescribes displacements.
    held = {one.place.label: [one.place] for one in case.support if one.place is not None}
    for kind in (Displacement, Platen):
        held |= {load.name: list(load.places) for load in case.load if isinstance(load, kind)}
    supports = {
        label: tuple((place.body, name) for place in places for name in boundaries.names[place])
        for label, places in held.items()
    }
    scene = FiniteScene(case, bodies, stage_factors(case), supports, prepared.probes, solver, contacts)
    if not scene.in_increments:
        return scene
    still = scene.parts(np.zeros(scene.unknowns))
    acting = scene.acting(np.append(scene.stages[0], np.zeros(contacts.free)), np.zeros(contacts.size))
    projectors = {name: scene.projector(name, still[name], acting[name]) for name in bodies}
    found, first = [], dict.fromkeys(bodies, scene.stages.shape[1] + contacts.free)
    for side, _ in contacts.sides:
        found.append(Compliance(side.nodes, projectors[side.body], first[side.body]))
        first[side.body] += 2 * side.nodes.count
    return replace(scene, undeformed=projectors, compliances=found)


def _contact(case: Case, prepared: SceneModel, number: int, motions: Contacts) -> AnyContact:
    """Contact ``number``, with another body or a rigid obstacle, with its unknown motions."""
    pairing = prepared.pairings[number]
    found = next(one for one in case.contact if one.name == pairing.name)
    slave = _side(prepared, pairing.slave_body, pairing.slave)
    if pairing.master is not None:
        assert pairing.master_body is not None
        master = _side(prepared, pairing.master_body, pairing.master)
        return BodyContact(pairing.name, slave, master, pairing.friction, pairing.exchanged)
    assert found.obstacle is not None
    count, pivot = len(case.moved), (0.0, 0.0)
    motion, rotation = np.zeros((2, count + motions.free)), np.zeros(count + motions.free)
    for place, load in enumerate(case.load):
        if isinstance(load, ObstacleMotion) and load.obstacle == pairing.name and load.rotation:
            rotation[place], pivot = load.rotation, load.pivot_on(found.obstacle) or pivot
    for driven in (one for one in motions.driven if one.contact == number):
        motion[driven.component, count + driven.number] = 1.0
    for constraint in prepared.restrained.rigid_constraints:
        if not constraint.bodies and constraint.name == pairing.name:
            for one in constraint.motions:
                if one.prescribed is not None:
                    motion[one.component, :count] += one.prescribed
    moved = (motion, pairing.friction, rotation, np.array(pivot))
    return RigidContact(pairing.name, slave, shape_of(found.obstacle), *moved)


def _side(prepared: SceneModel, body: str, surface: Surface) -> ContactSide:
    """A side, with its knots at the nodes."""
    model, held, curve = prepared.models[body], prepared.held[body], surface.curve
    planes, wedges = ends_of(model, surface, {**held, **dict.fromkeys(prepared.acting.springs[body])})
    places, inward = model.cloud.points[surface.index], -as_complex(surface.normal)
    fixed = np.zeros(len(model.cloud.points), dtype=bool)
    for name, components in held.items():
        fixed[model.cloud.surfaces[name].index] |= any(components)
    fixed[[node for node, _ in prepared.held_nodes[body]]] = True
    corners = {int(np.argmin(np.abs(surface.arc_length - one))) for one in curve.corners}
    nodes = SideNodes(
        body=body,
        places=places,
        outward=surface.normal,
        weight=surface.weight,
        arc=surface.arc_length,
        around=curve.length if curve.closed else None,
        held=fixed[surface.index],
        corners=tuple(sorted(corners if curve.closed else {*corners, 0, len(places) - 1})),
        planes=planes,
        wedges=wedges,
        geometry=curve,
        index=surface.index,
        members=tuple((part.name, numbers) for part, numbers in surface.members),
        centers=void_center(model.cloud, as_complex(places), inward),
    )
    return ContactSide.on(nodes, nodes.arc)


def _loads(case: Case, prepared: SceneModel, name: str, body: ElasticBody, contacts: Contacts) -> Loads:
    """All loads on a body: of the case, of free motions, and unit tractions on its sides in contact."""
    known, places, surfaces = len(case.moved), body.model.cloud.points, body.model.cloud.surfaces
    sides, first = [side.nodes for side, _ in contacts.sides if side.body == name], known + contacts.free
    count = first + 2 * sum(side.count for side in sides)
    sources = np.zeros((body.rows, count))
    tractions: dict[str, FloatArray] = {}
    pressing: dict[str, tuple[FloatArray, FloatArray]] = {}
    for load in (one for one in prepared.acting.surface_loads if one.body == name):
        given, surface = case.load[load.number], surfaces[load.surface]
        if isinstance(given, Pressure) and given.follows:
            assert load.between is not None
            normals = surface.curve.normals(Halves.of(surface, FINE).arc)
            none = np.zeros((len(load.values), count)), np.zeros((len(normals), count))
            nodal, between = pressing.setdefault(load.surface, none)
            nodal[:, load.number] -= (load.values * surface.normal).sum(axis=1)
            between[:, load.number] -= (load.between * normals).sum(axis=1)
            continue
        sources[:, load.number] += body.source(load.surface, load.values, load.held)
        if load.between is not None:
            shape = (*load.between.shape, count)
            tractions.setdefault(load.surface, np.zeros(shape))[:, :, load.number] += load.between
    acting = [one for one in prepared.acting.body_forces if one.body == name]
    force = np.zeros((len(places), 2, count)) if acting else None
    if force is not None:
        for one in acting:
            force[:, :, one.number] += one.values
        sources[: force[:, :, 0].size] -= force.transpose(1, 0, 2).reshape(-1, count)
    turning = []
    for plate in (one for one in contacts.plates if name in one.surfaces):
        for held in plate.surfaces[name]:
            arms = places[surfaces[held].index] - plate.center
            for component in np.flatnonzero(body.held[held]).tolist():
                rows = body.condition_rows(held, component)
                sources[rows, : known + contacts.free] += plate.motion[component]
                if plate.motion[2].any():
                    rate = np.append(plate.motion[2], np.zeros(count - known - contacts.free))
                    turning.append(Turning(rate, component, rows, arms))
    for side in sides:
        side.add_unit_tractions(body, first, sources, tractions)
        first += 2 * side.count
    expands = body.model.material.free_expansion.any()
    warming = tuple(heat for heat in prepared.acting.heatings if heat.body == name and expands)
    return Loads(count, sources, tractions, force, pressing, warming=warming, turning=turning)


def unknown_motions(case: Case, prepared: SceneModel) -> Contacts:
    """Unknown rigid motions: of loose bodies in the order of all bodies, then obstacles, then plates."""
    known, number = prepared.restrained.rigid_constraints, 0
    floating = {one.name: one for one in known if one.floats}
    ordered = [floating[name] for name in prepared.models if name in floating]
    ordered += [one for one in known if not one.bodies] + [one for one in known if one.held]
    loads, names = len(case.moved), [pairing.name for pairing in prepared.pairings]
    count = loads + sum(motion.prescribed is None for one in ordered for motion in one.motions)
    loose, driven, plates = list[LooseMotions](), list[DrivenObstacle](), list[Plate]()
    for constraint in ordered:
        unknown = [one for one in constraint.motions if one.prescribed is None]
        components, numbers = tuple(one.component for one in unknown), number + np.arange(len(unknown))
        extents = [np.ptp(prepared.models[body].cloud.points, axis=0).max() for body in constraint.bodies]
        size = float(max(extents, default=0.0))
        if constraint.floats:
            loose.append(_pinned(prepared, constraint.name, components, numbers, size))
        elif not constraint.bodies:
            for k, one in enumerate(unknown, number):
                driven.append(DrivenObstacle(names.index(constraint.name), one.component, k, one.force))
        else:
            motion, force = np.zeros((3, count)), np.zeros((3, loads))
            for k, one in enumerate(unknown, loads + number):
                motion[one.component, k] = 1.0 / size if one.component == ROTATION else 1.0
                force[one.component] = one.force
            for one in constraint.motions:
                if one.prescribed is not None:
                    motion[one.component, :loads] = one.prescribed
            surfaces = {body: constraint.surfaces_of(body) for body in constraint.bodies}
            place = np.array(constraint.center), size, components, numbers
            plates.append(Plate(constraint.name, surfaces, constraint.loads, *place, force, motion))
        number += len(unknown)
    return Contacts((), tuple(loose), tuple(driven), tuple(plates))


def _pinned(
    prepared: SceneModel, name: str, unknown: tuple[int, ...], numbers: IntArray, size: float
) -> LooseMotions:
    """A loose body of this ``size`` with ``unknown`` motions, its unknowns ``numbers``, and its pins."""
    cloud, anchors = prepared.models[name].cloud, tuple(prepared.held_nodes[name])
    free = free_motions(cloud, prepared.held[name], anchors, prepared.acting.springs[name])
    # Inside: on a side in contact a pin would have no field in closed form.
    outer = np.concatenate([surface.index for surface in cloud.surfaces.values()])
    inner = np.setdiff1d(np.arange(len(cloud.points)), outer)
    pinned = tuple((int(inner[node]), component) for node, component in pins(cloud.points[inner], free))
    places = [2 * node + component for node, component in pinned]
    scale = np.array([size if one == ROTATION else 1.0 for one in free.components])
    known = [free.components.index(component) for component in unknown]
    moves = (free.patterns(cloud.points)[places] / scale)[:, known]
    return LooseMotions(name, unknown, numbers, size, anchors, pinned, moves)
