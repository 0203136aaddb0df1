"""What is told of a state at finite strain: fields, what probes see, forces of loads and supports."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from mlsanm_cli.app.finite.path import FiniteState
from mlsanm_cli.app.finite.scene import FiniteScene
from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.case import Displacement, Platen
from mlsanm_cli.io.records import ProbeRecord
from mlsanm_cli.mechanics.elasticity import von_mises
from mlsanm_cli.mechanics.finite.forces import Forces
from mlsanm_cli.mechanics.finite.law import Law, cauchy_stress, determinant, stretches
from mlsanm_cli.operators.stencils import build_stencils
from mlsanm_cli.values import dataclass


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
    loads = {
        load.name: forces.loads[number]
        for number, load in enumerate(scene.case.load)
        if not isinstance(load, Displacement | Platen)
    }
    return loads | held


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
