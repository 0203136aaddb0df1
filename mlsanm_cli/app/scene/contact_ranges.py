"""Where a contact may have a grid of its own: surfaces that face each other, up to known corners."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TypeAlias

import numpy as np

from mlsanm_cli.app.scene.contact_pairs import profile_of, shape_of
from mlsanm_cli.app.scene.default_spacing import valleys
from mlsanm_cli.arrays import BoolArray, FloatArray
from mlsanm_cli.case import Case
from mlsanm_cli.cloud.cloud import Cloud
from mlsanm_cli.cloud.curves import Curve
from mlsanm_cli.cloud.joined import corners_of, points_of
from mlsanm_cli.cloud.surface import Surface
from mlsanm_cli.contact.geometry.contact_grid import Facing
from mlsanm_cli.contact.geometry.contact_range import ContactRange
from mlsanm_cli.contact.geometry.pairing import OPPOSED, Pairing
from mlsanm_cli.mechanics.body import BodyModel
from mlsanm_cli.mechanics.corner import Corner
from mlsanm_cli.mechanics.near_field import ComplexArray, Isotropic, as_complex, as_real
from mlsanm_cli.mechanics.wedge import Wedge

CLEAR = 4.0
"""Pressures keep so many spacings off the ends of their surfaces: what is left of their fields then changes
over no less."""
ALIKE = 1e-9
"""Curvatures that differ by less are the same."""
TOUCHING = 1e-6
"""Gaps that differ by less than this part of the range are the same: such surfaces touch all along."""
SHALLOW = 1e-3
"""The same as a part of what profiles differ by, which may be shallower."""
SHARPEST, BLUNTEST, HOLLOW, WIDEST = np.radians([25.0, 170.0, 190.0, 255.0]).tolist()
"""Angles of corners whose fields are known: from the first to the second, from the third to the last, and a
straight line."""
SHARPEST_OF_OTHERS = np.radians(60.0)
"""The same of the first where bodies are not isotropic. For wood in six directions tractions that are left on
the faces are 1e-6 to 2 % of those that are taken off at 90 degrees and up to 10 % at 60."""
SIDE, BEYOND, SEEN = 1e-3, 1e2, 40
"""From how far on, how far, in their lengths, and at how many places the lines of a corner's faces and what
lies outwards of them are followed outside the body."""
SMOOTH = float(np.cos(np.radians(1.0)))
"""Outlines continue smoothly where they turn by no more than this angle's cosine tells."""
SNAP = 1.5
"""Ends of a range are ends of a surface that are no more looks away."""
LOOKED_AT, PROFILED, LOOKS_PER_POINT = 800, 4000, 2
RAYS = 17
LOOKS = 8
CHORDS = 200


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
    adjacent = np.abs(away[:, 0] * normal[:, 1] - away[:, 1] * normal[:, 0])
    across = (outward * normal).sum(axis=1)
    faces = (across < OPPOSED) & (adjacent <= TOUCHING * base.length)
    if not faces.any():
        return None
    ends = [_ends(models[body], pairing.surface_of(slave), held[body]) for body, slave, _ in pairing.sides]
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


Restraints: TypeAlias = Mapping[str, tuple[bool, bool] | None]
"""The surfaces of a body that are held, and which of their components; None where springs have a part."""
Ends: TypeAlias = tuple[Corner | None, Corner | None]
"""The corners at the beginning and the end of a surface, where fields know them."""


def _ends(model: BodyModel, surface: Surface, held: Restraints) -> Ends:
    return _corner(model, surface, False, held), _corner(model, surface, True, held)


def _corner(model: BodyModel, surface: Surface, at_end: bool, held: Restraints) -> Corner | None:
    """The corner at one end of a surface, if both its faces are straight and the other one is free, or that
    of an isotropic body slides along a wall; and neither blunt nor very sharp."""
    face, isotropic = _straight(surface), isinstance(model.kernel, Isotropic)
    if face is None:
        return None
    tip, along = (face[1], face[0] - face[1]) if at_end else (face[0], face[1] - face[0])
    for name, adjacent in model.cloud.surfaces.items():
        line = _straight(adjacent)
        if name == surface.name or line is None:
            continue
        if min(abs(end - tip) for end in line) > ALIKE * abs(along):
            continue
        far = max(line, key=lambda end: abs(end - tip))
        ways = along / abs(along), (far - tip) / abs(far - tip)
        if name in held and not _slides(ways[1], held[name]):
            return None
        # Outlines have the body on their left.
        turn = -1j if at_end else 1j
        wedge = Wedge(model.kernel, *ways, turn, sliding=name in held)
        inside = float(np.angle(ways[1] / ways[0]) * turn.imag) % (2.0 * np.pi)
        angle = inside * (2.0 if wedge.sliding else 1.0)
        blunt = BLUNTEST < angle < HOLLOW and abs(angle - np.pi) > ALIKE
        sharpest = SHARPEST if isotropic else SHARPEST_OF_OTHERS
        if not sharpest <= inside <= angle <= WIDEST or blunt or (wedge.sliding and not isotropic):
            return None
        length = min(abs(along), abs(far - tip))
        if model.cloud.holds(_behind(wedge, tip, abs(along), abs(far - tip))).any():
            return None
        reach = CLEAR * float(model.cloud.spacing[surface.index[-1 if at_end else 0]])
        return Corner(wedge, tip, length, reach)
    return None


def _behind(wedge: Wedge, tip: complex, along: float, other: float) -> FloatArray:
    """Places (e, 2) that must be off the body: where the wedge's forces continue past the ends of its faces,
    which are ``along`` and ``other`` long, or act behind a wall, and what lies outwards of them, where their
    fields are cut."""
    far = np.geomspace(SIDE, BEYOND, SEEN)
    starts = tip + wedge.along * along * (1.0 + far), tip + wedge.second * other * (1.0 + far)
    if wedge.sliding:
        starts = starts[0], tip + wedge.second * along * far
    size = max(along, other)
    cuts = [
        tip + way * size * far[:, None] - inward * size * far
        for way, inward in zip((wedge.along, wedge.second), wedge.inward, strict=True)
    ]
    return as_real(np.concatenate([*starts, *(one.ravel() for one in cuts)]))


def _slides(other: complex, held: tuple[bool, bool] | None) -> bool:
    """Whether a face along the unit vector ``other``, x or y, is held across alone."""
    across = [abs(other.imag) > 1.0 - ALIKE, abs(other.real) > 1.0 - ALIKE]
    return held is not None and any(across) and list(held) == across


def _straight(surface: Surface) -> tuple[complex, complex] | None:
    """Both ends of a straight surface; None if it is none."""
    curve = surface.curve
    if curve.closed or surface.parts:
        return None
    first, last = as_complex(curve.points(np.array([0.0, curve.length])))
    straight = abs(abs(last - first) - curve.length) <= ALIKE * curve.length
    return (complex(first), complex(last)) if straight else None


def _snapped(s: float, ends: list[float], step: float) -> float | None:
    """The end nearest to a place if it is so near."""
    nearest = min(ends, key=lambda end: abs(end - s), default=np.inf)
    return nearest if abs(nearest - s) <= step else None


def _facing(case: Case, pairing: Pairing) -> Facing:
    """The surfaces of a contact; the more curved one is the base, so that the flatter one tells the direction
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
    """Whether the same boundary continues smoothly where an open surface begins, and where it ends, as it
    does where a part of it is in contact."""
    own = {part.name for part, _ in surface.members}
    stems = {name.partition("/")[0] for name in own}
    found = []
    for place in (0, -1):
        node, normal = surface.index[place], surface.normal[place]
        adjacent = [
            other.normal[other.index == node]
            for name, other in cloud.surfaces.items()
            if name not in own and name.partition("/")[0] in stems
        ]
        found.append(any(bool((one @ normal >= SMOOTH).any()) for one in adjacent))
    return found[0], found[1]


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


def void_center(cloud: Cloud, place: ComplexArray, inward: ComplexArray) -> list[complex | None]:
    """Where the fields of forces at places (e,) of a body's outline end: [None] where the way outwards is
    free, and nothing where the void has no place that all of them see."""
    starts, ways, long = [], [], 0.0
    for surface in cloud.surfaces.values():
        arc = np.linspace(0.0, surface.curve.length, CHORDS + 1)
        points = as_complex(surface.curve.points(arc))
        starts.append(points[:-1])
        ways.append(np.diff(points))
        long = max(long, float(np.abs(ways[-1]).max()))
    start, way = np.concatenate(starts), np.concatenate(ways)
    free = _free(place, -inward, start, way, long)
    if np.isinf(free).all():
        return [None]
    middle = len(place) // 2
    center = complex(place[middle] - 0.5 * float(free.min()) * inward[middle])
    lines = center - place
    size = np.abs(lines)
    return [center] if (_free(place, lines / size, start, way, long) > size).all() else []


def _free(
    place: ComplexArray, ahead: ComplexArray, start: ComplexArray, way: ComplexArray, adjacent: float
) -> FloatArray:
    """How far (e,) one sees from places (e,) along unit directions ``ahead`` (e,) before the chords of the
    outline, from ``start`` along ``way`` (c,), come into view; not counting those ``adjacent`` the place."""
    across = (np.conj(ahead)[:, None] * way).imag
    apart = start - place[:, None]
    with np.errstate(divide="ignore", invalid="ignore"):
        distance = (np.conj(apart) * way).imag / across
        share = -(np.conj(ahead)[:, None] * apart).imag / across
    hit = (across != 0.0) & (share >= 0.0) & (share <= 1.0) & (distance > adjacent)
    return np.asarray(np.where(hit, distance, np.inf).min(axis=1))
