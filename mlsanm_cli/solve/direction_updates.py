"""By how much bodies that move turn the directions in which contacts press, to first order.

Directions vary along a contact as the normals of the flatter surface do, which the other one is pressed to.
As bodies turn and move along each other the patch moves on the more curved one to where its normal has the
direction of the pressures: so it is for all small rigid motions of both, if the normals are those drawn, and
turn with their body. A straight side of a rigid obstacle has one normal, to which a body that rolls on it
turns: nothing turns there.

A body that nothing resists in a direction, as a plate that may slide on two round posts, is held there. Where
it bends, the posts press on it along normals that have turned, and at first order nothing but the hold could
balance what these pushes differ by: no place nearby would. What the directions have in common is taken off
them, so that the hold carries nothing.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.contact.geometry.contact_grid import ContactGrid
from mlsanm_cli.contact.laws.active_set import ExactState
from mlsanm_cli.contact.response.condensed import Condensed
from mlsanm_cli.mechanics.rigid import ROTATION
from mlsanm_cli.mechanics.scene import Obstacle, Scene

CARRIED = 1e-8
"""What holds carry of all that presses is no more than this part of it."""
ASIDE = 0.01
"""Curvatures are looked at over this part of the range on both sides."""
ALIKE = 1e-3
"""Curvatures that differ by less than this part are alike: patches move on both surfaces."""
STRAIGHT = 1e-6
"""Sides that bend by no more than this part of the other one are straight, but for round-off."""


def turns(scene: Scene, condensed: Condensed, state: ExactState) -> dict[str, float]:
    """Angles in radian, counter-clockwise, by which directions turn of contacts that touch in one patch."""
    found, turned = {}, _rotations(scene, state)
    for pairing in condensed.pairings:
        span = condensed.spans[pairing.name]
        closed = np.flatnonzero(state.active[span])
        if pairing.grid is None or not len(closed) or closed[-1] - closed[0] >= len(closed):
            continue
        share = pairing.grid.hats.weight * state.pressure[span]
        if share.sum() > 0.0:
            middle = float(share @ pairing.grid.hats.place / share.sum())
            base = pairing.slave_body if pairing.grid.facing.slave_first else pairing.master_body
            found[pairing.name] = _turn(pairing.grid, middle, turned.get(base or "", 0.0))
    return found


def _rotations(scene: Scene, state: ExactState) -> dict[str, float]:
    """Angles by which bodies turn that nothing else holds against it."""
    found: dict[str, float] = {}
    for number, (constraint, motion) in enumerate(scene.unknown_motions):
        if motion.component == ROTATION and motion.alone and not isinstance(constraint, Obstacle):
            found.update(dict.fromkeys(constraint.bodies, float(state.motion[number])))
    return found


def _turn(grid: ContactGrid, middle: float, rotation: float) -> float:
    """The angle at the ``middle`` of a patch from the normal of the flatter surface to the more curved, whose
    body has turned by its ``rotation``; zero on a straight side of an obstacle."""
    offset = ASIDE * (grid.last - grid.first)
    base = grid.facing.slave_first
    s = np.array([middle, middle - offset, middle + offset])
    place, inward = grid.facing.side(s, base)
    there, outward = grid.facing.side(s, not base)
    bends = [
        abs(np.angle(one[2] / one[1])) / abs(at[2] - at[1]) for at, one in ((place, inward), (there, outward))
    ]
    if bends[0] <= (1.0 - ALIKE) * bends[1] or (
        grid.facing.obstacle is not None and bends[1] <= STRAIGHT * bends[0]
    ):
        return 0.0
    return float(np.angle(inward[0] / -outward[0])) + rotation


def unturned(
    condensed: Condensed,
    state: ExactState,
    turned: Mapping[str, float],
    held: Sequence[Mapping[str, FloatArray]],
) -> dict[str, float]:
    """By which angles the directions of contacts on grids have to turn beyond those to which they are
    ``turned``, so that what they exert in a state does no work along motions that are ``held``, as rigid
    motions (3,) of bodies about the origin; those that do none already are left out.

    Bodies held against turning feel a moment, and no force: directions do not matter to it.
    """
    held = [motion for motion in held if not any(way[2] for way in motion.values())]
    if not held:
        return {}
    work, along, names = np.zeros(len(held)), list[FloatArray](), list[str]()
    pressed = 0.0
    for pairing in condensed.pairings:
        span = condensed.spans[pairing.name]
        size = float(condensed.weight[span] @ state.pressure[span])
        if pairing.grid is None or not size:
            continue
        force = pairing.grid.resultants(True, (0.0, 0.0))[0] @ state.pressure[span]
        middle = condensed.weight[span] * state.pressure[span] @ pairing.grid.hats.place / size
        places = pairing.grid.facing.side(np.array([middle]), True)[0][0]
        more = turned.get(pairing.name, 0.0) - pairing.grid.facing.turn
        # As the force turns about the middle of its patch.
        push = complex(force[0], force[1]) * np.exp(1j * more)
        moment = force[2] + (np.conj(places) * (push - complex(force[0], force[1]))).imag
        quarter = 1j * push
        own = np.zeros(len(held))
        for number, motion in enumerate(held):
            ways = [motion.get(str(body), np.zeros(3)) for body in (pairing.slave_body, pairing.master_body)]
            way = ways[0] - ways[1]
            work[number] += way @ np.array([push.real, push.imag, moment])
            own[number] = way @ np.array([quarter.real, quarter.imag, (np.conj(places) * quarter).imag])
        if np.abs(own).max(initial=0.0) > ASIDE * size * _reach(held):
            along.append(own / np.sqrt(size))
            names.append(pairing.name)
        pressed += size
    if not along or np.abs(work).max() <= CARRIED * pressed * _reach(held):
        return {}
    sizes = [float(condensed.weight[condensed.spans[n]] @ state.pressure[condensed.spans[n]]) for n in names]
    least = np.linalg.lstsq(np.stack(along, axis=1), -work, rcond=ASIDE)[0] / np.sqrt(sizes)
    return {name: float(angle) for name, angle in zip(names, least, strict=True)}


def _reach(held: Sequence[Mapping[str, FloatArray]]) -> float:
    """The size of the held motions."""
    return max(float(np.hypot(*way[:2])) for motion in held for way in motion.values())
