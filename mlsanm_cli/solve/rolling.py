"""Equilibrium of bodies whose rotation is resisted by contacts alone in their rotated position.

Contacts at small strain act in the initial positions. As a round body rotates, its contact moves along its
surface but stays below its centre, so that the apparent restoring moment does not exist. In general, forces F
of contacts at arms r have a moment that changes by -q sum(r F) with a rotation q, a second-order term that
small displacements omit. It is compared with the stiffness against q.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.contact.laws.active_set import ExactState
from mlsanm_cli.contact.laws.contact_status import ContactStatus, SetSystem
from mlsanm_cli.contact.laws.set_search import NoStateError
from mlsanm_cli.contact.response.condensed import Condensed
from mlsanm_cli.contact.response.dense import SingularSystemError
from mlsanm_cli.errors import NumericalError
from mlsanm_cli.mechanics.rigid import ROTATION
from mlsanm_cli.mechanics.scene import Obstacle, RigidConstraint, Scene

INSTABILITY_RATIO = 0.8
"""Ratio of the moments neglected by small displacements to those that turn a body above which it is
unstable."""
MIN_SHIFT, MIN_MOMENT_SHARE = 0.1, 1e-3
"""Rotations that move contacts by less than this part of their width, or moments by less than this part of
the arms of the forces, need not be caused by loads."""


class RollingError(NoStateError):
    """Loads rotate bodies without resistance."""

    def __init__(self, turned: Turned) -> None:
        how, what = ("roll or tip", "them") if len(turned.bodies) > 1 else ("rolls or tips", "it")
        message = f"{turned.names} {how} over: the loads turn {what}, and nothing resists that"
        NumericalError.__init__(self, message, turned.hint)
        self.sliding = True


@dataclass(frozen=True)
class Turned:
    """Body, or bodies on one plate, with the largest ``share`` of omitted moment in the stiffness against its
    rotation, and its ``angle``."""

    bodies: tuple[str, ...]
    angle: float
    share: float

    @property
    def names(self) -> str:
        return " and ".join(f"body {name}" for name in self.bodies)

    @property
    def hint(self) -> str:
        """Hint for the user."""
        return (
            f'hold {self.names} with a [[support]], take away what turns it, or use model.strain = "finite"'
        )

    @property
    def error(self) -> RollingError | None:
        """The error, None if the rotation is resisted."""
        return RollingError(self) if self.share >= INSTABILITY_RATIO else None


def rolls_away(scene: Scene, condensed: Condensed, state: ExactState) -> bool:
    """Whether loads rotate a body without resistance in a state, which then is not on any path."""
    nodes = condensed.friction_nodes
    stuck, closed = state.stuck[nodes], state.active[nodes]
    sets = ContactStatus(state.active, stuck, np.where(closed & ~stuck, np.sign(state.traction), 0.0))
    turned = turned_by_loads(scene, condensed, (state.motion, state.pressure, state.traction), sets)
    return turned is not None and turned.error is not None


def turned_by_loads(
    scene: Scene,
    condensed: Condensed,
    unknowns: tuple[FloatArray, FloatArray, FloatArray],
    sets: ContactStatus,
) -> Turned | None:
    """The body rotated by loads with the largest omitted moment, in a state of motions (k,), pressures (m,)
    and tractions (n,) with its ``sets``; None if there is none."""
    motion, pressure, traction = unknowns
    turning: list[tuple[int, RigidConstraint, list[tuple[FloatArray, FloatArray]]]] = []
    for number, (constraint, one) in enumerate(scene.unknown_motions):
        if (
            one.component != ROTATION
            or isinstance(constraint, Obstacle)
            or abs(motion[number]) <= MIN_MOMENT_SHARE
        ):
            continue
        forces = _forces(condensed, constraint.bodies, pressure, traction)
        if any(_moved(*each, constraint.center, abs(float(motion[number]))) for each in forces):
            turning.append((number, constraint, forces))
    if not turning:
        return None
    try:
        system = SetSystem(condensed, sets)
    except SingularSystemError:
        return None
    numbers = [number for number, *_ in turning]
    rotations = np.zeros((len(numbers), len(numbers)))
    for column, (number, constraint, forces) in enumerate(turning):
        moment = np.zeros(len(motion))
        moment[number] = sum(float(((at - constraint.center) * force).sum()) for at, force in forces)
        rotations[:, column] = system.response(
            np.zeros(len(pressure)), np.zeros(len(traction)), moment
        ).motion[numbers]
    shares, ways = np.linalg.eig(rotations)
    worst = int(np.argmax(shares.real))
    number, constraint, _ = turning[int(np.argmax(np.abs(ways[:, worst])))]
    assert not isinstance(constraint, Obstacle)
    return Turned(constraint.bodies, abs(float(motion[number])), float(shares.real[worst]))


def _forces(
    condensed: Condensed, bodies: Sequence[str], pressure: FloatArray, traction: FloatArray
) -> list[tuple[FloatArray, FloatArray]]:
    """Points (c, 2) and forces (c, 2) of each contact on the bodies."""
    found = []
    for pairing in condensed.pairings:
        span, chosen = condensed.spans[pairing.name], pairing.candidate
        force = pressure[span, None] * pairing.normal[chosen]
        if pairing.name in condensed.tangential:
            force = force + traction[condensed.tangential[pairing.name], None] * pairing.tangent[chosen]
        for body, slave, sign in pairing.sides:
            if body in bodies and force.any():
                places = (pairing.points if slave else pairing.partner)[chosen]
                found.append((places, sign * condensed.weight[span, None] * force))
    return found


def _moved(points: FloatArray, force: FloatArray, center: tuple[float, float], angle: float) -> bool:
    """Whether a contact moves along the surface as its body rotates by an angle."""
    pressed = np.hypot(*force.T)
    width = np.hypot(*np.ptp(points[pressed > 0.0], axis=0))
    arm = np.hypot(*(np.average(points, axis=0, weights=pressed) - center))
    return bool(angle * arm > MIN_SHIFT * width)
