"""Quantities of states at small strain: fields of the bodies, forces, plates, probes and contacts."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
import scipy.sparse as sparse

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.contact.complementarity.problem import STICK
from mlsanm_cli.contact.geometry.pairing import Pairing
from mlsanm_cli.io.schema import Quantities
from mlsanm_cli.mechanics.elasticity import von_mises
from mlsanm_cli.mechanics.laws.von_mises import ZZ, plastic_stress
from mlsanm_cli.mechanics.rigid import ROTATION
from mlsanm_cli.mechanics.scene import RigidConstraint, RigidMotion
from mlsanm_cli.operators.system import residual_of
from mlsanm_cli.solve.condensed_scene import CondensedScene
from mlsanm_cli.solve.state import Fields, State

MAX_STATES = 4
"""States solved for together: twice the work of one; more would only take more memory."""


def fields_of(
    built: CondensedScene, states: Sequence[State], stress: bool
) -> list[tuple[dict[str, Fields], float]]:
    """Fields of all bodies in each state, stresses only if requested, and the largest relative error of the
    linear solutions. States are solved together."""
    found: list[tuple[dict[str, Fields], float]] = []
    for first in range(0, len(states), MAX_STATES):
        some = states[first : first + MAX_STATES]
        bodies = dict[str, tuple[list[FloatArray], FloatArray]]()
        for name, body in built.scene.bodies.items():
            unknowns = [state.unknowns for state in some]
            if not len(some[0].displacement):
                bodies[name] = built.condensed.checked_displacements(built.scene, name, unknowns)
                continue
            solution = np.stack([state.displacement[built.scene.places[name]] for state in some], axis=1)
            sources = sparse.hstack([built.condensed.source(name, *each) for each in unknowns], format="csc")
            residual = residual_of(body.system, sparse.csc_array(sources), solution)
            bodies[name] = [one.reshape(-1, 2) for one in solution.T], residual
        for number, state in enumerate(some):
            fields = dict[str, Fields]()
            for name, (displacements, _) in bodies.items():
                rest = displacements[number]
                moved, near = built.condensed.contact_fields(built.scene, name, state.unknowns)
                sigma = built.scene.bodies[name].model.stress(rest) + near if stress else near[:0]
                named = named_fields(built, name, state, rest + moved, sigma)
                fields[name] = {**named, "rest": rest, "near": near[: len(sigma)]}
            # Unlike the built-in max, np.max propagates nan.
            found.append((fields, float(np.max([worth[number] for _, worth in bodies.values()]))))
    return found


def named_fields(
    built: CondensedScene,
    body: str,
    state: State,
    displacement: FloatArray,
    stress: FloatArray,
    points: FloatArray | None = None,
    values: sparse.csr_array | None = None,
) -> dict[str, FloatArray]:
    """Fields of a body from displacement (n, 2) and the stress (n, 3 | 4) of the whole strain, or no stress,
    at its nodes, or at ``points`` (n, 2) where ``values`` (n, N) of nodal fields give others."""
    material, degrees = built.scene.bodies[body].model.material, np.zeros(0)
    # Of elastic bodies in scenes with a yield stress.
    amount = limit = ratio = np.zeros(len(stress))
    if len(stress):
        degrees = built.scene.degrees(body, state.factors, points)
        stress = stress - degrees[:, None] * material.stress_of_expansion
    across, strain = material.out_of_plane_stress(stress, degrees), material.strain(stress, degrees)
    if body in built.laws and len(stress):
        law, history = built.laws[body], state.history(body)
        history = history if values is None else values @ history
        stress = stress - plastic_stress(material, history)
        across = material.out_of_plane_stress(stress, degrees) - material.across_modulus * history[:, ZZ]
        amount = np.maximum(history[:, 4], 0.0)
        limit = law.hardening.flow(amount)[0]
        ratio = law.equivalent(np.column_stack([stress[:, :2], across, stress[:, 2]]), history) / limit
    return {
        "displacement": displacement,
        "stress": stress[:, :3],
        "stress_zz": across,
        "von_mises": von_mises(stress, across),
        "strain": strain,
        "plastic_strain": amount,
        "flow_stress": limit,
        "yield_ratio": ratio,
    }


def quantities(built: CondensedScene, state: State) -> Quantities:
    """The quantities of a state, as rows of run.h5 have them."""
    condensed = built.condensed
    return {
        "factors": dict(zip(built.scene.loads, state.factors.tolist(), strict=True)),
        "resultants": {name: force(*state.unknowns) for name, force in condensed.quantities["force"].items()},
        "displacements": platen_displacements(built, state),
        "contacts": {one.name: contact_values(built, one, state) for one in condensed.reported},
        "probes": {name: probe_values(built, name, state) for name in condensed.quantities["probe"]},
    }


def contact_values(built: CondensedScene, pairing: Pairing, state: State) -> dict[str, Any]:
    """Pressures (m,), tractions, gaps, slips and status of a contact, and its dissipated work. Without
    friction there is no traction, and slip is not computed (nan); bonds stick, whatever they carry."""
    condensed, name, work = built.condensed, pairing.name, 0.0
    pressure, traction = condensed.contact_values(pairing, state.unknowns)
    gap = slip = np.zeros(len(pressure))
    status = np.full(len(pressure), STICK, dtype=np.int8)
    if not pairing.bonded:
        span, slip = condensed.spans[name], np.full(len(pressure), np.nan)
        gap, status = state.gap[span], state.status[span]
        if name in condensed.tangential:
            slip = state.slip[condensed.tangential[name]]
            work = float(condensed.areas[span] @ state.work[condensed.tangential[name]])
    values = {"pressure": pressure, "traction": traction, "gap": gap, "slip": slip, "status": status}
    return values | {"dissipated_work": work}


def slave_arc(pairing: Pairing) -> FloatArray:
    """Increasing arc lengths (m,) of a contact's candidates along the slave surface, from its start; on a
    closed surface the first of them is in the first turn."""
    arc, curve = pairing.arc[pairing.candidate], pairing.slave.curve
    if not pairing.nodal and not pairing.grid.facing.slave_first:
        # Grid places run in the direction of the master, opposite to the slave.
        arc = curve.closest(pairing.points[pairing.candidate])
        arc = np.maximum.accumulate(np.unwrap(arc, period=curve.length) if curve.closed else arc)
    return arc - curve.length * np.floor(arc[0] / curve.length) if curve.closed and len(arc) else arc


def platen_displacements(built: CondensedScene, state: State) -> dict[str, FloatArray]:
    """Displacement (2,) of the platen or obstacle that each load moves."""
    loads = built.scene.loads
    found = {loads[number]: np.zeros(2) for one in built.scene.rigid_constraints for number in one.loads}
    for constraint, motion, value in _motions(built, state):
        for number in constraint.loads:
            found[loads[number]] = found[loads[number]] + value * motion.direction[:2]
    return found


def plates_turned(built: CondensedScene, state: State) -> dict[str, dict[str, float]]:
    """``rotation`` (radian) and ``moment`` on the bodies about the hinge, of every plate that rotates."""
    found = {}
    for constraint, motion, angle in _motions(built, state):
        if constraint.held and motion.component == ROTATION:
            moment = built.condensed.quantities["moment"][constraint.name](*state.unknowns)[0]
            found[constraint.name] = {"rotation": angle, "moment": float(moment)}
    return found


def _motions(built: CondensedScene, state: State) -> Iterator[tuple[RigidConstraint, RigidMotion, float]]:
    """Rigid motions with their values in a state."""
    unknown = iter(state.motion)
    for constraint in built.scene.rigid_constraints:
        for motion in constraint.motions:
            given = motion.prescribed
            yield constraint, motion, float(next(unknown) if given is None else given @ state.factors)


def probe_values(built: CondensedScene, name: str, state: State) -> dict[str, Any]:
    """Displacement (2,), stress xx, yy, xy (3,) and von Mises stress at a probe, in bodies of revolution
    the hoop stress, too."""
    values = built.condensed.quantities["probe"][name](*state.unknowns)
    body, point = next((probe.body, probe.point) for probe in built.scene.probes if probe.name == name)
    stress, material = values[2:], built.scene.bodies[body].model.material
    across = material.out_of_plane_stress(stress[None], built.scene.degrees(body, state.factors, point))
    if body in built.laws:
        plastic = built.scene.bodies[body].model.field_rows(point) @ state.history(body)[:, ZZ]
        across = across - material.across_modulus * plastic
    mises = float(von_mises(stress[None], across)[0])
    found = {"displacement": values[:2], "stress": stress[:3], "von_mises": mises}
    return found | {"stress_zz": float(across[0])} if material.revolved else found
