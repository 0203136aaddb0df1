"""Where a contact may have a grid of its own: surfaces that face each other, up to known corners."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from mlsanm_cli.app.scene.contact_pairs import profile_of, shape_of
from mlsanm_cli.app.scene.corners import CLEAR, Ends, Restraints, ends_of
from mlsanm_cli.app.scene.default_spacing import valleys
from mlsanm_cli.app.scene.void import void_center
from mlsanm_cli.arrays import BoolArray, FloatArray
from mlsanm_cli.case import Case
from mlsanm_cli.cloud.cloud import Cloud, continuations
from mlsanm_cli.cloud.curves import Curve
from mlsanm_cli.cloud.joined import corners_of, points_of
from mlsanm_cli.cloud.surface import Surface
from mlsanm_cli.contact.geometry.contact_grid import Facing
from mlsanm_cli.contact.geometry.contact_range import ContactRange
from mlsanm_cli.contact.geometry.obstacles import Chain
from mlsanm_cli.contact.geometry.pairing import OPPOSED, Pairing
from mlsanm_cli.mechanics.body import BodyModel
from mlsanm_cli.mechanics.near_field import as_complex, as_real

ALIKE = 1e-9
"""Curvatures that differ by less are the same."""
TOUCHING = 1e-6
"""Gaps that differ by less than this part of the range are the same: such surfaces touch all along."""
SHALLOW = 1e-3
"""The same as a part of what profiles differ by, which may be shallower."""
SNAP = 1.5
"""Ends of a range are ends of a surface that are no more looks away."""
LOOKED_AT, PROFILED, LOOKS_PER_POINT = 800, 4000, 2
RAYS = 17
LOOKS = 8


def contact_ranges(
    case: Case,
    models: Mapping[str, BodyModel],
    pairings: tuple[Pairing, ...],
    held: Mapping[str, Restraints],
) -> dict[str, ContactRange]:
    """The contacts that may have grids of their own, by name; not so on surfaces of bodies that are ``held``
    or have springs."""
    if case.mls.scheme != "least-squares" or case.solver.formulation != "condensed":
        return {}
    found = {
        pairing.name: _clear(case, models, pairing, held)
        for pairing in pairings
        if pairing.slave.name not in held[pairing.slave_body]
        and (pairing.master is None or pairing.master.name not in held[str(pairing.master_body)])
    }
    return {name: one for name, one in found.items() if one is not None}


def directed(pairings: tuple[Pairing, ...], clear: Mapping[str, ContactRange]) -> tuple[Pairing, ...]:
    """The pairs of nodes with the directions that pressures have on grids."""
    result = []
    for pairing in pairings:
        if pairing.name in clear:
            facing = clear[pairing.name].facing
            pairing = replace(pairing, normal=facing.normal(facing.locate(pairing.points)))
        result.append(pairing)
    return tuple(result)


def _clear(
    case: Case, models: Mapping[str, BodyModel], pairing: Pairing, held: Mapping[str, Restraints]
) -> ContactRange | None:
    if pairing.master_body == pairing.slave_body or pairing.bonded:
        return None
    facing = _facing(case, pairing)
    base = facing.base
    # Looked at along the base, so that roles do not decide which of several alike places is taken.
    sign, ahead = (1.0 if facing.slave_first else -1.0), replace(facing, slave_first=True)
    looks = LOOKED_AT if facing.profile is None else PROFILED
    looks = max(looks, LOOKS_PER_POINT * max(map(points_of, facing.curves)))
    s = np.linspace(0.0, base.length, looks + 1)[: looks if base.closed else looks + 1]
    points, partner, normal = ahead.opposite(s)
    away, outward = points - partner, as_real(-ahead.side(s, True)[1])
    gap = ahead.gap(s)
    offset = np.abs(away[:, 0] * normal[:, 1] - away[:, 1] * normal[:, 0])
    across = (outward * normal).sum(axis=1)
    faces = (across < OPPOSED) & (offset <= TOUCHING * base.length)
    if not faces.any():
        return None
    ends = [ends_of(models[body], pairing.surface_of(slave), held[body]) for body, slave, _ in pairing.sides]
    off = faces & _off_corners(pairing, models, facing, sign * s, ends)
    slack = TOUCHING * base.length
    if facing.profile is not None:
        slack = min(slack, SHALLOW * float(np.ptp(gap[faces])))
    least = gap[faces].min() + slack
    touching = np.flatnonzero(off & (gap <= least))
    if not len(touching):
        return None
    nearest = int(touching[len(touching) // 2])
    if base.closed and not off.all():
        # The row of places begins where none faces.
        turn = int(np.flatnonzero(~off)[0])
        off, gap, faces = (np.roll(one, -turn) for one in (off, gap, faces))
        s = np.concatenate([s[turn:], s[:turn] + base.length])
        nearest = (nearest - turn) % len(s)
    elif base.closed:
        turn = int(np.argmax(gap))
        off, gap = np.roll(off, -turn), np.roll(gap, -turn)
        s = np.concatenate([s[turn:], s[:turn] + base.length])
        nearest = (nearest - turn) % len(s)
    stretch = _stretch(off, nearest)
    if stretch is None:
        return None
    around = base.closed and bool(off.all())
    first, last = float(s[stretch[0]]), float(s[0] + base.length if around else s[stretch[1]])
    corners = [tuple(one for one in both if one is not None) for both in ends]
    tips = [corner.tip for both in corners for corner in both]
    if isinstance(facing.obstacle, Chain):
        tips += as_complex(facing.obstacle.points[~facing.obstacle.smooth]).tolist()
    exact_ends = base.closest(as_real(np.array(tips, dtype=np.complex128))).tolist()
    step = SNAP * float(s[1] - s[0])
    snapped = [_snapped(one, exact_ends, step) for one in (first, last)]
    whole = around or snapped[0] is not None, around or snapped[1] is not None
    first, last = (one if exact is None else exact for one, exact in zip((first, last), snapped, strict=True))
    rays = np.linspace(first, last, RAYS)
    centers: list[complex | None] = []
    for body, slave in zip(pairing.bodies, (True, False), strict=False):
        found = void_center(models[body].cloud, *facing.side(sign * rays, slave))
        if not found:
            return None
        centers += found
    closest = _minimum(ahead, max(s[max(nearest - 1, 0)], first), min(s[min(nearest + 1, len(s) - 1)], last))
    if not facing.slave_first:
        first, last, whole = -last, -first, whole[::-1]
    both = centers[0], centers[1] if len(centers) > 1 else None
    of_bodies = corners[0], corners[1] if len(corners) > 1 else ()
    places = len(valleys(gap[stretch[0] : stretch[1] + 1], slack))
    return ContactRange(facing, first, last, sign * closest, both, of_bodies, whole, places, around)


def _snapped(s: float, ends: list[float], step: float) -> float | None:
    """The end nearest to a place if it is so near."""
    nearest = min(ends, key=lambda end: abs(end - s), default=np.inf)
    return nearest if abs(nearest - s) <= step else None


def _facing(case: Case, pairing: Pairing) -> Facing:
    """The surfaces of a contact; the more curved one is the base, so that the flatter one gives the direction
    of pressures."""
    contact = next(one for one in case.contact if one.name == pairing.name)
    slave, master = pairing.slave, pairing.master
    if master is None:
        assert contact.obstacle is not None
        return Facing(slave.curve, None, shape_of(contact.obstacle), profile=profile_of(contact))
    touching = pairing.gap <= pairing.gap.min() + TOUCHING * float(np.ptp(pairing.points, axis=0).max())
    own = _curved(slave.curve, pairing.points, touching)
    opposite = _curved(master.curve, pairing.partner, touching)
    slave_first = pairing.names[0] < pairing.names[1]
    for one, other in zip(own, opposite, strict=True):
        if abs(one - other) > ALIKE * max(one, other):
            slave_first = one > other
            break
    curves = (slave.curve, master.curve) if slave_first else (master.curve, slave.curve)
    return Facing(*curves, None, slave_first, profile=profile_of(contact))


def _curved(curve: Curve, points: FloatArray, touching: BoolArray) -> tuple[float, float]:
    """How curved a surface is where it is ``touching`` (w,) at first, among points (w, 2) on it, and in the
    mean over all of them: flat faces differ in how their edges are rounded, and a joint has two."""
    curvature = np.abs(curve.curvature(curve.closest(points)))
    return float(curvature[touching].min()), float(curvature.mean())


def _off_corners(
    pairing: Pairing, models: Mapping[str, BodyModel], facing: Facing, s: FloatArray, ends: Sequence[Ends]
) -> BoolArray:
    """Whether places (e,) are off those ends of both surfaces that fields do not know."""
    off = np.ones(len(s), dtype=bool)
    for (body, slave, _), known in zip(pairing.sides, ends, strict=True):
        surface = pairing.surface_of(slave)
        curve, spacing = surface.curve, models[body].cloud.spacing[surface.index]
        arc = curve.closest(as_real(facing.side(s, slave)[0]))
        corners = list(corners_of(curve))
        if not curve.closed:
            smooth = _continues(models[body].cloud, surface)
            ends_of = zip((0.0, curve.length), known, smooth, strict=True)
            corners += [end for end, one, on in ends_of if one is None and not on]
        for corner, near in zip(corners, np.interp(corners, surface.arc_length, spacing), strict=True):
            apart = np.abs(arc - corner)
            if curve.closed:
                apart = np.minimum(apart, curve.length - apart)
            off &= apart >= CLEAR * near
    return off


def _continues(cloud: Cloud, surface: Surface) -> tuple[bool, bool]:
    """Whether the outline continues smoothly where an open surface begins, and where it ends, as it does
    where a part of a boundary is in contact, or, under any name, behind a rounded edge, which faces away
    there."""
    stems = {part.name.partition("/")[0] for part, _ in surface.members}
    rounded = surface.curve.curvature(np.array([0.0, surface.curve.length])) > 0.0
    found = {
        place
        for place, name in continuations(cloud, surface)
        if rounded[place] or name.partition("/")[0] in stems
    }
    return 0 in found, -1 in found


def _minimum(facing: Facing, first: float, last: float) -> float:
    """Where between two places the gap is smallest, by ever finer looks."""
    for _ in range(LOOKS):
        s = np.linspace(first, last, RAYS)
        least = int(np.argmin(facing.gap(s)))
        first, last = s[max(least - 1, 0)], s[min(least + 1, len(s) - 1)]
    return 0.5 * float(first + last)


def _stretch(chosen: BoolArray, inside: int) -> tuple[int, int] | None:
    """First and last of the run of ``chosen`` places that one lies in; None if it is none of them."""
    if not chosen[inside]:
        return None
    before, after = np.flatnonzero(~chosen[:inside]), np.flatnonzero(~chosen[inside:])
    first = int(before[-1]) + 1 if len(before) else 0
    last = inside + int(after[0]) - 1 if len(after) else len(chosen) - 1
    return (first, last) if last > first else None
