"""What is told of a state at finite strain: fields, what probes see, forces of loads and supports."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from mlsanm_cli.app.finite.path import FiniteState
from mlsanm_cli.app.finite.scene import FiniteScene
from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.case import Displacement, ObstacleMotion, Platen
from mlsanm_cli.contact.geometry.profile import half_width
from mlsanm_cli.contact.laws.contact_status import OPEN, SLIP
from mlsanm_cli.io.records import ContactRecord, ProbeRecord
from mlsanm_cli.mechanics.elasticity import von_mises
from mlsanm_cli.mechanics.finite.forces import Forces
from mlsanm_cli.mechanics.finite.law import Law, cauchy_stress, determinant, stretches
from mlsanm_cli.operators.stencils import build_stencils

CONTACT = "contact "
"""Before the name of a contact, among the resultants of a run: the force of its obstacle."""


@dataclass(frozen=True)
class FiniteFields:
    """At n points: displacement (n, 2), Cauchy's stress xx, yy, xy (n, 3) and across the plane (n,), von
    Mises stress (n,), principal stretches in the plane (n, 2), the larger first, and the ratio of volumes
    J = det F (n,), in plane stress with the stretch across the plane."""

    displacement: FloatArray
    stress: FloatArray
    stress_zz: FloatArray
    von_mises: FloatArray
    stretch: FloatArray
    volume_ratio: FloatArray

    @classmethod
    def of(cls, law: Law, displacement: FloatArray, gradient: FloatArray) -> FiniteFields:
        """By ``displacement`` (n, 2) and its ``gradient`` (4, n)."""
        stress, across = cauchy_stress(law, gradient).T, law.stress_across(gradient)
        volume = (1.0 + determinant(gradient)) * law.across(gradient)
        mises = von_mises(stress, across)
        return cls(displacement, stress, across, mises, stretches(gradient).T, volume)


def fields_of(scene: FiniteScene, state: FiniteState) -> FiniteFields:
    """The fields at the nodes."""
    gradient = scene.body.gradient(state.displacement)
    return FiniteFields.of(scene.body.law, state.displacement.reshape(-1, 2), gradient)


def fields_at(scene: FiniteScene, state: FiniteState, points: FloatArray) -> FiniteFields:
    """The fields at ``points`` (e, 2) of the body as it is before loading."""
    model = scene.body.elastic.model
    stencils = build_stencils(model.nodes, model.tree, points, 1, model.settings, model.cloud.sight)
    return fields_by(scene.body.law, stencils.derivatives(state.displacement.reshape(-1, 2)))


def fields_by(law: Law, derivatives: FloatArray) -> FiniteFields:
    """The fields by ``derivatives`` (e, 3, 2) of the displacement, value first."""
    gradient = np.stack(
        [derivatives[:, 1, 0], derivatives[:, 2, 0], derivatives[:, 1, 1], derivatives[:, 2, 1]]
    )
    return FiniteFields.of(law, derivatives[:, 0], gradient)


def probe_records(scene: FiniteScene, state: FiniteState) -> dict[str, ProbeRecord]:
    """What the case's probes see."""
    records = {}
    for probe in scene.probes:
        seen = fields_at(scene, state, probe.point)
        records[probe.name] = ProbeRecord(seen.displacement[0], seen.stress[0], float(seen.von_mises[0]))
    return records


def resultants(scene: FiniteScene, forces: Forces) -> dict[str, FloatArray]:
    """The force (2,) of every load and support on the body."""
    held = {name: forces.held(surfaces) for name, surfaces in scene.supports.items()}
    pressed = contact_forces(scene, forces)
    loads = {
        load.name: pressed[load.obstacle] if isinstance(load, ObstacleMotion) else forces.loads[number]
        for number, load in enumerate(scene.case.load)
        if not isinstance(load, Displacement | Platen)
    }
    return loads | held | {f"{CONTACT}{name}": force for name, force in pressed.items()}


def contact_forces(scene: FiniteScene, forces: Forces) -> dict[str, FloatArray]:
    """The force (2,) of every obstacle on the body."""
    found, first = {}, len(scene.case.moved)
    for contact in scene.contacts:
        found[contact.name] = forces.loads[first : first + 2 * contact.count].sum(axis=0)
        first += 2 * contact.count
    return found


def contact_records(scene: FiniteScene, state: FiniteState) -> dict[str, ContactRecord]:
    """Pressures per current length, and gaps, of every contact."""
    records, first = {}, 0
    gradient = scene.body.gradient(state.displacement) if scene.contacts else np.zeros((4, 0))
    for contact in scene.contacts:
        here = slice(first, first + contact.count)
        first = here.stop
        xx, xy, yx, yy = gradient[:, contact.nodes]
        x, y = -contact.outward[:, 1], contact.outward[:, 0]
        stretch = np.hypot((1.0 + xx) * x + xy * y, yx * x + (1.0 + yy) * y)
        pressure, none = state.pressure[here], np.zeros(contact.count)
        status = np.where(pressure > 0.0, SLIP, OPEN).astype(np.int8)
        unknown = np.full(contact.count, np.nan)
        records[contact.name] = ContactRecord(pressure / stretch, none, state.gap[here], unknown, status)
    return records


def contact_summary(scene: FiniteScene, state: FiniteState, forces: Forces) -> dict[str, dict[str, Any]]:
    """The engineer's figures of every contact; the half-width is along the side before loading."""
    pressed = contact_forces(scene, forces)
    records = contact_records(scene, state)
    return {
        contact.name: {
            "peak_pressure": float(records[contact.name].pressure.max(initial=0.0)),
            "half_width": half_width(contact.arc, records[contact.name].pressure),
            "force": pressed[contact.name].tolist(),
            "closed_nodes": int((records[contact.name].status != OPEN).sum()),
            "stick_nodes": 0,
            "slip_nodes": int((records[contact.name].status != OPEN).sum()),
            "min_gap": float(records[contact.name].gap.min()),
            "dissipated_work": 0.0,
            "max_cone_ratio": None,
        }
        for contact in scene.contacts
    }


def platen_displacements(scene: FiniteScene, factors: FloatArray) -> dict[str, FloatArray]:
    """Displacement (2,) of every platen by the load that moves it."""
    moved = {}
    for number, load in enumerate(scene.case.load):
        if isinstance(load, Platen):
            control = [load.control.get(axis) for axis in "xy"]
            moved[load.name] = np.array([0.0 if one is None else one[1] for one in control]) * factors[number]
    return moved


def extremes(scene: FiniteScene, state: FiniteState) -> Mapping[str, float]:
    """How far a state is from where it would have no sense."""
    gradient = scene.body.gradient(state.displacement)
    fields = fields_of(scene, state)
    return {
        "least_stretch": float(fields.stretch.min()),
        "largest_stretch": float(fields.stretch.max()),
        "least_volume_ratio": float(fields.volume_ratio.min()),
        "ellipticity": float(scene.body.law.ellipticity(gradient).min()),
    }
