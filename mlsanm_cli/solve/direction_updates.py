"""First-order rotation of the directions of contact pressures with the bodies, and bodies that loads rotate.

Directions vary along a contact as the normals of the flatter surface, the base. As bodies rotate and move
along each other the patch moves to where both normals agree: its direction is the initial normal of the base
rotated with the base there. A round base that is free to roll keeps its initial normal apart from its
bending, as the moment about its centre is right in a frame that rolls with it. A straight side of a rigid
obstacle has one normal, which does not rotate; nor does that of a patch on a plane of symmetry.

A body without stiffness in a direction, as a plate that may slide on two round posts, is held there. If it
bends, the posts press on it along rotated normals, and at first order only the hold could balance the
difference of their forces: the common part of the rotations is removed.

Contacts at small strain act in the initial positions. Forces F of contacts at arms r have a moment that
changes by -q sum(r F) with a rotation q, a second-order term that small displacements omit. It is compared
with the stiffness against q: a round body has no restoring moment, as its contact stays below its centre.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.cloud.membership import cross
from mlsanm_cli.contact.complementarity.basis import Basis, SingularError
from mlsanm_cli.contact.laws.contact_state import ContactState, UnbalancedError, response
from mlsanm_cli.contact.response.condensed import Condensed
from mlsanm_cli.mechanics.near_field import as_real
from mlsanm_cli.mechanics.rigid import ROTATION
from mlsanm_cli.mechanics.scene import Scene
from mlsanm_cli.records import dataclass
from mlsanm_cli.roundoff import COARSE_ROUND_OFF
from mlsanm_cli.solve.state import INSTABILITY_RATIO

MAX_CARRIED = 1e-8
"""Largest force of fixed motions relative to the contact force."""
CURVATURE_RANGE = 0.01
"""Part of the range on both sides over which curvatures are evaluated."""
SIDE_WIDTHS = 1.0
"""Distance from the middle of a patch, in its widths, at which the rotation of a surface is evaluated."""


def turns(scene: Scene, condensed: Condensed, state: ContactState) -> dict[str, float]:
    """Rotation (radian, counter-clockwise) of the directions of contacts that touch in one patch, by name."""
    angles, solved = dict[str, float](), dict[str, FloatArray]()
    floating = {body for constraint, _ in scene.unknown_motions for body in constraint.bodies}
    for pairing in condensed.on_grids:
        grid, pressure = pairing.grid, state.pressure[condensed.spans[pairing.name]]
        closed = np.flatnonzero(state.closed[condensed.spans[pairing.name]])
        place, share = grid.hats.place, grid.hats.weight * pressure
        if not len(closed) or closed[-1] - closed[0] >= len(closed) or not share.sum() > 0.0:
            continue
        if grid.untracted[closed].any():
            angles[pairing.name] = 0.0
            continue
        # The curvatures of the base and the other surface, and the initial angle from the normal of the
        # other one to that of the base, on average over the force: at the tip of a wedge it is that of one
        # side.
        middle, base = float(share @ place / share.sum()), grid.facing.slave_first
        offset, bends, normals = CURVATURE_RANGE * (grid.last - grid.first), [], []
        for side in (base, not base):
            (one, other), (first, last) = grid.facing.side(np.array([middle - offset, middle + offset]), side)
            bends.append(float(abs(np.angle(last / first)) / abs(other - one)))
            normals.append(grid.facing.side(place[closed], side)[1])
        drawn = float(share[closed] @ np.angle(normals[0] / -normals[1]) / share[closed].sum())
        straight = bends[1] <= COARSE_ROUND_OFF * bends[0]
        if straight and (grid.facing.other is None or not bends[0]):
            angles[pairing.name] = 0.0
            continue
        angles[pairing.name] = drawn
        body = pairing.slave_body if base else pairing.master_body
        # Obstacles do not rotate. If both surfaces are curved and one may slide, their bending would move it
        # further in every update.
        if body is None or (min(bends) > COARSE_ROUND_OFF * max(bends) and floating & {*pairing.bodies}):
            continue
        aside = SIDE_WIDTHS * float(place[closed[-1]] - place[closed[0]] + grid.hats.weight[closed].max())
        ends = np.clip([middle - aside, middle + aside], grid.first, grid.last)
        points = as_real(grid.facing.side(ends, base)[0])
        # All around a closed surface there is no chord, and no side to turn to.
        if np.hypot(*(points[1] - points[0])) <= COARSE_ROUND_OFF * (ends[1] - ends[0]):
            continue
        if body not in solved:
            rest = condensed.solution(scene, body, state.unknowns)[0][:, 0]
            solved[body] = rest + scene.floating_patterns(body) @ state.motion
        # The chord between both points rotates; a pressure in its middle does not rotate it.
        moved = condensed.contact_fields(scene, body, state.unknowns, points)[0]
        chord = points[1] - points[0]
        across = np.array([-chord[1], chord[0]])
        rows = scene.bodies[body].model.values_along(points, np.tile(across, (2, 1)))
        along = rows @ solved[body] + moved @ across
        rolled = sum(
            float(value)
            for (constraint, one), value in zip(scene.unknown_motions, state.motion, strict=True)
            if one.component == ROTATION and body in constraint.bodies and bends[0] > bends[1]
        )
        angles[pairing.name] += float((along[1] - along[0]) / (chord @ chord)) - rolled
    return angles


def unturned(
    condensed: Condensed,
    state: ContactState,
    turned: Mapping[str, float],
    held: Sequence[Mapping[str, FloatArray]],
) -> dict[str, float]:
    """Angles by which the directions of contact grids, now ``turned``, must rotate so that the contact forces
    of a state do no work along the ``held`` rigid motions (3,) of bodies about the origin; contacts that do
    none are omitted. Held rotations carry a moment, which does not depend on directions."""
    held = [motion for motion in held if not any(way[2] for way in motion.values())]
    if not held:
        return {}
    reach = max(float(np.hypot(*way[:2])) for motion in held for way in motion.values())
    work, along, sizes, pressed = np.zeros(len(held)), list[FloatArray](), dict[str, float](), 0.0
    for pairing in condensed.on_grids:
        span = condensed.spans[pairing.name]
        pressure, share = state.pressure[span], condensed.weight[span] * state.pressure[span]
        size = float(share.sum())
        if size <= 0.0:  # round-off where it is open
            continue
        force, middle = pairing.grid.resultants(True)[0] @ pressure, share @ pairing.grid.hats.place / size
        places = pairing.grid.facing.side(np.array([middle]), True)[0][0]
        more, before = turned.get(pairing.name, 0.0) - pairing.grid.facing.turn, complex(force[0], force[1])
        # The force rotates about the middle of its patch.
        push = before * np.exp(1j * more)
        moment = force[2] + (np.conj(places) * (push - before)).imag
        quarter = 1j * push
        bodies = [str(body) for body in (pairing.slave_body, pairing.master_body)]
        ways = [[motion.get(body, np.zeros(3)) for body in bodies] for motion in held]
        relative = np.array([slave - master for slave, master in ways])
        work += relative @ np.array([push.real, push.imag, moment])
        own = relative @ np.array([quarter.real, quarter.imag, (np.conj(places) * quarter).imag])
        if np.abs(own).max(initial=0.0) > CURVATURE_RANGE * size * reach:
            along.append(own / np.sqrt(size))
            sizes[pairing.name] = size
        pressed += size
    if not along or np.abs(work).max() <= MAX_CARRIED * pressed * reach:
        return {}
    least = np.linalg.lstsq(np.stack(along, axis=1), -work, rcond=CURVATURE_RANGE)[0]
    return {name: float(one / np.sqrt(size)) for (name, size), one in zip(sizes.items(), least, strict=True)}


MIN_SHIFT, MIN_ROTATION = 0.1, 1e-3
"""Rotations that move contacts by less than this part of their width, or below this angle (radian), need not
be caused by loads."""


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
        # No body turns that far before its strains are absurd.
        large = "check the units of the loads against those of the moduli; " if self.angle > np.pi else ""
        hold = f"hold {self.names} with a [[support]], take away what turns it, or use"
        return f'{large}{hold} model.strain = "finite"'

    @property
    def error(self) -> UnbalancedError | None:
        """The error, None if the rotation is resisted."""
        if self.share < INSTABILITY_RATIO:
            return None
        how, what = ("roll or tip", "them") if len(self.bodies) > 1 else ("rolls or tips", "it")
        message = f"{self.names} {how} over: the loads turn {what}, and nothing resists that"
        return UnbalancedError(message, self.hint)


def rolling(scene: Scene, condensed: Condensed, state: ContactState) -> UnbalancedError | None:
    """The error that loads rotate a body without resistance in a state, which then is not on any path."""
    turned = turned_by_loads(scene, condensed, state)
    return turned.error if turned else None


def turned_by_loads(scene: Scene, condensed: Condensed, state: ContactState) -> Turned | None:
    """The body rotated by loads with the largest omitted moment in a state; None if there is none."""
    _, motion, pressure, traction = state.unknowns
    turning, moments = list[int](), list[float]()
    for number, (constraint, one) in enumerate(scene.unknown_motions):
        angle = abs(float(motion[number]))
        if one.component != ROTATION or not constraint.bodies or angle <= MIN_ROTATION:
            continue
        forces, center = _forces(condensed, constraint.bodies, pressure, traction), constraint.center
        for points, force in forces:
            # Whether the contact moves along the surface as its body rotates.
            pressed = np.hypot(*force.T)
            width = np.hypot(*np.ptp(points[pressed > 0.0], axis=0))
            if angle * np.hypot(*(np.average(points, axis=0, weights=pressed) - center)) > MIN_SHIFT * width:
                turning.append(number)
                moments.append(sum(float(((at - center) * push).sum()) for at, push in forces))
                break
    if not turning:
        return None
    try:
        basis = Basis.near(condensed.problem, state.status)
    except SingularError:
        return None
    if basis.held.size:
        return None
    gap, slip, rotations = np.zeros_like(pressure), np.zeros_like(traction), list[FloatArray]()
    for number, moment in zip(turning, moments, strict=True):
        change = response(basis, gap, slip, moment * (np.arange(len(motion)) == number))
        rotations.append(change.motion[turning])
    shares, ways = np.linalg.eig(np.stack(rotations, axis=1))
    worst = int(np.argmax(shares.real))
    number = turning[int(np.argmax(np.abs(ways[:, worst])))]
    bodies = scene.unknown_motions[number][0].bodies
    return Turned(bodies, abs(float(motion[number])), float(shares.real[worst]))


def moment_error(scene: Scene, condensed: Condensed, unknowns: Sequence[FloatArray]) -> Turned | None:
    """The floating body whose contacts' omitted moment is the largest part, ``share``, of that of their
    tractions, in a state f, q, p, t; None if none has rotated. Where all nodes of its contacts slip, the
    loads that turn it are too large by this part."""
    (_, motion, pressure, traction), found = unknowns, list[Turned]()
    for (constraint, one), angle in zip(scene.unknown_motions, np.abs(motion), strict=True):
        if not constraint.floats or one.component != ROTATION or angle <= MIN_ROTATION:
            continue
        center = np.array(constraint.center)
        both = _forces(condensed, constraint.bodies, pressure, traction)
        along = _forces(condensed, constraint.bodies, np.zeros(len(pressure)), traction)
        omitted = angle * abs(sum(float(((at - center) * force).sum()) for at, force in both))
        carried = sum(abs(float(cross(at - center, force).sum())) for at, force in along)
        if carried > 0.0:
            found.append(Turned(constraint.bodies, float(angle), omitted / carried))
    return max(found, key=lambda one: one.share, default=None)


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
