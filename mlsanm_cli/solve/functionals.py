"""Results of a state at plates, probes and contact nodes."""

from __future__ import annotations

import numpy as np

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.contact.geometry.pairing import Pairing
from mlsanm_cli.io.records import ProbeRecord
from mlsanm_cli.mechanics.elasticity import von_mises
from mlsanm_cli.mechanics.rigid import ROTATION
from mlsanm_cli.mechanics.scene import Platen
from mlsanm_cli.solve.condensed_scene import CondensedScene
from mlsanm_cli.solve.state import State


def slave_points(built: CondensedScene, pairing: Pairing) -> FloatArray:
    """Reference positions (m, 2) of a contact's candidates."""
    return pairing.points[pairing.candidate]


def slave_arc(pairing: Pairing) -> FloatArray:
    """Increasing arc lengths (m,) of a contact's candidates along the slave surface, from its start."""
    arc = pairing.arc[pairing.candidate]
    if pairing.grid is None or pairing.grid.facing.slave_first:
        return arc
    # Grid places run in the direction of the master, opposite to the slave.
    curve = pairing.slave.curve
    found = curve.closest(pairing.points[pairing.candidate])
    return np.maximum.accumulate(np.unwrap(found, period=curve.length) if curve.closed else found)


def platen_displacements(built: CondensedScene, state: State | None = None) -> dict[str, FloatArray]:
    """Displacement (2,) of the platen or obstacle that each load moves, in a state or initially."""
    found: dict[str, FloatArray] = {}
    unknown = 0
    for constraint in built.scene.rigid_constraints:
        moved = np.zeros(2)
        for motion in constraint.motions:
            free = motion.prescribed is None
            if state is not None:
                value = (
                    state.motion[unknown] if motion.prescribed is None else motion.prescribed @ state.factors
                )
                moved += value * motion.direction[:2]
            unknown += free
        found |= {built.scene.loads[number]: moved for number in constraint.loads}
    return found


def plates_turned(built: CondensedScene, state: State) -> dict[str, dict[str, float]]:
    """``rotation`` (radian) and ``moment`` on the bodies about the hinge, of every plate that rotates."""
    found, unknown = {}, 0
    for constraint in built.scene.rigid_constraints:
        for motion in constraint.motions:
            if isinstance(constraint, Platen) and motion.component == ROTATION:
                given = motion.prescribed
                angle = state.motion[unknown] if given is None else given @ state.factors
                moment = built.condensed.moments[constraint.name](*state.unknowns)[0]
                found[constraint.name] = {"rotation": float(angle), "moment": float(moment)}
            unknown += motion.prescribed is None
    return found


def probe_record(built: CondensedScene, name: str, state: State) -> ProbeRecord:
    """Values at a probe in a state."""
    values = built.condensed.probes[name](*state.unknowns)
    body, point = next((probe.body, probe.point) for probe in built.scene.probes if probe.name == name)
    stress, material = values[2:], built.scene.bodies[body].model.material
    across = material.out_of_plane_stress(stress[None], built.scene.degrees(body, state.factors, point))
    return ProbeRecord(values[:2], stress, float(von_mises(stress[None], across)[0]))
