"""Surfaces of a contact that face each other, and sharp corners that touch with both of their sides."""

from __future__ import annotations

import math

import numpy as np

from mlsanm_cli.app.scene.contact_pairs import profile_of, shape_of
from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.case import Case, rounded
from mlsanm_cli.cloud.curves import Curve
from mlsanm_cli.contact.geometry.facing import Facing
from mlsanm_cli.contact.geometry.pairing import Pairing
from mlsanm_cli.errors import CaseError, CaseProblem
from mlsanm_cli.roundoff import COARSE_ROUND_OFF

ALIKE = 1e-3
"""Curvatures that differ by less than this part are alike, as those of splines through points may be, and so
are minima of gaps that differ by less than this part of the height of a gap profile."""
RAYS, MINIMUM_PASSES = 17, 8
"""Samples of a gap between which its minimum is searched for, and number of refinements."""
TIP_SAMPLES = 400
"""Samples of the gap along a surface with a corner."""
ASIDE = 0.01
"""Distance from a corner at which its sides are looked at, relative to the surface."""
MAX_OPENING = math.sin(math.radians(60.0))
"""Gap over distance from the corner above which a side stays open."""


def facing_of(case: Case, pairing: Pairing) -> Facing:
    """The surfaces of a contact; the more curved one is the base, and the flatter one defines the direction
    of pressures."""
    contact = next(contact for contact in case.contact if contact.name == pairing.name)
    slave, profile = pairing.slave, profile_of(contact)
    obstacle = None if contact.obstacle is None else shape_of(contact.obstacle)
    master = obstacle.curve if obstacle else pairing.surface_of(False).curve
    if master is None:
        return Facing(slave.curve, None, obstacle, profile=profile)
    touching = pairing.gap <= pairing.gap.min() + COARSE_ROUND_OFF * float(
        np.ptp(pairing.points, axis=0).max()
    )
    at = pairing.points[touching], pairing.partner[touching]
    if touching.sum() == 1:
        at = _touching(Facing(slave.curve, None if obstacle else master, obstacle), at[0], pairing.points)
    slave_first = obstacle is not None or pairing.names[0] < pairing.names[1]
    sides = _curved(slave.curve, at[0], pairing.points), _curved(master, at[1], pairing.partner)
    for curved, opposite in zip(*sides, strict=True):
        if abs(curved - opposite) > ALIKE * max(curved, opposite):
            slave_first = curved > opposite
            break
    if obstacle and slave_first:
        return Facing(slave.curve, None, obstacle, profile=profile)
    curves = (slave.curve, master) if slave_first else (master, slave.curve)
    return Facing(*curves, obstacle, slave_first, profile=profile)


def _touching(facing: Facing, point: FloatArray, points: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Where two surfaces are nearest, (1, 2) on either, if of the ``points`` (w, 2) on the first the nearest
    is ``point`` (1, 2)."""
    away = np.sort(np.hypot(*(points - point).T))
    aside = float(away[min(2, len(away) - 1)])
    (middle,) = facing.locate(point)
    first, last = middle - aside, middle + aside
    if not facing.base.closed:
        first, last = max(first, 0.0), min(last, facing.base.length)
    there, partner, _ = facing.opposite(np.array([minimum(facing, first, last)]))
    return there, partner


def _curved(curve: Curve, at: FloatArray, points: FloatArray) -> tuple[float, float]:
    """Least curvature of a surface where it initially touches, ``at`` places (k, 2) on it, and the mean over
    its ``points`` (w, 2): flat faces may differ in the rounding of their edges only."""
    touching, whole = (np.abs(curve.curvature(curve.closest(places))) for places in (at, points))
    return float(touching.min()), float(whole.mean())


def minimum(facing: Facing, first: float, last: float) -> float:
    """The arc length between two others at which the gap is smallest, by successive refinement."""
    for _ in range(MINIMUM_PASSES):
        s = np.linspace(first, last, RAYS)
        least = int(np.argmin(facing.gap(s)))
        first, last = s[max(least - 1, 0)], s[min(least + 1, len(s) - 1)]
    return 0.5 * float(first + last)


def check_tips(case: Case, pairings: tuple[Pairing, ...]) -> None:
    """CaseError if a surface touches first at a corner within itself from which both of its sides open
    slowly: a contact grid ends at the corner, and what the other side carries would be missed."""
    problems = []
    for pairing in pairings:
        sides = zip((pairing.slave, pairing.master), pairing.bodies, ("slave", "master"), strict=False)
        for surface, body, role in () if pairing.bonded else sides:
            corners = np.zeros(0) if surface is None else surface.curve.corners
            for place in surface.curve.points(corners) if surface is not None and len(corners) else ():
                if _is_tip(facing_of(case, pairing), place):
                    x, y = place
                    message = (
                        f"body {body} touches with its sharp corner at ({x:.6g}, {y:.6g}), on both sides of "
                        "which pressures would be unbounded"
                    )
                    hint = (
                        f"{rounded(case, body)}, and add the name of the arc to contact.{pairing.name}.{role}"
                    )
                    problems.append(CaseProblem(f"contact.{pairing.name}", message, hint=hint))
    if problems:
        raise CaseError(tuple(problems))


def _is_tip(facing: Facing, place: FloatArray) -> bool:
    base, size = facing.base, facing.base.length
    at = float(facing.locate(place[None])[0])
    if not (base.closed or ASIDE * size < abs(at) < (1.0 - ASIDE) * size):
        return False
    tip, *sides = facing.gap(np.array([at, at - ASIDE * size, at + ASIDE * size]))
    opening = (np.array(sides) - tip) / (ASIDE * size)
    sign = 1.0 if facing.slave_first else -1.0
    least = float(facing.gap(sign * np.linspace(0.0, size, TIP_SAMPLES)).min())
    return bool(
        tip <= least + COARSE_ROUND_OFF * size
        and opening.min() > COARSE_ROUND_OFF
        and opening.max() < MAX_OPENING
    )
