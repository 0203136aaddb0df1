"""Results of a state at finite strain: fields, probes, and forces of loads, supports and contacts."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from mlsanm_cli.app.finite.scene import FiniteScene
from mlsanm_cli.app.output.parts import contact_figures
from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.case import Displacement, ObstacleMotion, Platen
from mlsanm_cli.cloud.membership import cross
from mlsanm_cli.contact.finite.pair import NO_GAP, BodyContact, RigidContact
from mlsanm_cli.contact.geometry.profile import unrolled
from mlsanm_cli.io.schema import Quantities
from mlsanm_cli.mechanics.elasticity import von_mises
from mlsanm_cli.mechanics.finite.body_series import Forces
from mlsanm_cli.mechanics.finite.stability import Loaded
from mlsanm_cli.mechanics.laws.law import Law, determinant, gradient_of, stretches
from mlsanm_cli.operators.stencil_weights import Stencils
from mlsanm_cli.operators.stencils import build_stencils
from mlsanm_cli.solve.state import Fields, State

CONTACT_PREFIX = "contact "
"""Prefix of the names of contacts among the resultants of a run: the force on the obstacle."""


def fields_at(
    law: Law, derivatives: FloatArray, degrees: FloatArray | None, mean: FloatArray | None
) -> dict[str, FloatArray]:
    """Fields at n points from ``derivatives`` (n, 3 or more, 2) of the displacement (value, d/dx, d/dy) and
    the temperature change ``degrees`` (n,): Cauchy stresses, nan where the deformation is not invertible,
    principal in-plane stretches (n, 2), the larger first, and volume ratio J = det F (n,), which includes the
    stretch in z. ``mean`` (n,) is the mean stress of volume changes of nearly incompressible bodies."""
    gradient = gradient_of(derivatives)
    volume = 1.0 + determinant(gradient)
    folded = volume <= 0.0
    response = law.state(np.where(folded, 0.0, gradient), degrees, apart=mean is not None)
    xx, yy, across, xy = np.where(folded, np.nan, response.cauchy)
    if mean is not None:
        xx, yy, across = xx + mean, yy + mean, across + mean
    stress = np.stack([xx, yy, xy], axis=1)
    return {
        "displacement": derivatives[:, 0],
        "stress": stress,
        "stress_zz": across,
        "von_mises": von_mises(stress, across),
        "stretch": stretches(gradient).T,
        "volume_ratio": np.where(folded, volume, response.volume),
    }


def fields_of(scene: FiniteScene, state: State) -> dict[str, Fields]:
    """Fields at the nodes of every body."""
    found = dict[str, Fields]()
    for name, own in scene.parts(scene.shown(state)).items():
        body = scene.bodies[name]
        fields = _fitted((body, own, state.factors), body.elastic.model.stencils)
        found[name] = fields | {"displacement": own.reshape(-1, 2)}
    return found


def _fitted(loaded: Loaded, stencils: Stencils, points: FloatArray | None = None) -> dict[str, FloatArray]:
    """Fields of the fits of ``stencils`` at the nodes, or at ``points`` (e, 2)."""
    body, displacement, factors = loaded
    mean = body.mean_stress(displacement, factors)
    if mean is not None:
        mean = stencils.derivatives(mean[:, None])[:, 0, 0]
    derivatives = stencils.derivatives(displacement.reshape(-1, 2))
    return fields_at(body.law, derivatives, body.degrees(factors, points), mean)


def quantities(scene: FiniteScene, state: State) -> Quantities:
    """The quantities of a state, as rows of run.h5 have them."""
    return {
        "factors": dict(zip(scene.case.moved, state.factors.tolist(), strict=True)),
        "resultants": resultants(scene, state),
        "displacements": platen_displacements(scene, state),
        "contacts": contact_values(scene, state),
        "probes": probe_values(scene, state),
    }


def probe_values(scene: FiniteScene, state: State) -> dict[str, dict[str, Any]]:
    """Values at the probes of the case."""
    values, shown = dict[str, dict[str, Any]](), scene.parts(scene.shown(state)) if scene.probes else {}
    for probe in scene.probes:
        body = scene.bodies[probe.body]
        cloud, settings = body.elastic.model.cloud, body.elastic.model.settings
        stencils = build_stencils(cloud.points, cloud.tree, probe.point, 1, settings, cloud.sight)
        seen = _fitted((body, shown[probe.body], state.factors), stencils, probe.point)
        vectors = {key: seen[key][0] for key in ("displacement", "stress")}
        values[probe.name] = {**vectors, "von_mises": float(seen["von_mises"][0])}
    return values


def body_forces(scene: FiniteScene, state: State) -> dict[str, Forces]:
    """Forces on all bodies."""
    return {name: Forces(*one) for name, one in scene.loaded(state).items()}


def contact_forces(scene: FiniteScene, state: State) -> dict[str, list[FloatArray]]:
    """The forces (2,) of every contact on its slave, and on its master if that is a body."""
    forces, found = iter(scene.contacts.forces(state.side_traction)), dict[str, list[FloatArray]]()
    for contact in scene.contacts.pairs:
        pressed = [next(forces) for _ in contact.sides]
        found[contact.name] = pressed[::-1] if contact.exchanged else pressed
    return found


def resultants(scene: FiniteScene, state: State) -> dict[str, FloatArray]:
    """The force (2,) of every load and support on its body, and of every contact on its slave. Of several
    loads on a plate or an obstacle each reports the components that it prescribes, and the first of them also
    what none does."""
    case, bodies, nothing = scene.case, body_forces(scene, state), np.zeros(2)
    pressed = {name: forces[0] for name, forces in contact_forces(scene, state).items()}
    found = dict[str, FloatArray]()
    for number, load in enumerate(case.load):
        if isinstance(load, ObstacleMotion):
            found[load.name] = pressed[load.obstacle]
        elif not isinstance(load, Displacement | Platen):
            found[load.name] = sum((one.loads[number] for one in bodies.values()), nothing)
    for label, places in scene.supports.items():
        held = (bodies[body].reactions.get(name, nothing) for body, name in places)
        found[label] = sum(held, nothing)
    movers = [load for load in case.load if isinstance(load, Platen | ObstacleMotion)]
    moved = [one.obstacle if isinstance(one, ObstacleMotion) else (one.boundary, one.ends) for one in movers]
    for load, own in zip(movers, moved, strict=True):
        group = [one for one, other in zip(movers, moved, strict=True) if other == own]
        reporting = [[one for one in group if axis in one.control] or group[:1] for axis in ("x", "y")]
        found[load.name] = np.where([load in some for some in reporting], found[load.name], 0.0)
    return found | {f"{CONTACT_PREFIX}{name}": force for name, force in pressed.items()}


def contact_values(scene: FiniteScene, state: State) -> dict[str, dict[str, Any]]:
    """Pressures and tractions per deformed length, gaps, slips, status and work of every contact."""
    values = {}
    for contact, here, there in scene.contacts.each:
        slave = contact.slave
        stretch = np.abs(slave.deformed(state.solver["surface"][there])[0])
        gap = np.where(state.gap[here] < NO_GAP, state.gap[here], np.nan)
        slip = state.slip[here] if contact.friction else np.full(slave.count, np.nan)
        values[contact.name] = {
            "pressure": state.pressure[here] / stretch,
            "traction": state.traction[here] / stretch,
            "gap": gap,
            "slip": slip,
            "status": state.status[here],
            "dissipated_work": float(slave.weight @ state.work[here]),
        }
    return values


def figures_of_contacts(scene: FiniteScene, state: State) -> dict[str, dict[str, Any]]:
    """Summary of every contact; the half-width is measured along the undeformed side."""
    records, forces = contact_values(scene, state), contact_forces(scene, state)
    found: dict[str, dict[str, Any]] = {}
    for contact, _, there in scene.contacts.each:
        record, pressed = records[contact.name], forces[contact.name]
        arc, pressure = contact.slave.arc, record["pressure"]
        if contact.slave.around is not None:
            order, arc = unrolled(arc, contact.slave.around, pressure)
            pressure = pressure[order]
        limit = contact.friction * record["pressure"]
        ratio = np.abs(record["traction"][limit > 0.0]) / limit[limit > 0.0]
        own = {"max_cone_ratio": float(ratio.max(initial=0.0)) if contact.friction else None}
        if isinstance(contact, BodyContact):
            own["force_master"] = pressed[1].tolist()
        elif contact.rotation.any():
            # Of the tractions on the body about the obstacle's pivot.
            slave, pivot = contact.slave, contact.pivot + contact.motion @ state.driven
            at = slave.places + state.solver["surface"][there].reshape(-1, 2) - pivot
            force = slave.weight[:, None] * state.side_traction[there].reshape(-1, 2)
            own["moment"] = float(cross(at, force).sum())
        found[contact.name] = contact_figures(record, arc, pressure, pressed[0]) | own
    return found


def platen_displacements(scene: FiniteScene, state: State) -> dict[str, FloatArray]:
    """Displacement (2,) of every platen and obstacle, by the name of the load that moves it."""
    motions = {one.name: one.motion for one in scene.contacts.pairs if isinstance(one, RigidContact)}
    loads = scene.case.load
    moved = {one.name: motions[one.obstacle] for one in loads if isinstance(one, ObstacleMotion)}
    moved |= {loads[k].name: plate.motion[:2] for plate in scene.contacts.plates for k in plate.loads}
    return {name: motion @ state.driven for name, motion in moved.items()}


def plates_turned(scene: FiniteScene, state: State) -> dict[str, dict[str, float]]:
    """Rotation of every plate that rotates, and moment about its hinge."""
    found, loaded = {}, scene.loaded(state)
    for plate in (one for one in scene.contacts.plates if one.motion[2].any()):
        moment = sum(float(plate.pulled(name, *loaded[name])[0][2]) for name in plate.surfaces)
        found[plate.name] = {"rotation": float(plate.motion[2] @ state.driven), "moment": moment}
    return found


def extremes(scene: FiniteScene, state: State) -> Mapping[str, float]:
    """Extreme stretches, volume ratio and acoustic tensor of a state."""
    every, parts = fields_of(scene, state).values(), scene.parts(state.displacement).items()
    stretch = np.concatenate([one["stretch"].ravel() for one in every])
    volume = np.concatenate([one["volume_ratio"] for one in every])
    waves = [scene.bodies[name].ellipticity(own, state.factors).min() for name, own in parts]
    names = "least_stretch", "largest_stretch", "least_volume_ratio", "ellipticity"
    values = map(float, (stretch.min(), stretch.max(), volume.min(), min(waves)))
    return dict(zip(names, values, strict=True))
