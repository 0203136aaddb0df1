"""By how much bodies that move turn the directions in which contacts press, to first order.

Directions are taken from the surfaces as they are drawn. Where the surface that tells them turns by w, and
the other one moves along it by d, they turn by w + k d, with its curvature k.
"""

from __future__ import annotations

import numpy as np

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.contact.active_set import ExactState
from mlsanm_cli.contact.condensed import Condensed
from mlsanm_cli.contact.near import Near
from mlsanm_cli.contact.obstacles import Chain
from mlsanm_cli.contact.pairing import Pairing
from mlsanm_cli.mechanics.near_field import ComplexArray, as_complex, as_real
from mlsanm_cli.mechanics.scene import Obstacle, Scene

ASIDE = 0.02
"""Curvatures are looked at over this part of the range on both sides."""
MOST = 0.3
"""Turns beyond are no small ones: first order says nothing of them."""


def turns(condensed: Condensed, scene: Scene, state: ExactState) -> dict[str, float]:
    """Angles in radian, counter-clockwise, by which directions turn of contacts on grids that touch."""
    found = {}
    for pairing in condensed.pairings:
        pressure = state.pressure[condensed.spans[pairing.name]]
        if (
            pairing.near is None
            or isinstance(pairing.near.facing.obstacle, Chain)
            or not pressure.max() > 0.0
        ):
            continue
        angle = _turn(condensed, scene, pairing, pairing.near, state)
        if abs(angle) <= MOST:
            found[pairing.name] = angle
    return found


def _turn(condensed: Condensed, scene: Scene, pairing: Pairing, near: Near, state: ExactState) -> float:
    pressure = np.maximum(state.pressure[condensed.spans[pairing.name]], 0.0)
    place, share = near.hats.place, near.hats.weight * pressure
    touching = np.flatnonzero(pressure > 0.0)
    middle = float(share @ place / share.sum())
    first, last = near.hats.nodes[touching[0]], near.hats.nodes[touching[-1] + 2]
    aside = ASIDE * (near.last - near.first)
    s = np.array([first, middle, last, middle - aside, middle + aside])
    facing = near.facing
    told = not facing.slave_first
    points, inward = facing.side(s, told)
    outward = -inward
    moved = _moved(condensed, scene, pairing, told, as_real(points[:3]), state)
    base = _moved(condensed, scene, pairing, not told, as_real(facing.side(s[:3], not told)[0]), state)
    way = points[4] - points[3]
    curvature = float(np.angle(outward[4] / outward[3])) / abs(way) if abs(way) > 0.0 else 0.0
    turned = 0.0
    if facing.other is not None and abs(points[2] - points[0]) > 0.0:
        chord = points[2] - points[0]
        turned = float((np.conj(chord) * (moved[2] - moved[0])).imag) / abs(chord) ** 2
    along = 1j * outward[1]
    # The curvature's sign is that of the turn along the surface with the material on the left.
    sense = 1.0 if (np.conj(along) * way).real > 0.0 else -1.0
    return turned + sense * curvature * float((np.conj(along) * (base[1] - moved[1])).real)


def _moved(
    condensed: Condensed, scene: Scene, pairing: Pairing, slave: bool, points: FloatArray, state: ExactState
) -> ComplexArray:
    """Displacements (e,) of points (e, 2) on one of the two surfaces."""
    body = pairing.slave_body if slave else pairing.master_body
    if body is None:
        return np.full(len(points), _of_obstacle(scene, pairing.name, state))
    unknowns = (state.factors, state.motion, state.pressure, state.traction)
    model = scene.bodies[body].model
    rest = condensed.solution(scene, body, unknowns)[0][:, 0] + scene.loose_patterns(body) @ state.motion
    parts = [model.values_along(points, np.tile(axis, (len(points), 1))) @ rest for axis in np.eye(2)]
    return as_complex(np.stack(parts, axis=1) + condensed.near_fields(scene, body, unknowns, points)[0])


def _of_obstacle(scene: Scene, contact: str, state: ExactState) -> complex:
    total: complex = 0j
    unknown = 0
    for mover in scene.movers:
        for motion in mover.motions:
            given = motion.prescribed
            amount = float(state.motion[unknown] if given is None else given @ state.factors)
            if isinstance(mover, Obstacle) and mover.contact == contact and motion.component < 2:
                total += complex(amount) if motion.component == 0 else 1j * amount
            unknown += motion.prescribed is None
    return complex(total)
