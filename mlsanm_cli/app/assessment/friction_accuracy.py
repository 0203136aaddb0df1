"""Error estimates of states with friction, at the end of a path."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from mlsanm_cli.app.assessment.accuracy import ROUGH_SHARE, Accuracy, distance, together
from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.contact.laws.accuracy import changes_of, halved_pressure, roughness_of
from mlsanm_cli.contact.laws.active_set import ExactState
from mlsanm_cli.contact.laws.contact_status import STICK, ContactSolution, ContactStatus
from mlsanm_cli.contact.laws.coulomb import CoulombState, increment
from mlsanm_cli.contact.laws.frozen import frozen_change
from mlsanm_cli.contact.response.linear_map import LinearMap
from mlsanm_cli.errors import NumericalError
from mlsanm_cli.mechanics.defect import DEGREES, Corrected, correct
from mlsanm_cli.memo import NO_CACHE, Memo
from mlsanm_cli.solve.condensed_scene import CondensedScene
from mlsanm_cli.solve.grid_refinement import grid_errors
from mlsanm_cli.solve.state import State


def with_friction(built: CondensedScene, accuracy: Accuracy, state: State, memo: Memo = NO_CACHE) -> Accuracy:
    """Estimates of a scene with friction in its last ``state``; those of other scenes are unchanged.

    As without friction, but with the stick and slip status of that state: the path is not followed again.
    """
    condensed = built.condensed
    if not len(condensed.friction_nodes) or condensed.bonds.pairings or not state.closed.any():
        return accuracy
    if any(body.model.settings.degree not in DEGREES for body in built.scene.bodies.values()):
        return accuracy
    stuck = state.status == STICK
    last = ExactState(
        *(state.factors, state.pressure, state.gap, state.motion, state.traction),
        *(state.closed, stuck, 0, state.residual),
    )
    try:
        bodies = {
            name: correct(
                body,
                condensed.source(name, *state.unknowns),
                built.scene.floating_patterns(name) @ state.motion,
                memo,
            )
            for name, body in built.scene.bodies.items()
        }
        by = changes_of(condensed, built.scene, bodies)
        change = _change(built, last, by)
        lost = *roughness_of(condensed, built.scene, bodies), np.zeros_like(by[2])
        rough = _change(built, last, lost)
    except NumericalError:  # a cloud too small for the next degree, or a singular contact
        return accuracy
    size = float(sum((one.displacement**2).sum() for one in bodies.values()))
    error = _moved(built, bodies, change)
    halved = _halved(built, last)
    from_bulk: dict[str, float | None] = {}
    from_contact: dict[str, float | None] = {}
    for pair in condensed.pairings:
        from_bulk[pair.name] = together(
            distance(built, pair, last, state.pressure + change.pressure),
            distance(built, pair, last, state.pressure + ROUGH_SHARE * rough.pressure),
        )
        if pair.grid is not None:
            from_contact[pair.name] = float(np.linalg.norm(grid_errors(condensed, pair.name, [last])))
        else:
            from_contact[pair.name] = None if halved is None else distance(built, pair, last, halved)
    smooth = built.case.touching[0].regularization.law != "exact"
    by_law = _smoothed(built, state) if smooth else 0.0
    displacement = float(np.sqrt((error + by_law) / size)) if size > 0.0 else None
    return replace(
        accuracy,
        displacement=displacement,
        from_bulk=from_bulk,
        from_contact=from_contact,
        from_law=float(np.sqrt(by_law / size)) if size > 0.0 else 0.0,
        state=last,
    )


def _change(
    built: CondensedScene, state: ExactState, by: tuple[FloatArray, FloatArray, FloatArray]
) -> ContactSolution:
    """Response of the contact to changes ``by`` gaps (m,), slips (n,) and force imbalance (k,)."""
    condensed = built.condensed
    # The residual gaps of a regularised law are no error of the bodies.
    gaps = np.where(state.active, 0.0, state.gap)
    stuck = state.stuck[condensed.friction_nodes]
    return frozen_change(condensed, state.pressure, state.traction, gaps, state.active, stuck, by)


def _moved(built: CondensedScene, bodies: Mapping[str, Corrected], change: ContactSolution) -> float:
    """Sum of squares of the change of all displacements by the corrections and the contact's response."""
    condensed, scene, error = built.condensed, built.scene, 0.0
    moved = (np.zeros(len(built.stages[-1])), change.motion, change.pressure, change.traction)
    for name, body in scene.bodies.items():
        followed = bodies[name].response(body, condensed.source(name, *moved))[:, 0]
        total = bodies[name].change + followed + scene.floating_patterns(name) @ change.motion
        total = total + condensed.contact_fields(scene, name, moved)[0].ravel()
        error += float((total**2).sum())
    return error


def _smoothed(built: CondensedScene, state: State) -> float:
    """Sum of squares of the change of all displacements by the exact laws, in one increment from the
    ``state`` at its load; 0 if there is no solution. Lightly pressed bodies float on the gap of the
    regularised law."""
    condensed = built.condensed
    stuck = state.status[condensed.friction_nodes] == STICK
    slides = state.closed[condensed.friction_nodes] & ~stuck
    sets = ContactStatus(state.closed, stuck, np.where(slides, np.sign(state.traction), 0.0))
    values = ContactSolution(state.pressure, state.traction, state.motion, state.gap, state.slip)
    before = CoulombState(state.factors, values, sets, state.slip, state.work)
    try:
        exact = increment(condensed, before, state.factors)[0].values
    except NumericalError:
        return 0.0
    moved = (
        np.zeros(len(state.factors)),
        exact.motion - state.motion,
        exact.pressure - state.pressure,
        exact.traction - state.traction,
    )
    changes = (condensed.displacement(built.scene, name, moved) for name in built.scene.bodies)
    return float(sum((change**2).sum() for change in changes))


def _halved(built: CondensedScene, state: ExactState) -> FloatArray | None:
    """Pressures (m,) from every second node with the tractions of the state as loads; None if there is no
    contact with nodal pressures, or no solution."""
    condensed = built.condensed
    if all(pair.grid is not None for pair in condensed.pairings):
        return None
    pushed = replace(
        condensed,
        friction_nodes=condensed.friction_nodes[:0],
        friction=condensed.friction[:0],
        tangential={},
        gap=_with_tractions(condensed.gap, state.traction),
        slip=_with_tractions(condensed.slip.take(slice(0, 0)), state.traction),
        balance=_with_tractions(condensed.balance, state.traction),
    )
    try:
        return halved_pressure(pushed, state)
    except NumericalError:
        return None


def _with_tractions(linear: LinearMap, traction: FloatArray) -> LinearMap:
    """The map with the tractions included in its constant."""
    constant = linear.constant + linear.traction @ traction
    return replace(linear, constant=constant, traction=linear.traction[:, :0])
