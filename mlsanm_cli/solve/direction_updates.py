"""By how much bodies that move turn the directions in which contacts press, to first order.

Directions vary along a contact as the normals of the flatter surface do, which the other one is pressed to.
As bodies turn and move along each other the patch moves to where both normals are alike: its direction is the
base's normal, as drawn, turned by as much as the base is there. Where a round base is free to roll, it is as
drawn but for what bends it: the moment about its middle decides how far it rolls, and is right in a frame
that rolls with it. A straight side of a rigid obstacle has one normal, to which a body turns that rolls on
it: nothing turns there.

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
from mlsanm_cli.mechanics.body_model import BodyModel
from mlsanm_cli.mechanics.near_field import as_real
from mlsanm_cli.mechanics.rigid import ROTATION
from mlsanm_cli.mechanics.scene import Obstacle, Scene

CARRIED = 1e-8
"""What holds carry of all that presses is no more than this part of it."""
ASIDE = 0.01
"""Curvatures are looked at over this part of the range on both sides."""
STRAIGHT = 1e-6
"""Sides that bend by no more than this part of the other one are straight, but for round-off."""
BESIDE = 1.0
"""How a surface turns is seen from places so many widths of the patch beside its middle."""


def turns(scene: Scene, condensed: Condensed, state: ExactState) -> dict[str, float]:
    """Angles in radian, counter-clockwise, by which directions turn of contacts that touch in one patch."""
    found: dict[str, float] = {}
    solved: dict[str, FloatArray] = {}
    unknowns = state.factors, state.motion, state.pressure, state.traction
    for pairing in condensed.pairings:
        span, grid = condensed.spans[pairing.name], pairing.grid
        closed = np.flatnonzero(state.active[span])
        if grid is None or not len(closed) or closed[-1] - closed[0] >= len(closed):
            continue
        place, share = grid.hats.place, grid.hats.weight * state.pressure[span]
        if not share.sum() > 0.0:
            continue
        middle = float(share @ place / share.sum())
        drawn, bends = _seen(grid, middle)
        straight = bends[1] <= STRAIGHT * bends[0]
        if straight and (grid.facing.other is None or not bends[0]):
            found[pairing.name] = 0.0
            continue
        base = grid.facing.slave_first
        body = pairing.slave_body if base else pairing.master_body
        # Obstacles do not turn. Where both are curved and one may slide, what bends them would move it on at
        # every look.
        if body is None or (min(bends) > STRAIGHT * max(bends) and _moves(scene, pairing.bodies)):
            found[pairing.name] = drawn
            continue
        if body not in solved:
            rest = condensed.solution(scene, body, unknowns)[0][:, 0]
            solved[body] = rest + scene.floating_patterns(body) @ state.motion
        aside = BESIDE * float(place[closed[-1]] - place[closed[0]] + grid.hats.weight[closed].max())
        ends = np.clip([middle - aside, middle + aside], grid.first, grid.last)
        points = as_real(grid.facing.side(ends, base)[0])
        moved = condensed.contact_fields(scene, body, unknowns, points)[0]
        angle = _rotation(scene.bodies[body].model, points, solved[body], moved)
        rolled = _rolled(scene, body, state.motion) if bends[0] > bends[1] else 0.0
        found[pairing.name] = drawn + angle - rolled
    return found


def _moves(scene: Scene, bodies: Sequence[str | None]) -> bool:
    """Whether one of some bodies has unknown motions."""
    return any(
        name in constraint.bodies
        for constraint, _ in scene.unknown_motions
        if not isinstance(constraint, Obstacle)
        for name in bodies
    )


def _rolled(scene: Scene, body: str, motion: FloatArray) -> float:
    """The angle by which a body that may turn, or its plate, does so in a state with the unknown motions
    ``motion`` (k,)."""
    return sum(
        float(value)
        for (constraint, one), value in zip(scene.unknown_motions, motion, strict=True)
        if one.component == ROTATION and not isinstance(constraint, Obstacle) and body in constraint.bodies
    )


def _seen(grid: ContactGrid, middle: float) -> tuple[float, list[float]]:
    """The angle at the ``middle`` of a patch from the other surface's normal to the base's, both as drawn,
    and the curvatures of the base and of the other one."""
    offset = ASIDE * (grid.last - grid.first)
    base = grid.facing.slave_first
    s = np.array([middle, middle - offset, middle + offset])
    place, inward = grid.facing.side(s, base)
    there, outward = grid.facing.side(s, not base)
    sides = (place, inward), (there, outward)
    bends = [float(abs(np.angle(one[2] / one[1])) / abs(at[2] - at[1])) for at, one in sides]
    return float(np.angle(inward[0] / -outward[0])), bends


def _rotation(model: BodyModel, points: FloatArray, rest: FloatArray, moved: FloatArray) -> float:
    """The angle by which the chord between two ``points`` (2, 2) of a body turns, which have ``moved`` (2, 2)
    beyond what its nodes' displacements ``rest`` (2N,) say: what presses in its middle does not turn it."""
    chord = points[1] - points[0]
    across = np.array([-chord[1], chord[0]])
    along = model.values_along(points, np.tile(across, (2, 1))) @ rest + moved @ across
    return float((along[1] - along[0]) / (chord @ chord))


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
