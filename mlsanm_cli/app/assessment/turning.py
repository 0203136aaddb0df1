"""Rotations of bodies that are too large for contacts at small strain."""

from __future__ import annotations

import numpy as np

from mlsanm_cli.contact.laws.contact_status import STICK, ContactStatus
from mlsanm_cli.solve.condensed_scene import CondensedScene
from mlsanm_cli.solve.direction_updates import turns
from mlsanm_cli.solve.rolling import turned_by_loads
from mlsanm_cli.solve.state import State

TURN_WARNING = 0.01
"""Rotation of contacts (radian) above which there is a warning if a motion along them is fixed: the same part
of the contact force would act in this direction."""
MAX_MOMENT_ERROR = 0.1
"""Part of the rotation due to the motion of forces above which there is a warning."""


def check_held(built: CondensedScene) -> str:
    """Warning if surfaces have rotated so far that contact forces act along a motion without stiffness that
    is fixed at 0 ("" otherwise)."""
    along = [motion for motion in built.scene.held_motions if not any(way[2] for way in motion.values())]
    held = {body for motion in along for body in motion}
    if not held or not built.ends:
        return ""
    turned = turns(built.scene, built.condensed, built.ends[-1])
    worst, where = 0.0, ""
    for pairing in built.condensed.pairings:
        bodies = held & set(pairing.bodies)
        if pairing.grid is None or pairing.name not in turned or not bodies:
            continue
        angle = abs(turned[pairing.name] - pairing.grid.facing.turn)
        if angle > max(worst, TURN_WARNING):
            worst, where = angle, " and ".join(sorted(bodies))
    if not where:
        return ""
    return (
        f"the contact surfaces of {where} have rotated so far that {100.0 * worst:.2g} % of the contact "
        f"force acts along a motion without stiffness that is fixed at 0; add a [[support]] in that "
        f"direction, or friction to the contact"
    )


def check_rolling(built: CondensedScene, state: State) -> str:
    """Warning if forces at their displaced positions would rotate a body much farther ("" otherwise).
    NumericalError if loads rotate a body without resistance."""
    nodes = built.condensed.friction_nodes
    stuck = state.status[nodes] == STICK
    sign = np.where(state.closed[nodes] & ~stuck, np.sign(state.traction), 0.0)
    sets = ContactStatus(state.closed, stuck, sign)
    turned = turned_by_loads(built.scene, built.condensed, state.unknowns[1:], sets)
    if turned is None or turned.share < MAX_MOMENT_ERROR:
        return ""
    if turned.error:
        raise turned.error
    return (
        f"{turned.names} rotates by {np.degrees(turned.angle):.2g} degrees, and would rotate "
        f"{1.0 / (1.0 - turned.share):.2g} times as far with forces at their displaced positions; "
        f"{turned.hint}"
    )
