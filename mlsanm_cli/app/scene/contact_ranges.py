"""Ranges of contact grids: surfaces that face each other, up to corners with known fields."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace

import numpy as np

from mlsanm_cli.app.scene.clouds import valleys
from mlsanm_cli.app.scene.contact_pairs import ALIKE, RAYS, facing_of, minimum
from mlsanm_cli.app.scene.corners import (
    END_CLEARANCE,
    Restraints,
    SmoothPart,
    shared_planes,
    stretches_of,
    void_center,
)
from mlsanm_cli.arrays import BoolArray, FloatArray, IntArray
from mlsanm_cli.case import Case
from mlsanm_cli.cloud.curves import Curve
from mlsanm_cli.cloud.membership import cross
from mlsanm_cli.cloud.surface import Surface
from mlsanm_cli.contact.geometry.contact_grid import ContactRange, Pin
from mlsanm_cli.contact.geometry.facing import Facing, turned
from mlsanm_cli.contact.geometry.obstacles import Chain
from mlsanm_cli.contact.geometry.pairing import MAX_FACING_COSINE, Pairing
from mlsanm_cli.mechanics.body_model import BodyModel
from mlsanm_cli.mechanics.near_field import as_complex, as_real
from mlsanm_cli.mechanics.symmetry import images_of
from mlsanm_cli.roundoff import COARSE_ROUND_OFF, ROUND_OFF

SNAP_SAMPLES = 1.5
"""The end of a range is moved to the end of a surface within so many samples."""
SAMPLES, PROFILE_SAMPLES, SAMPLES_PER_POINT = 800, 4000, 2
"""Samples of the gap along the base, with a gap profile, and at least for each data point of a surface."""


def contact_ranges(
    case: Case,
    models: Mapping[str, BodyModel],
    pairings: tuple[Pairing, ...],
    held: Mapping[str, Restraints],
    fixed: Mapping[str, Collection[str]],
    held_nodes: Mapping[str, Collection[tuple[int, int]]],
) -> dict[str, ContactRange]:
    """The contacts that may have contact grids, by name: none on surfaces that are ``held`` or have springs.
    Surfaces ``fixed`` at zero displacement may be planes of symmetry; ``held_nodes`` are single ones, by
    component."""
    if case.is_regularized:
        return {}
    touching: dict[str, set[str]] = {name: set() for name in models}
    for pairing in pairings:
        for body, slave, _ in pairing.sides:
            touching[body] |= {part.name for part, _ in pairing.surface_of(slave).members}
    ranges = {}
    for pairing in pairings:
        surfaces = [(pairing.surface_of(slave).name, body) for body, slave, _ in pairing.sides]
        if not any(name in held[body] for name, body in surfaces):
            clear = _clear(case, models, pairing, held, touching, fixed)
            if clear is not None:
                pins = _pins(clear.facing, pairing, models, held_nodes)
                ranges[pairing.name] = replace(clear, pins=pins)
    return ranges


def _pins(
    facing: Facing,
    pairing: Pairing,
    models: Mapping[str, BodyModel],
    held_nodes: Mapping[str, Collection[tuple[int, int]]],
) -> tuple[Pin, ...]:
    """The single held nodes on the surfaces of a contact that it does not push on."""
    found = []
    for body, slave, _ in pairing.sides:
        model = models[body]
        for node in dict.fromkeys(node for node, _ in held_nodes[body]):
            point = model.cloud.points[[node]]
            place = facing.locate(point)
            away = np.abs(facing.side(place, slave)[0] - as_complex(point))
            if away[0] <= COARSE_ROUND_OFF * facing.base.length:
                held = [axis for own, axis in held_nodes[body] if own == node]
                # What carries load at a point moves without bound next to it, and holds a spacing around.
                along = facing.opposite(place)[2][0, held]
                pushed = pairing.friction or np.abs(along).max() > COARSE_ROUND_OFF
                found += [] if pushed else [Pin(node, slave, float(place[0]), model.kernel)]
    return tuple(found)


def directed(pairings: tuple[Pairing, ...], clear: Mapping[str, ContactRange]) -> tuple[Pairing, ...]:
    """The pairings with the directions of pressures on grids, and without candidates outside their ranges."""
    result = []
    for pairing in pairings:
        limits = clear.get(pairing.name)
        if limits is not None:
            s = limits.facing.locate(pairing.points)
            within = limits.within(s) & pairing.candidate
            candidate = within if within.sum() > 1 else pairing.candidate
            pairing = replace(pairing, normal=limits.facing.opposite(s)[2], candidate=candidate)
        result.append(pairing)
    return tuple(result)


def _clear(
    case: Case,
    models: Mapping[str, BodyModel],
    pairing: Pairing,
    held: Mapping[str, Restraints],
    touching: Mapping[str, Collection[str]],
    fixed: Mapping[str, Collection[str]],
) -> ContactRange | None:
    """The range of a contact around the place where its surfaces are nearest, None if that is at a corner or
    without a place at which fields of forces end."""
    if pairing.master_body == pairing.slave_body or pairing.bonded:
        return None
    facing = facing_of(case, pairing)
    base = facing.base
    # Sampled along the base, so that roles do not decide which of several equal minima is taken.
    sign, ahead = (1.0 if facing.slave_first else -1.0), replace(facing, slave_first=True)
    count = SAMPLES if facing.profile is None else PROFILE_SAMPLES
    count = max(count, SAMPLES_PER_POINT * max(curve.data_points for curve in facing.curves))
    s = np.linspace(0.0, base.length, count + 1)[: count if base.closed else count + 1]
    slack = COARSE_ROUND_OFF * base.length
    points, partner, normal = ahead.opposite(s)
    gap, across = ahead.gap(s), (as_real(-ahead.side(s, True)[1]) * normal).sum(axis=1)
    faces = (across < MAX_FACING_COSINE) & (np.abs(cross(points - partner, normal)) <= slack)
    if not faces.any():
        return None
    surfaces = [pairing.surface_of(slave) for _, slave, _ in pairing.sides]
    bodies = list(zip(surfaces, pairing.bodies, strict=True))
    stretches = [stretches_of(models[b], one, held[b], touching[b], fixed[b]) for one, b in bodies]
    stretches = shared_planes(stretches, slack)
    numbers, off = [], faces.copy()
    for surface, parts, (body, slave, _) in zip(surfaces, stretches, pairing.sides, strict=True):
        places = as_real(facing.side(sign * s, slave)[0])
        number, away_from_ends = _located(models[body], surface, parts, places)
        numbers.append(number)
        off &= away_from_ends
    alike = slack if facing.profile is None else min(slack, ALIKE * float(np.ptp(gap[faces])))
    close = np.flatnonzero(off & (gap <= gap[faces].min() + alike))
    # Without a place away from corners, or touching on both sides of one.
    if not len(close) or any(len(np.unique(number[close])) > 1 for number in numbers):
        return None
    nearest = int(close[len(close) // 2])
    for number in numbers:
        off &= number == number[nearest]
    chosen = [parts[number[nearest]] for parts, number in zip(stretches, numbers, strict=True)]
    if base.closed:
        # Start the samples where the surfaces do not face each other, or are farthest apart.
        turn = int(np.argmax(gap) if off.all() else np.argmin(off))
        off, gap = np.roll(off, -turn), np.roll(gap, -turn)
        s = np.concatenate([s[turn:], s[:turn] + base.length])
        nearest = (nearest - turn) % len(s)
    before, after = np.flatnonzero(~off[:nearest]), np.flatnonzero(~off[nearest:])
    low = int(before[-1]) + 1 if len(before) else 0
    high = nearest + int(after[0]) - 1 if len(after) else len(off) - 1
    if high <= low:
        return None
    around = base.closed and bool(off.all())
    sampled = float(s[low]), float(s[0] + base.length if around else s[high])
    exact = _exact_ends(facing, [one.curve for one in surfaces], chosen)
    step = SNAP_SAMPLES * float(s[1] - s[0])
    closest_ends = [min((abs(end - at), end) for end in (*exact, np.inf)) for at in sampled]
    snapped = [end if away <= step else None for away, end in closest_ends]
    symmetric = [plane for part in chosen for plane in part.planes if plane is not None]
    tips = [None if end is None else as_complex(base.points(np.array([end]))) for end in snapped]
    one, other = (
        next((p for p in symmetric if tip is not None and abs(float(p.height(tip)[0])) <= slack), None)
        for tip in tips
    )
    whole, planes = (around or snapped[0] is not None, around or snapped[1] is not None), (one, other)
    first, last = (at if end is None else end for end, at in zip(snapped, sampled, strict=True))
    inset = ROUND_OFF * base.length  # at a corner: the normal of the stretch
    rays = sign * np.linspace(first + inset, last - inset, RAYS)
    images = images_of([plane for plane in planes if plane is not None])
    corners = [tuple(filter(None, part.corners)) for part in chosen]
    centers = [
        void_center(models[body].cloud, *facing.side(rays, slave), images)
        for body, slave in zip(pairing.bodies, (True, False), strict=False)
    ]
    if not all(centers):
        return None
    closest = minimum(ahead, max(s[max(nearest - 1, 0)], first), min(s[min(nearest + 1, len(s) - 1)], last))
    if not facing.slave_first:
        first, last, whole, planes = -last, -first, (whole[1], whole[0]), (other, one)
    ends = centers[0][0], centers[1][0] if len(centers) > 1 else None
    sharp = corners[0], corners[1] if len(corners) > 1 else ()
    minima = len(valleys(gap[low : high + 1], alike))
    return ContactRange(facing, first, last, sign * closest, ends, sharp, planes, whole, minima, around)


def _exact_ends(facing: Facing, curves: Sequence[Curve], parts: Sequence[SmoothPart]) -> list[float]:
    """Arc lengths on the base opposite the ends of stretches of both surfaces up to which pressures may
    extend, and the corners of an obstacle."""
    base, tips = facing.base, [np.zeros((0, 2))]
    for curve, part in zip(curves, parts, strict=True):
        reached = [known or divided for known, divided in zip(part.known, part.divided, strict=True)]
        ends = np.array([part.first, part.last])[reached]
        tips.append(curve.points(np.mod(ends, curve.length) if curve.closed else ends))
    if isinstance(facing.obstacle, Chain):
        tips.append(facing.obstacle.points[~facing.obstacle.smooth])
    at = np.concatenate(tips)
    ends = base.closest(at)
    away, along = at - base.points(ends), turned(base.normals(ends))
    # Points beyond an end of the base have that end as their closest point.
    exact: list[float] = ends[np.abs((away * along).sum(axis=1)) <= COARSE_ROUND_OFF * base.length].tolist()
    # The samples continue beyond the start of a closed curve.
    return [*exact, *(end + base.length for end in exact)] if base.closed else exact


def _located(
    model: BodyModel, surface: Surface, stretches: Sequence[SmoothPart], points: FloatArray
) -> tuple[IntArray, BoolArray]:
    """For ``points`` (e, 2) on a surface the numbers (e,) of their stretches, and whether (e,) they are away
    from ends without known fields."""
    curve, spacing = surface.curve, model.cloud.spacing[surface.index]
    arc = curve.closest(points)
    starts = np.array([stretch.first for stretch in stretches])
    if curve.closed:
        arc = starts[0] + np.mod(arc - starts[0], curve.length)
    number = np.searchsorted(starts, arc, side="right") - 1
    off = np.ones(len(arc), dtype=bool)
    for at, stretch in enumerate(stretches):
        ends = (stretch.first, stretch.last)
        for end, known, continues in zip(ends, stretch.known, stretch.continues, strict=True):
            if not known and not continues:
                place = np.mod(end, curve.length) if curve.closed else end
                near = np.interp(place, surface.arc_length, spacing)
                off &= (number != at) | (np.abs(arc - end) >= END_CLEARANCE * near)
            elif curve.closed and not continues:
                off[np.argmin(np.abs(arc - end))] = False  # a range must not pass it
    return number, off
