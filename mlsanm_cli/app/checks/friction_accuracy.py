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
    """Motions and pressures from every second node, with the tractions of the state as loads and motions
    along the contacts, which friction resists, as they are; None if there is no contact with nodal pressures,
    or no solution."""
    condensed = built.condensed
    if not has_nodal_pressures(built):
        return None
    across, along = (
        np.abs(linear.motion).max(axis=0, initial=0.0) for linear in (condensed.gap, condensed.slip)
    )
    free, motion = across >= along, state.motion.copy()

    def pushed(linear: LinearMap) -> LinearMap:
        known = linear.constant + linear.traction @ state.traction + linear.motion[:, ~free] @ motion[~free]
        return replace(linear, constant=known, motion=linear.motion[:, free], traction=linear.traction[:, :0])

    frictionless = replace(
        condensed,
        friction_nodes=condensed.friction_nodes[:0],
        friction=condensed.friction[:0],
        tangential={},
        gap=pushed(condensed.gap),
        slip=pushed(condensed.slip.take(slice(0, 0))),
        balance=pushed(condensed.balance.take(free)),
    )
    try:
        motion[free], pressure = halved_state(frictionless, replace(state, motion=motion[free]))
    except NumericalError:
        return None
    return motion, pressure
