"""From a case and its clouds to a body at finite strain with its loads."""

from __future__ import annotations

from functools import cached_property

import numpy as np

from mlsanm_cli.app.linear import direct_solver
from mlsanm_cli.app.scene import Prepared
from mlsanm_cli.app.stages import stage_factors
from mlsanm_cli.app.surfaces import surfaces_at
from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.case import Case, Displacement, Platen, Pressure
from mlsanm_cli.cloud.cells import FINE, Halves
from mlsanm_cli.errors import CaseError, CaseProblem
from mlsanm_cli.mechanics import scene as mechanics
from mlsanm_cli.mechanics.assembly import assemble
from mlsanm_cli.mechanics.body import ElasticBody
from mlsanm_cli.mechanics.finite.body import FiniteBody
from mlsanm_cli.mechanics.finite.law import Law
from mlsanm_cli.mechanics.finite.loads import Loads, Pressing
from mlsanm_cli.mechanics.finite.projector import Projector, Weights
from mlsanm_cli.mechanics.probes import Probe
from mlsanm_cli.operators.linear.interface import DirectSolver
from mlsanm_cli.values import dataclass


@dataclass(frozen=True)
class FiniteScene:
    """A ``body`` called ``name`` with its loads, which move from stage to stage: ``stages`` (T + 1, L).

    ``supports`` names the surfaces of every support and of every load that holds a displacement.
    """

    case: Case
    name: str
    body: FiniteBody
    stages: FloatArray
    supports: dict[str, tuple[str, ...]]
    probes: tuple[Probe, ...]
    solver: DirectSolver

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


def finite_scene(case: Case, prepared: Prepared) -> FiniteScene:
    """Take over clouds, conditions and loads. Raises CaseError for a body that can move freely."""
    name, model = next(iter(prepared.models.items()))
    loose = [mover for mover in prepared.movers if isinstance(mover, mechanics.LooseBody)]
    if loose:
        message = f"body {name} can move freely, which finite strain does not support yet"
        raise CaseError((CaseProblem("support", message, hint="hold it with a [[support]]"),))
    solver = direct_solver(case)
    elastic = assemble(model, prepared.held[name], prepared.held_nodes[name], solver)
    body = FiniteBody(elastic, law_of(case, name), _loads(case, prepared, elastic))
    return FiniteScene(case, name, body, stage_factors(case), _supports(case), prepared.probes, solver)


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


def _loads(case: Case, prepared: Prepared, body: ElasticBody) -> Loads:
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
    for mover in prepared.movers:
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


def _force(prepared: Prepared, nodes: int, count: int) -> FloatArray | None:
    """The body force (n, 2, L), if there is any."""
    if not prepared.acting.body_forces:
        return None
    force = np.zeros((nodes, 2, count))
    for load in prepared.acting.body_forces:
        force[:, :, load.number] += load.values
    return force
