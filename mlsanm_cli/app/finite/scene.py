"""From a case and its clouds to a body at finite strain with its loads."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from mlsanm_cli.app.scene.assemble import SceneModel
from mlsanm_cli.app.scene.contact_pairs import shape_of
from mlsanm_cli.app.scene.direct_solver import direct_solver
from mlsanm_cli.app.scene.surfaces import surfaces_at
from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.case import Case, Displacement, Platen, Pressure
from mlsanm_cli.cloud.cells import FINE, Halves
from mlsanm_cli.contact.finite.loads import with_contacts
from mlsanm_cli.contact.finite.rigid import RigidContact
from mlsanm_cli.contact.geometry.pairing import Pairing
from mlsanm_cli.mechanics import scene as mechanics
from mlsanm_cli.mechanics.assembly import assemble
from mlsanm_cli.mechanics.body import ElasticBody
from mlsanm_cli.mechanics.finite.body import FiniteBody
from mlsanm_cli.mechanics.finite.law import Law
from mlsanm_cli.mechanics.finite.loads import Loads, Pressing
from mlsanm_cli.mechanics.finite.projector import Projector, Weights
from mlsanm_cli.mechanics.probes import Probe
from mlsanm_cli.operators.linear.interface import DirectSolver
from mlsanm_cli.solve.load_factors import stage_factors


@dataclass(frozen=True)
class FiniteScene:
    """A ``body`` called ``name`` with its loads, which move from stage to stage: ``stages`` (T + 1, L). The
    body's last loads, beyond these, are unit tractions x, y at the nodes of the ``contacts`` in turn.

    ``supports`` names the surfaces of every support and of every load that holds a displacement.
    """

    case: Case
    name: str
    body: FiniteBody
    stages: FloatArray
    supports: dict[str, tuple[str, ...]]
    probes: tuple[Probe, ...]
    solver: DirectSolver
    contacts: tuple[RigidContact, ...] = ()

    @property
    def points(self) -> FloatArray:
        """The body's nodes (n, 2) before loading."""
        return self.body.elastic.model.cloud.points

    @cached_property
    def weights(self) -> Weights:
        """The weights of the rows, for the whole path."""
        return Weights.of(self.body)

    def projector(self, displacement: FloatArray, factors: FloatArray) -> Projector:
        """The equations by the rows of a state."""
        return Projector.at(self.body, self.weights, displacement, factors, self.solver)


def finite_scene(case: Case, prepared: SceneModel) -> FiniteScene:
    """Take over clouds, conditions and loads of a scene that :func:`refuse_unsupported` has let pass."""
    name, model = next(iter(prepared.models.items()))
    solver = direct_solver(case)
    elastic = assemble(model, prepared.held[name], prepared.held_nodes[name], solver)
    contacts = tuple(_contact(case, prepared, one) for one in prepared.pairings)
    loads = with_contacts(_loads(case, prepared, elastic), elastic, contacts)
    body = FiniteBody(elastic, law_of(case, name), loads)
    supports = _supports(case)
    return FiniteScene(case, name, body, stage_factors(case), supports, prepared.probes, solver, contacts)


def _contact(case: Case, prepared: SceneModel, pairing: Pairing) -> RigidContact:
    """A side of the body against a rigid obstacle."""
    slave = pairing.slave
    found = next(one for one in case.contact if one.name == pairing.name)
    assert found.obstacle is not None
    motion = np.zeros((2, len(case.moved)))
    for mover in prepared.rigid_constraints:
        if isinstance(mover, mechanics.Obstacle) and mover.contact == pairing.name:
            for one in mover.motions:
                assert one.prescribed is not None
                motion[one.component] += one.prescribed
    places = prepared.models[pairing.slave_body].cloud.points[slave.index]
    shape = shape_of(found.obstacle)
    args = (slave.index, places, slave.normal, slave.weight, slave.arc_length)
    return RigidContact(pairing.name, slave.name, *args, shape, motion)


def law_of(case: Case, body: str) -> Law:
    """The law of a body of a case at finite strain."""
    material = case.material[next(one.material for one in case.body if one.name == body)]
    assert material.law != "linear"
    assert material.E is not None
    assert material.nu is not None
    return Law.isotropic(material.law, material.E, material.nu, case.model.plane)


def _supports(case: Case) -> dict[str, tuple[str, ...]]:
    """Surfaces by the label of a support, or by the name of a load that holds displacements."""
    found = {s.place.label: surfaces_at(case, s.place) for s in case.support if s.place is not None}
    held = [load for load in case.load if isinstance(load, Displacement | Platen)]
    return found | {load.name: surfaces_at(case, load.place) for load in held}


def _loads(case: Case, prepared: SceneModel, body: ElasticBody) -> Loads:
    """All that acts, by load number."""
    count = len(case.moved)
    sources = np.zeros((body.rows, count))
    tractions: dict[str, FloatArray] = {}
    pressing: list[Pressing] = []
    for load in prepared.acting.surface_loads:
        given, surface = case.load[load.number], body.model.cloud.surfaces[load.surface]
        if isinstance(given, Pressure) and given.follows:
            assert load.between is not None
            normals = surface.curve.normals(Halves.of(surface, FINE).arc)
            nodal = -(load.values * surface.normal).sum(axis=1)
            between = -(load.between * normals).sum(axis=1)
            pressing.append(Pressing(load.number, load.surface, nodal, between))
            continue
        sources[:, load.number] += body.source(load.surface, load.values, load.held)
        if load.between is not None:
            shape = (*load.between.shape, count)
            tractions.setdefault(load.surface, np.zeros(shape))[:, :, load.number] += load.between
    for mover in prepared.rigid_constraints:
        if isinstance(mover, mechanics.Platen):
            _move(mover, body, sources)
    force = _force(prepared, len(body.model.cloud.points), count)
    if force is not None:
        sources[: force[:, :, 0].size] -= force.transpose(1, 0, 2).reshape(-1, count)
    return Loads(count, sources, tractions, force, tuple(pressing))


def _move(platen: mechanics.Platen, body: ElasticBody, sources: FloatArray) -> None:
    """Add what a platen prescribes to the right-hand sides ``sources`` (r, L)."""
    points = body.model.cloud.points
    for motion in platen.motions:
        assert motion.prescribed is not None
        for name in platen.surfaces:
            pattern = platen.pattern(body.model.cloud.surfaces[name], points, motion.component)
            sources += np.outer(body.source(name, pattern, held=True), motion.prescribed)


def _force(prepared: SceneModel, nodes: int, count: int) -> FloatArray | None:
    """The body force (n, 2, L), if there is any."""
    if not prepared.acting.body_forces:
        return None
    force = np.zeros((nodes, 2, count))
    for load in prepared.acting.body_forces:
        force[:, :, load.number] += load.values
    return force
