"""Results of a state at plates, probes and contact nodes."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.contact.geometry.pairing import Pairing
from mlsanm_cli.io.records import ProbeRecord
from mlsanm_cli.mechanics.elasticity import von_mises
from mlsanm_cli.mechanics.rigid import ROTATION
from mlsanm_cli.mechanics.scene import Platen, RigidConstraint, RigidMotion
from mlsanm_cli.solve.condensed_scene import CondensedScene
from mlsanm_cli.solve.state import State


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
    found = {name: np.zeros(2) for one in built.scene.rigid_constraints for name in _loads(built, one)}
    for constraint, motion, value in _motions(built, state) if state is not None else ():
        for name in _loads(built, constraint):
            found[name] = found[name] + value * motion.direction[:2]
    return found


def plates_turned(built: CondensedScene, state: State) -> dict[str, dict[str, float]]:
    """``rotation`` (radian) and ``moment`` on the bodies about the hinge, of every plate that rotates."""
    found = {}
    for constraint, motion, angle in _motions(built, state):
        if isinstance(constraint, Platen) and motion.component == ROTATION:
            moment = built.condensed.moments[constraint.name](*state.unknowns)[0]
            found[constraint.name] = {"rotation": angle, "moment": float(moment)}
    return found


def _loads(built: CondensedScene, constraint: RigidConstraint) -> list[str]:
    return [built.scene.loads[number] for number in constraint.loads]


def _motions(built: CondensedScene, state: State) -> Iterator[tuple[RigidConstraint, RigidMotion, float]]:
    """Rigid motions with their values in a state."""
    unknown = iter(state.motion)
    for constraint in built.scene.rigid_constraints:
        for motion in constraint.motions:
            given = motion.prescribed
            yield constraint, motion, float(next(unknown) if given is None else given @ state.factors)


def probe_record(built: CondensedScene, name: str, state: State) -> ProbeRecord:
    """Values at a probe in a state."""
    values = built.condensed.probes[name](*state.unknowns)
    body, point = next((probe.body, probe.point) for probe in built.scene.probes if probe.name == name)
    stress, material = values[2:], built.scene.bodies[body].model.material
    across = material.out_of_plane_stress(stress[None], built.scene.degrees(body, state.factors, point))
    return ProbeRecord(values[:2], stress, float(von_mises(stress[None], across)[0]))
