"""Error estimates of states with friction, at the end of a path."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from mlsanm_cli.app.checks.accuracy import (
    Accuracy,
    Halved,
    Moved,
    corrected_bodies,
    estimated,
    has_nodal_pressures,
)
from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.contact.complementarity.problem import STICK
from mlsanm_cli.contact.laws.accuracy import (
    Changes,
    frozen_change,
    halved_state,
    roughness_of,
)
from mlsanm_cli.contact.laws.active_set import ExactState
from mlsanm_cli.contact.response.linear_map import LinearMap
from mlsanm_cli.errors import NumericalError
from mlsanm_cli.memo import Memo
from mlsanm_cli.solve.condensed_scene import CondensedScene
from mlsanm_cli.solve.state import State


def with_friction(built: CondensedScene, accuracy: Accuracy, state: State, memo: Memo) -> Accuracy:
    """Estimates of a scene with friction in its last ``state``; those of other scenes are unchanged. As
    without friction, but with the stick and slip status of that state: the path is not followed again."""
    condensed = built.condensed
    if not len(condensed.friction_nodes) or not state.closed.any():
        return accuracy
    stuck = state.status == STICK
    last = ExactState(
        *(state.factors, state.pressure, state.gap, state.motion, state.traction),
        *(state.closed, stuck, 0, state.residual),
    )
    try:
        bodies = corrected_bodies(built, state.unknowns, memo)
        rough = _moved(built, last, roughness_of(condensed, built.scene, bodies))[1]
        halved = _halved(built, last)
        return estimated(built, last, bodies, lambda by: _moved(built, last, by), rough, halved)
    except NumericalError as error:  # a cloud too small for the next degree, or a singular contact
        return replace(accuracy, missing=error.advice)


def _moved(built: CondensedScene, state: ExactState, by: Changes) -> Moved:
    """Response of the contact to changes ``by`` something else."""
    condensed = built.condensed
    # The residual gaps of a regularised law are no error of the bodies.
    gaps = np.where(state.active, 0.0, state.gap)
    stuck = state.stuck[condensed.friction_nodes]
    change = frozen_change(condensed, state.pressure, state.traction, gaps, state.active, stuck, by)
    return change.motion, change.pressure, change.traction


def _halved(built: CondensedScene, state: ExactState) -> Halved | None:
    """Motions and pressures from every second node with the tractions of the state as loads; None if there is
    no contact with nodal pressures, or no solution."""
    condensed = built.condensed
    if not has_nodal_pressures(built):
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
        return halved_state(pushed, state)
    except NumericalError:
        return None


def _with_tractions(linear: LinearMap, traction: FloatArray) -> LinearMap:
    """The map with the tractions included in its constant."""
    constant = linear.constant + linear.traction @ traction
    return replace(linear, constant=constant, traction=linear.traction[:, :0])
