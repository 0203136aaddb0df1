"""Assembly of bodies at finite strain with their loads and contacts."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property, partial

import numpy as np

from mlsanm_cli.app.finite.free_motions import driving, free_motions_of, pins_of, plated
from mlsanm_cli.app.scene.assemble import SceneModel
from mlsanm_cli.app.scene.boundaries import Boundaries
from mlsanm_cli.app.scene.contact_pairs import shape_of
from mlsanm_cli.app.scene.corners import ends_of
from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.case import Case, Displacement, Material, ObstacleMotion, Place, Platen, Pressure
from mlsanm_cli.case.checks.finite import pivot_of
from mlsanm_cli.cloud.cells import FINE, Halves
from mlsanm_cli.cloud.surface import Surface
from mlsanm_cli.contact.finite.free import DrivenObstacle, LooseMotions, Plate
from mlsanm_cli.contact.finite.pair import BodyContact
from mlsanm_cli.contact.finite.rigid import RigidContact
from mlsanm_cli.contact.finite.sides import ContactSide, with_more, with_sides
from mlsanm_cli.contact.finite.update import AnyContact
from mlsanm_cli.contact.geometry.pairing import Pairing
from mlsanm_cli.mechanics import scene as mechanics
from mlsanm_cli.mechanics.assembly import assemble
from mlsanm_cli.mechanics.body import ElasticBody
from mlsanm_cli.mechanics.finite.body import FiniteBody
from mlsanm_cli.mechanics.finite.law import Law
from mlsanm_cli.mechanics.finite.loads import FollowerPressure, Loads, Warming
from mlsanm_cli.mechanics.finite.projector import NO_ROWS, Projector, Weights
from mlsanm_cli.mechanics.heat import Field
from mlsanm_cli.mechanics.probes import Probe
from mlsanm_cli.operators.linear.interface import LinearSolver
from mlsanm_cli.solve.condensed_scene import stage_factors

TOUCH_TOLERANCE = 0.01
"""Initial gap to an obstacle, relative to the length of a node, below which the node touches."""
END_WEIGHT, END_NODES = 0.3, 4
"""Weight of the tractions near the ends of sides that friction holds up to their corners, relative to others,
and number of their nodes. Their error, where stresses are singular, would move the whole body: blocks with
friction on their whole top, compressed by 30 % with nu = 0.44 or sheared by a fifth, swayed when their
equations were renewed, and stopped at 0.46 to 0.9 of the path."""


@dataclass(frozen=True)
class FiniteScene:
    """``bodies`` by name with their loads, whose factors at the ends of stages are ``stages`` (T + 1, L).
    Further loads of the bodies are the motions (d,) of ``loose`` bodies, ``driven`` obstacles and
    ``plates``, then unit tractions x, y at the nodes of their sides in ``contacts``.

    ``supports`` names bodies and surfaces of every support and of every load that prescribes displacements.
    """

    case: Case
    bodies: Mapping[str, FiniteBody]
    stages: FloatArray
    supports: Mapping[str, tuple[tuple[str, str], ...]]
    probes: tuple[Probe, ...]
    solver: LinearSolver
    contacts: tuple[AnyContact, ...] = ()
    loose: tuple[LooseMotions, ...] = ()
    driven: tuple[DrivenObstacle, ...] = ()
    plates: tuple[Plate, ...] = ()

    @property
    def free(self) -> int:
        """Number d of unknown rigid motions: load factors after those of the case."""
        plates = sum(len(one.components) for one in self.plates)
        return sum(one.count for one in self.loose) + len(self.driven) + plates

    @property
    def in_increments(self) -> bool:
        """Whether the path is followed by increments: several bodies, contacts or unknown motions."""
        return bool(self.contacts or self.free) or len(self.bodies) > 1

    @property
    def by_series(self) -> bool:
        """Whether the path is followed by power series."""
        return not self.in_increments and self.case.solver.method != "newton"

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
        return max(float(np.ptp(body.elastic.model.nodes, axis=0).max()) for body in self.bodies.values())

    def parts(self, displacement: FloatArray) -> dict[str, FloatArray]:
        """Displacements (2N,) of all bodies divided by body."""
        ends = np.cumsum([body.unknowns for body in self.bodies.values()])[:-1]
        return dict(zip(self.bodies, np.split(displacement, ends), strict=True))

    def shown(self, displacement: FloatArray, surface: FloatArray) -> FloatArray:
        """Displacements (2N,) of all bodies with those of the ``surface`` (2s,) at the nodes of sides in
        contact: clouds by themselves represent tractions that alternate from node to node wrongly."""
        found, first = displacement.copy(), 0
        own = self.parts(found)
        for side in (one for contact in self.contacts for one in contact.sides):
            last = first + 2 * side.count
            own[side.body].reshape(-1, 2)[side.nodes] = surface[first:last].reshape(-1, 2)
            first = last
        return found

    def acting(self, factors: FloatArray, traction: FloatArray) -> dict[str, FloatArray]:
        """Factors of all loads by body: ``factors`` (L + d,) of the case and of the free motions, then the
        body's part of the ``traction`` (2s,) at the nodes of all sides in contact."""
        found, first = {name: [factors] for name in self.bodies}, 0
        for contact in self.contacts:
            for side in contact.sides:
                found[side.body].append(traction[first : first + 2 * side.count])
                first += 2 * side.count
        return {name: np.concatenate(some) for name, some in found.items()}

    @cached_property
    def weights(self) -> Mapping[str, Weights]:
        """Weights of the equations of the bodies, constant over the path."""
        found = {}
        for name, body in self.bodies.items():
            sides = [side for contact in self.contacts for side in contact.sides if side.body == name]
            rows = [side.corner_rows(body.elastic) for side in sides]
            found[name] = Weights.of(body, np.concatenate([NO_ROWS, *rows]))
            for side in self.upright.get(name, ()):
                number = np.arange(side.count)
                ends = number[np.minimum(number, side.count - 1 - number) < END_NODES]
                found[name].nodes[side.traction_rows(body.elastic, ends)] *= END_WEIGHT
        return found

    @cached_property
    def upright(self) -> Mapping[str, list[ContactSide]]:
        """Sides, by body, that initially touch an obstacle with friction up to both corners; only of bodies
        that are not loose."""
        found: dict[str, list[ContactSide]] = {}
        loose = {one.body for one in self.loose if one.count}
        for contact in self.contacts:
            side = contact.slave
            if not isinstance(contact, RigidContact) or not contact.friction or side.body in loose:
                continue
            gap = contact.seen(side.places, side.outward, np.zeros(contact.motion.shape[1]))[0]
            if None not in side.wedges and (gap < TOUCH_TOLERANCE * side.weight)[[0, -1]].all():
                found.setdefault(side.body, []).append(side)
        return found

    def projector(
        self, name: str, displacement: FloatArray, factors: FloatArray, keeps: bool = False
    ) -> Projector:
        """A body's equations by the rows of a state of it, its pins turned as it is there. If they are told
        so, and always for bodies that friction holds up to corners, they keep what their rows are left with
        there, so that no new equations move the body."""
        body = self.bodies[name]
        if body.pins:
            body = replace(body, angle=body.turn(displacement))
        args = (body, self.weights[name], displacement, factors, self.solver)
        return Projector.at(*args, keeps=keeps or name in self.upright)


def finite_scene(case: Case, prepared: SceneModel) -> FiniteScene:
    """Assemble a checked scene at finite strain."""
    solver = case.solver.linear
    loose, driven, plates = free_motions_of(case, prepared)
    free = sum(one.count for one in loose) + len(driven) + sum(len(one.components) for one in plates)
    contacts = tuple(_contact(case, prepared, one, free) for one in prepared.pairings)
    contacts = tuple(driving(one, number, driven, len(case.moved)) for number, one in enumerate(contacts))
    bodies, first = {}, len(case.moved)
    for name, model in prepared.models.items():
        pinned, moves = pins_of(prepared, name, loose)
        loose = tuple(replace(one, moves=moves) if one.body == name else one for one in loose)
        held_nodes = (*prepared.held_nodes[name], *pinned)
        # Pins rotate with bodies that may rotate; those of others prevent the rotation.
        turning = len(pinned) if moves.shape[0] == moves.shape[1] else 0
        springs = prepared.acting.springs[name]
        elastic = assemble(model, prepared.held[name], held_nodes, solver, springs, unloaded=turning)
        sides = [side for contact in contacts for side in contact.sides if side.body == name]
        loads = plated(name, elastic, plates, with_more(_loads(case, prepared, name, elastic), free))
        if moves.shape[1]:
            # The rows of the pins are the last ones of single nodes.
            last = elastic.rows - 3 * elastic.pieces.count
            loads.sources[last - len(pinned) : last, first : first + moves.shape[1]] = moves
            first += moves.shape[1]
        law, loads = law_of(case, name), with_sides(loads, elastic, sides)
        bodies[name] = FiniteBody(elastic, law, loads, turning)
    supports = _supports(case, prepared.boundaries)
    args = (stage_factors(case), supports, prepared.probes, solver, contacts, loose, driven)
    return FiniteScene(case, bodies, *args, plates)


def _contact(case: Case, prepared: SceneModel, pairing: Pairing, free: int) -> AnyContact:
    """Contact of a side with that of another body or a rigid obstacle; ``free`` is the number of free
    motions."""
    found = next(one for one in case.contact if one.name == pairing.name)
    slave = _side(prepared, pairing.slave_body, pairing.slave)
    if pairing.master is not None:
        assert pairing.master_body is not None
        master = _side(prepared, pairing.master_body, pairing.master)
        return BodyContact(pairing.name, slave, master, pairing.friction, pairing.exchanged)
    assert found.obstacle is not None
    count = len(case.moved)
    motion, rotation, pivot = np.zeros((2, count + free)), np.zeros(count + free), (0.0, 0.0)
    for number, load in enumerate(case.load):
        if isinstance(load, ObstacleMotion) and load.obstacle == pairing.name and load.rotation:
            rotation[number], pivot = load.rotation, pivot_of(found.obstacle, load) or pivot
    for constraint in prepared.rigid_constraints:
        if isinstance(constraint, mechanics.Obstacle) and constraint.contact == pairing.name:
            for one in constraint.motions:
                if one.prescribed is not None:
                    motion[one.component, :count] += one.prescribed
    moved = (motion, pairing.friction, rotation, np.array(pivot))
    return RigidContact(pairing.name, slave, shape_of(found.obstacle), *moved)


def _side(prepared: SceneModel, body: str, surface: Surface) -> ContactSide:
    nodes = [node for node, _ in prepared.held_nodes[body]]
    model, held = prepared.models[body], prepared.held[body]
    wedges = ends_of(model, surface, {**held, **dict.fromkeys(prepared.acting.springs[body])})
    return ContactSide.of(body, model.cloud, surface, held, nodes, wedges)


def material_of(case: Case, body: str) -> Material:
    """Material of a body."""
    return case.material[next(one.material for one in case.body if one.name == body)]


def law_of(case: Case, body: str) -> Law:
    """Finite-strain law of a body."""
    material = material_of(case, body)
    assert material.law != "linear"
    assert material.E is not None
    assert material.nu is not None
    return Law.isotropic(material.law, material.E, material.nu, case.model.plane)


def _supports(case: Case, boundaries: Boundaries) -> dict[str, tuple[tuple[str, str], ...]]:
    """Bodies and surfaces by the label of a support or the name of a load that prescribes displacements."""
    found: dict[str, tuple[Place, ...]] = {
        s.place.label: (s.place,) for s in case.support if s.place is not None
    }
    found |= {load.name: (load.place,) for load in case.load if isinstance(load, Displacement)}
    found |= {load.name: tuple(load.places) for load in case.load if isinstance(load, Platen)}
    return {
        label: tuple((place.body, name) for place in places for name in boundaries.names(place))
        for label, places in found.items()
    }


def _loads(case: Case, prepared: SceneModel, name: str, body: ElasticBody) -> Loads:
    """All loads on a body."""
    count = len(case.moved)
    sources = np.zeros((body.rows, count))
    tractions: dict[str, FloatArray] = {}
    pressing: list[FollowerPressure] = []
    for load in prepared.acting.surface_loads:
        if load.body != name:
            continue
        given, surface = case.load[load.number], body.model.cloud.surfaces[load.surface]
        if isinstance(given, Pressure) and given.follows:
            assert load.between is not None
            normals = surface.curve.normals(Halves.of(surface, FINE).arc)
            nodal = -(load.values * surface.normal).sum(axis=1)
            between = -(load.between * normals).sum(axis=1)
            pressing.append(FollowerPressure(load.number, load.surface, nodal, between))
            continue
        sources[:, load.number] += body.source(load.surface, load.values, load.held)
        if load.between is not None:
            shape = (*load.between.shape, count)
            tractions.setdefault(load.surface, np.zeros(shape))[:, :, load.number] += load.between
    force = _force(prepared, name, len(body.model.cloud.points), count)
    if force is not None:
        sources[: force[:, :, 0].size] -= force.transpose(1, 0, 2).reshape(-1, count)
    return Loads(count, sources, tractions, force, tuple(pressing), warming=warming_of(case, prepared, name))


def warming_of(case: Case, prepared: SceneModel, name: str) -> tuple[Warming, ...]:
    """Thermal strains of a body."""
    alpha = material_of(case, name).alpha
    return tuple(
        Warming(one.number, float(alpha) * one.values, partial(_expansion, float(alpha), one.field))
        for one in prepared.acting.heatings
        if one.body == name and isinstance(alpha, float)
    )


def _expansion(alpha: float, field: Field, points: FloatArray) -> FloatArray:
    return np.asarray(alpha * field.at(points))


def _force(prepared: SceneModel, name: str, nodes: int, count: int) -> FloatArray | None:
    """Body force (n, 2, L) per volume, if there is any."""
    own = [load for load in prepared.acting.body_forces if load.body == name]
    if not own:
        return None
    force = np.zeros((nodes, 2, count))
    for load in own:
        force[:, :, load.number] += load.values
    return force
