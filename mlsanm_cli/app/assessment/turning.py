"""Whether bodies have turned farther than contacts at small strain can follow."""

from __future__ import annotations

import numpy as np

from mlsanm_cli.contact.laws.contact_status import STICK, ContactStatus
from mlsanm_cli.solve.condensed_scene import CondensedScene
from mlsanm_cli.solve.direction_updates import turns
from mlsanm_cli.solve.rolling import turned_by_loads
from mlsanm_cli.solve.state import State

HELD_WARNING = 0.01
"""Contacts turned by more than this angle while a motion along them is held are warned of: so large a part of
what presses would push that way."""
UNSTEADY = 0.1
"""Bodies that would turn by this part more, if forces acted where they turn to, are warned of."""


def check_held(built: CondensedScene) -> str:
    """A warning where surfaces have turned so far that what presses on a body drives a motion that is held
    as nothing resists it, "" elsewhere."""
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
        if angle > max(worst, HELD_WARNING):
            worst, where = angle, " and ".join(sorted(bodies))
    if not where:
        return ""
    return (
        f"the contact surfaces of {where} have rotated so far that {100.0 * worst:.2g} % of the contact "
        f"force acts along a motion without stiffness that is fixed at 0; add a [[support]] in that "
        f"direction, or friction to the contact"
    )


def check_rolling(built: CondensedScene, state: State) -> str:
    """A warning where a body turns notably farther than found, "" elsewhere; NumericalError where loads turn
    it and nothing resists that."""
    nodes = built.condensed.friction_nodes
    stuck = state.status[nodes] == STICK
    sign = np.where(state.closed[nodes] & ~stuck, np.sign(state.traction), 0.0)
    sets = ContactStatus(state.closed, stuck, sign)
    turned = turned_by_loads(built.scene, built.condensed, state.unknowns[1:], sets)
    if turned is None or turned.share < UNSTEADY:
        return ""
    if turned.error:
        raise turned.error
    return (
        f"{turned.names} turns by {np.degrees(turned.angle):.2g} degrees, and would turn "
        f"{1.0 / (1.0 - turned.share):.2g} times as far if forces acted where it turns to; {turned.hint}"
    )
