"""Whether bodies that contacts alone keep from turning are in balance where they have turned to.

Contacts at small strain press where bodies are drawn. As a round body turns, its contact moves along its
surface while it stays below its centre in truth: the moment that seems to turn it back does not exist. It is
the same with all forces F that contacts exert at arms r: where a body turns by an angle q their moment
changes by -q sum(r F), which small displacements leave out. It is compared with what turns the body by q.
"""

from __future__ import annotations

import numpy as np

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.contact.laws.contact_status import STICK, ContactStatus, SetSystem
from mlsanm_cli.contact.response.dense import SingularSystemError
from mlsanm_cli.errors import NumericalError
from mlsanm_cli.mechanics.rigid import ROTATION
from mlsanm_cli.mechanics.scene import Obstacle, RigidConstraint
from mlsanm_cli.solve.condensed_scene import CondensedScene
from mlsanm_cli.solve.state import State

ROLLS = 0.8
"""Where moments that small displacements leave out are this part of those that turn a body, or more, nothing
resists it."""
UNSTEADY = 0.1
"""From this ratio on a run warns of wrong angles."""
MOVED, TURNED = 0.1, 1e-3
"""Turning that moves contacts by less than this part of their width, or moments by less than this part of the
forces' arms, need not be driven by loads."""


def check_rolling(built: CondensedScene, state: State) -> str:
    """A warning where bodies turn notably farther than found, "" elsewhere; NumericalError where loads turn a
    body that nothing resists."""
    turning = [
        (number, constraint)
        for number, (constraint, motion) in enumerate(built.scene.unknown_motions)
        if motion.component == ROTATION and not isinstance(constraint, Obstacle)
    ]
    pressed = [(number, one) for number, one in turning if _driven(built, state, number, one)]
    if not pressed or not state.closed.any():
        return ""
    shares, ways = _left_out(built, state, [number for number, _ in pressed], [one for _, one in pressed])
    worst = int(np.argmax(shares))
    if shares[worst] < UNSTEADY:
        return ""
    number, constraint = pressed[int(np.argmax(np.abs(ways[:, worst])))]
    names = " and ".join(f"body {name}" for name in constraint.bodies)
    angle = np.degrees(abs(state.motion[number]))
    hint = f'hold {names} with a [[support]], take away what turns it, or use model.strain = "finite"'
    if shares[worst] >= ROLLS:
        raise NumericalError(f"{names} rolls: the loads turn it, and nothing resists that", hint)
    further = 1.0 / (1.0 - shares[worst])
    return (
        f"{names} turns by {angle:.2g} degrees, and would turn {further:.2g} times as far if forces acted "
        f"where it turns to; {hint}"
    )


def _driven(built: CondensedScene, state: State, number: int, constraint: RigidConstraint) -> bool:
    """Whether a body turns so far that one of its contacts has moved."""
    angle = abs(float(state.motion[number]))
    for points, force in _forces(built, state, constraint) if angle > TURNED else ():
        pressed = np.hypot(*force.T)
        if pressed.any():
            width = np.hypot(*np.ptp(points[pressed > 0.0], axis=0))
            arm = np.hypot(*(np.average(points, axis=0, weights=pressed) - constraint.center))
            if angle * arm > MOVED * width:
                return True
    return False


def _forces(
    built: CondensedScene, state: State, constraint: RigidConstraint
) -> list[tuple[FloatArray, FloatArray]]:
    """Of each contact of a body its points (c, 2) and the forces (c, 2) there."""
    found, condensed = [], built.condensed
    bodies = () if isinstance(constraint, Obstacle) else constraint.bodies
    for pairing in condensed.pairings:
        span = condensed.spans[pairing.name]
        normal = pairing.normal[pairing.candidate]
        force = state.pressure[span, None] * normal
        if pairing.name in condensed.tangential:
            tangent = pairing.tangent[pairing.candidate]
            force = force + state.traction[condensed.tangential[pairing.name], None] * tangent
        for body, slave, sign in pairing.sides:
            if body in bodies:
                places = (pairing.points if slave else pairing.partner)[pairing.candidate]
                found.append((places, sign * condensed.weight[span, None] * force))
    return found


def _left_out(
    built: CondensedScene, state: State, numbers: list[int], constraints: list[RigidConstraint]
) -> tuple[FloatArray, FloatArray]:
    """Which parts (c,) of the moments that turn bodies are left out, for as many ways (c, c) of turning."""
    condensed = built.condensed
    nodes = condensed.friction_nodes
    stuck = state.status[nodes] == STICK
    slips = state.closed[nodes] & ~stuck
    sets = ContactStatus(state.closed, stuck, np.where(slips, np.sign(state.traction), 0.0))
    none = np.zeros(len(state.gap)), np.zeros(len(stuck))
    answers = np.zeros((len(numbers), len(numbers)))
    try:
        system = SetSystem(condensed, sets)
    except SingularSystemError:
        return np.zeros(len(numbers)), np.eye(len(numbers))
    for column, (number, constraint) in enumerate(zip(numbers, constraints, strict=True)):
        moment = np.zeros(len(state.motion))
        for points, force in _forces(built, state, constraint):
            moment[number] += float(((points - constraint.center) * force).sum())
        answers[:, column] = system.response(*none, moment).motion[numbers]
    shares, ways = np.linalg.eig(answers)
    return shares.real, ways.real
