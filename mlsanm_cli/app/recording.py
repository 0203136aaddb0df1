"""Turns states of the path into what is stored: rows of run.h5, fields, tables, figures of the summary."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any

import numpy as np
import scipy.sparse as sparse

from mlsanm_cli.app.build import Built
from mlsanm_cli.app.fine_views import View
from mlsanm_cli.app.states import PathStep, State
from mlsanm_cli.arrays import FloatArray, IntArray
from mlsanm_cli.cloud.cloud import Cloud
from mlsanm_cli.contact.pairing import Pairing
from mlsanm_cli.contact.profile import half_width
from mlsanm_cli.contact.sets import OPEN, SLIP, STICK
from mlsanm_cli.io.records import ContactRecord, ProbeRecord, StepRecord
from mlsanm_cli.io.run_file import RunFile
from mlsanm_cli.io.vtu import BodyState
from mlsanm_cli.mechanics.elasticity import von_mises
from mlsanm_cli.mechanics.probes import stress_of_expansion
from mlsanm_cli.mechanics.rigid import ROTATION
from mlsanm_cli.mechanics.scene import Platen
from mlsanm_cli.memo import digest

PRESSED = 1e-9
"""Cone ratios are told of nodes whose pressure is above this part of the peak; below, they are round-off."""
TOGETHER = 4
"""States solved for together: twice the work of one; more would only take more memory."""
NO_STARTS: Mapping[str, FloatArray] = MappingProxyType({})


@dataclass(frozen=True)
class Fields:
    """Fields of one body in one state: displacement (n, 2), stress (n, 3), stress_zz and von Mises (n,),
    strain (n, 3) as xx, yy, xy, heat included, and what its elastic system tells of the displacement,
    ``rest`` (N, 2), ghosts last."""

    displacement: FloatArray
    stress: FloatArray
    stress_zz: FloatArray
    von_mises: FloatArray
    strain: FloatArray
    rest: FloatArray


def slave_points(built: Built, pairing: Pairing) -> FloatArray:
    """Reference positions (m, 2) of a contact's candidates."""
    return pairing.points[pairing.candidate]


def slave_arc(pairing: Pairing) -> FloatArray:
    """Arc lengths (m,) of a contact's candidates along the slave surface."""
    return pairing.arc[pairing.candidate]


def write_model(file: RunFile, built: Built) -> None:
    """Bodies and contacts as they are before loading."""
    for name in built.scene.bodies:
        cloud = built.shown(name)
        surfaces = cloud.surfaces.values()
        file.write_body(
            name,
            cloud.points,
            np.concatenate([surface.index for surface in surfaces]),
            np.concatenate([surface.normal for surface in surfaces]),
            [surface.name for surface in surfaces for _ in surface.index],
        )
    for pairing in built.condensed.reported:
        chosen = pairing.candidate
        file.write_contact(
            pairing.name,
            slave_points(built, pairing),
            pairing.normal[chosen],
            slave_arc(pairing),
            pairing.weight[chosen],
        )
    condensed = built.condensed
    bonds = condensed.bonds
    if bonds.pairings:
        parts = {
            name: (bonds.pressure.take(own), bonds.traction.take(own)) for name, own in bonds.spans.items()
        }
        both = {name: np.concatenate([one.matrix for one in pair]) for name, pair in parts.items()}
        file.write_maps("bonds", both)
    moved = tuple(platen_displacements(built))
    file.start_path(built.scene.loads, tuple(condensed.forces), moved, tuple(condensed.probes))


def operators_digest(built: Built) -> str:
    """A digest of all that the path of a scene follows from beside its loads: equal for equal operators."""
    condensed = built.condensed
    maps = (condensed.gap, condensed.slip, condensed.watched, condensed.balance)
    return digest([one.matrix for one in maps], condensed.weight)


def write_maps(file: RunFile, built: Built) -> None:
    """What else follows from the unknowns that series hold: forces, slips, what probes observe."""
    condensed = built.condensed
    slips = {name: condensed.slip.take(own) for name, own in condensed.tangential.items()}
    for kind, maps in (("forces", condensed.forces), ("slip", slips), ("probes", condensed.probes)):
        if maps:
            file.write_maps(kind, {name: one.matrix for name, one in maps.items()})


def platen_displacements(built: Built, state: State | None = None) -> dict[str, FloatArray]:
    """Displacement (2,) of the platen or obstacle that each load moves, in one state or before any."""
    found: dict[str, FloatArray] = {}
    unknown = 0
    for mover in built.scene.movers:
        moved = np.zeros(2)
        for motion in mover.motions:
            free = motion.prescribed is None
            if state is not None and motion.component < 2:
                value = (
                    state.motion[unknown] if motion.prescribed is None else motion.prescribed @ state.factors
                )
                moved[motion.component] = value
            unknown += free
        found |= {built.scene.loads[number]: moved for number in mover.loads}
    return found


def plates_turned(built: Built, state: State) -> dict[str, dict[str, float]]:
    """``rotation`` (radian) and ``moment`` on its bodies about its hinge, of every plate that turns."""
    found, unknown = {}, 0
    for mover in built.scene.movers:
        for motion in mover.motions:
            if isinstance(mover, Platen) and motion.component == ROTATION:
                given = motion.prescribed
                angle = state.motion[unknown] if given is None else given @ state.factors
                moment = built.condensed.moments[mover.name](*state.unknowns)[0]
                found[mover.name] = {"rotation": float(angle), "moment": float(moment)}
            unknown += motion.prescribed is None
    return found


def contact_record(built: Built, pairing: Pairing, state: State) -> ContactRecord:
    """One contact in one state. Without friction there is no traction, and slip is not computed (nan)."""
    if pairing.bonded:
        return _bond_record(built, pairing, state)
    span = built.condensed.spans[pairing.name]
    count = span.stop - span.start
    traction, slip, work = np.zeros(count), np.full(count, np.nan), 0.0
    if pairing.name in built.condensed.tangential:
        own = built.condensed.tangential[pairing.name]
        traction, slip = state.traction[own], state.slip[own]
        work = float(built.condensed.weight[span] @ state.work[own])
    return ContactRecord(
        pressure=state.pressure[span],
        traction=traction,
        gap=state.gap[span],
        slip=slip,
        status=state.status[span],
        dissipated_work=work,
    )


def _bond_record(built: Built, pairing: Pairing, state: State) -> ContactRecord:
    """The same of bonded surfaces: they stick, whatever they carry."""
    pressure, traction = built.condensed.contact_values(pairing, state.unknowns)
    nothing = np.zeros(len(pressure))
    sticking = np.full(len(pressure), STICK, dtype=np.int8)
    return ContactRecord(pressure, traction, nothing, nothing, sticking, 0.0)


def cone_ratio(built: Built, contact: str, state: State) -> float:
    """Largest of |t| / (mu p) over the closed nodes of a contact with friction."""
    span, own = built.condensed.spans[contact], built.condensed.tangential[contact]
    pressure = state.pressure[span]
    pressed = state.closed[span] & (pressure > PRESSED * pressure.max(initial=0.0))
    limit = built.condensed.friction[own][pressed] * pressure[pressed]
    return float((np.abs(state.traction[own][pressed]) / limit).max(initial=0.0))


def probe_record(built: Built, name: str, state: State) -> ProbeRecord:
    """What a probe observes in one state."""
    values = built.condensed.probes[name](*state.unknowns)
    body, point = next((probe.body, probe.point) for probe in built.scene.probes if probe.name == name)
    stress, material = values[2:], built.scene.bodies[body].model.material
    across = material.across_stress(stress[None], built.scene.degrees(body, state.factors, point))
    return ProbeRecord(values[:2], stress, float(von_mises(stress[None], across)[0]))


def step_record(built: Built, step: PathStep, seconds: float) -> StepRecord:
    """One row of the path."""
    state = step.state
    return StepRecord(
        position=state.position,
        step_length=step.length,
        residual=state.residual,
        order=step.order,
        factorizations=step.factorizations,
        solves=step.solves,
        seconds=seconds,
        factors={name: float(f) for name, f in zip(built.scene.loads, state.factors, strict=True)},
        resultants={name: force(*state.unknowns) for name, force in built.condensed.forces.items()},
        displacements=platen_displacements(built, state),
        contacts={p.name: contact_record(built, p, state) for p in built.condensed.reported},
        probes={name: probe_record(built, name, state) for name in built.condensed.probes},
    )


def interface_columns(built: Built, pairing: Pairing, state: State) -> dict[str, Any]:
    """Columns of a contact's CSV."""
    record = contact_record(built, pairing, state)
    points = slave_points(built, pairing)
    return {
        "x": points[:, 0],
        "y": points[:, 1],
        "arc_length": slave_arc(pairing),
        "gap": record.gap,
        "pressure": record.pressure,
        "traction": record.traction,
        "slip": record.slip,
        "status": record.status,
    }


def contact_summary(built: Built, pairing: Pairing, state: State) -> dict[str, Any]:
    """The engineer's figures of a contact."""
    record = contact_record(built, pairing, state)
    force = built.condensed.contact_forces[pairing.name](*state.unknowns)
    if pairing.bonded:
        return {
            "peak_pressure": float(record.pressure.max(initial=0.0)),
            "peak_tension": float(-record.pressure.min(initial=0.0)),
            "peak_traction": float(np.abs(record.traction).max(initial=0.0)),
            "force": force.tolist(),
            "closed_nodes": len(record.pressure),
            "stick_nodes": len(record.pressure),
        }
    return {
        "peak_pressure": float(record.pressure.max(initial=0.0)),
        "half_width": half_width(slave_arc(pairing), record.pressure),
        "force": force.tolist(),
        "closed_nodes": int((record.status != OPEN).sum()),
        "stick_nodes": int((record.status == STICK).sum()),
        "slip_nodes": int((record.status == SLIP).sum()),
        "min_gap": float(record.gap.min()),
        "dissipated_work": None if np.isnan(record.dissipated_work) else record.dissipated_work,
    }


def fields_of(
    built: Built, states: Sequence[State], stress: bool, starts: Mapping[str, FloatArray] = NO_STARTS
) -> list[tuple[dict[str, Fields], float]]:
    """Of each state the fields of all bodies, stresses only if asked for, and how well its linear systems are
    solved.

    States are solved for together. ``starts`` are solutions (2N, 1) that may be near, by body.
    """
    found: list[tuple[dict[str, Fields], float]] = []
    for first in range(0, len(states), TOGETHER):
        some = states[first : first + TOGETHER]
        bodies = {name: _displacements(built, name, some, starts.get(name)) for name in built.scene.bodies}
        for number, state in enumerate(some):
            # Unlike max of Python, that of numpy loses no nan.
            worst = float(np.max([worth[number] for _, worth in bodies.values()]))
            fields = {
                name: _fields(built, name, state, displacements[number], stress)
                for name, (displacements, _) in bodies.items()
            }
            found.append((fields, worst))
    return found


def _fields(built: Built, name: str, state: State, displacement: FloatArray, stress: bool) -> Fields:
    """Fields of one body by the ``displacement`` (N, 2) of its elastic system, ghosts last."""
    model = built.scene.bodies[name].model
    moved, stressed = built.condensed.near_fields(built.scene, name, state.unknowns)
    sigma, degrees = np.zeros((0, 3)), np.zeros(0)
    if stress:
        degrees = built.scene.degrees(name, state.factors)
        # Ghosts move, but stresses are told at the points of the cloud only.
        sigma = model.stress(displacement) + stressed[: len(model.cloud.points)]
        sigma = sigma - degrees[:, None] * stress_of_expansion(model.material)
    across = model.material.across_stress(sigma, degrees)
    whole = (displacement + moved)[: len(model.cloud.points)]
    strain = model.material.strain(sigma, degrees)
    return Fields(whole, sigma, across, von_mises(sigma, across), strain, displacement)


def shown_fields(built: Built, state: State, fields: Mapping[str, Fields], stress: bool) -> dict[str, Fields]:
    """The fields at the points where they are written, stresses only if asked for."""
    return {
        name: _shown(built, built.views[name], state, values, stress) if name in built.views else values
        for name, values in fields.items()
    }


def _shown(built: Built, view: View, state: State, fields: Fields, stress: bool) -> Fields:
    name, material = view.model.name, view.model.material
    moved, stressed = built.condensed.near_fields(built.scene, name, state.unknowns, view.cloud.points)
    seen = (view.rows @ fields.rest.ravel()).reshape(5, -1).T
    sigma, degrees = np.zeros((0, 3)), np.zeros(0)
    if stress:
        degrees = built.scene.degrees(name, state.factors, view.cloud.points)
        sigma = seen[:, 2:] + stressed - degrees[:, None] * stress_of_expansion(material)
    across = material.across_stress(sigma, degrees)
    strain = material.strain(sigma, degrees)
    return Fields(seen[:, :2] + moved, sigma, across, von_mises(sigma, across), strain, fields.rest)


def _displacements(
    built: Built, name: str, states: Sequence[State], start: FloatArray | None
) -> tuple[list[FloatArray], FloatArray]:
    """Displacements (N, 2) of a body in each state, ghosts last, and what solving its elastic system once
    more is worth (c,)."""
    condensed = built.condensed
    if not len(states[0].displacement):
        unknowns = [state.unknowns for state in states]
        return condensed.checked_displacements(built.scene, name, unknowns, start)
    solution = np.stack([state.displacement[built.scene.places[name]] for state in states], axis=1)
    sources = sparse.hstack([condensed.source(name, *state.unknowns) for state in states], format="csc")
    residual = built.scene.bodies[name].system.residual(sparse.csc_array(sources), solution)
    return [one.reshape(-1, 2) for one in solution.T], residual


def stored_fields(fields: Mapping[str, Fields], wanted: tuple[str, ...]) -> dict[str, dict[str, FloatArray]]:
    """The fields asked for, by body and name."""
    return {body: {name: getattr(values, name) for name in wanted} for body, values in fields.items()}


def vtu_states(
    clouds: Mapping[str, Cloud], fields: Mapping[str, Fields], wanted: tuple[str, ...]
) -> dict[str, BodyState]:
    """The fields asked for at the points of ``clouds``, as VTU files take them."""
    states = {}
    for name, values in fields.items():
        cloud = clouds[name]
        states[name] = BodyState(
            points=cloud.points,
            boundary_tag=boundary_tags(cloud),
            displacement=values.displacement if "displacement" in wanted else None,
            stress=values.stress if "stress" in wanted else None,
            von_mises=values.von_mises if "von_mises" in wanted else None,
            stress_zz=values.stress_zz if "stress" in wanted else None,
            strain=values.strain if "strain" in wanted else None,
            triangles=cloud.triangles,
        )
    return states


def boundary_tags(cloud: Cloud) -> IntArray:
    """0 inside, k on the k-th boundary, whose pieces have one number; a corner node counts to the later
    one."""
    tags = np.zeros(len(cloud.points), dtype=np.int64)
    numbers: dict[str, int] = {}
    for surface in cloud.surfaces.values():
        tags[surface.index] = numbers.setdefault(surface.name.partition("/")[0], len(numbers) + 1)
    return tags
