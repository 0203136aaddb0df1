"""Ranges of contact grids: surfaces that face each other, up to corners with known fields."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace

import numpy as np

from mlsanm_cli.app.scene.contact_pairs import profile_of, shape_of
from mlsanm_cli.app.scene.corners import END_CLEARANCE, Restraints, SmoothPart, stretches_of
from mlsanm_cli.app.scene.default_spacing import valleys
from mlsanm_cli.app.scene.void import void_center
from mlsanm_cli.arrays import BoolArray, FloatArray, IntArray
from mlsanm_cli.case import Case
from mlsanm_cli.cloud.curves import Curve
from mlsanm_cli.cloud.joined import points_of
from mlsanm_cli.contact.geometry.contact_range import ContactRange
from mlsanm_cli.contact.geometry.facing import Facing, turned
from mlsanm_cli.contact.geometry.obstacles import Chain
from mlsanm_cli.contact.geometry.pairing import MAX_FACING_COSINE, Pairing
from mlsanm_cli.mechanics.body_model import BodyModel
from mlsanm_cli.mechanics.near_field import as_complex, as_real
from mlsanm_cli.roundoff import COARSE_ROUND_OFF, ROUND_OFF

ALIKE_CURVATURE = 1e-3
"""The same for splines through points: the other surface decides the directions of pressures. Two flanks of
involutes, equally curved where they touch, moved along each other by 1.2 % more or less by the nodes next to
that place."""
EQUAL_PROFILE_GAP = 1e-3
"""The same relative to the height of a gap profile, which may be shallower."""
SNAP_SAMPLES = 1.5
"""The end of a range is moved to the end of a surface within so many samples."""
SAMPLES, PROFILE_SAMPLES, SAMPLES_PER_POINT = 800, 4000, 2
RAYS = 17
MINIMUM_PASSES = 8


def contact_ranges(
    case: Case, models: Mapping[str, BodyModel], pairings: tuple[Pairing, ...], held: Mapping[str, Restraints]
) -> dict[str, ContactRange]:
    """The contacts that may have contact grids, by name: none on surfaces that are ``held`` or have
    springs."""
    if case.is_regularized:
        return {}
    touching: dict[str, set[str]] = {name: set() for name in models}
    for pairing in pairings:
        for body, slave, _ in pairing.sides:
            touching[body] |= {part.name for part, _ in pairing.surface_of(slave).members}
    found = {
        pairing.name: _clear(case, models, pairing, held, touching)
        for pairing in pairings
        if pairing.slave.name not in held[pairing.slave_body]
        and (pairing.master is None or pairing.master.name not in held[str(pairing.master_body)])
    }
    return {name: one for name, one in found.items() if one is not None}


def directed(pairings: tuple[Pairing, ...], clear: Mapping[str, ContactRange]) -> tuple[Pairing, ...]:
    """The pairings with the directions of pressures on grids, and without candidates outside their ranges."""
    result = []
    for pairing in pairings:
        if pairing.name in clear:
            one = clear[pairing.name]
            s = one.facing.locate(pairing.points)
            candidate = one.within(s) & pairing.candidate
            candidate = candidate if candidate.sum() > 1 else pairing.candidate
            pairing = replace(pairing, normal=one.facing.normal(s), candidate=candidate)
        result.append(pairing)
    return tuple(result)


def _clear(
    case: Case,
    models: Mapping[str, BodyModel],
    pairing: Pairing,
    held: Mapping[str, Restraints],
    touching: Mapping[str, Collection[str]],
) -> ContactRange | None:
    if pairing.master_body == pairing.slave_body or pairing.bonded:
        return None
    facing = facing_of(case, pairing)
    base = facing.base
    # Sampled along the base, so that roles do not decide which of several equal minima is taken.
    sign, ahead = (1.0 if facing.slave_first else -1.0), replace(facing, slave_first=True)
    count = SAMPLES if facing.profile is None else PROFILE_SAMPLES
    count = max(count, SAMPLES_PER_POINT * max(map(points_of, facing.curves)))
    s = np.linspace(0.0, base.length, count + 1)[: count if base.closed else count + 1]
    points, partner, normal = ahead.opposite(s)
    away, outward = points - partner, as_real(-ahead.side(s, True)[1])
    gap = ahead.gap(s)
    offset = np.abs(away[:, 0] * normal[:, 1] - away[:, 1] * normal[:, 0])
    across = (outward * normal).sum(axis=1)
    faces = (across < MAX_FACING_COSINE) & (offset <= COARSE_ROUND_OFF * base.length)
    if not faces.any():
        return None
    sides = [
        _Side.of(models[body], pairing, slave, stretches, as_real(facing.side(sign * s, slave)[0]))
        for body, slave, _ in pairing.sides
        for stretches in [stretches_of(models[body], pairing.surface_of(slave), held[body], touching[body])]
    ]
    off = np.logical_and.reduce([faces, *(side.off for side in sides)])
    slack = COARSE_ROUND_OFF * base.length
    if facing.profile is not None:
        slack = min(slack, EQUAL_PROFILE_GAP * float(np.ptp(gap[faces])))
    least = gap[faces].min() + slack
    close = np.flatnonzero(off & (gap <= least))
    if not len(close):
        return None
    if any(len(np.unique(side.number[close])) > 1 for side in sides):
        return None  # touching on both sides of a corner
    nearest = int(close[len(close) // 2])
    for side in sides:
        off &= side.number == side.number[nearest]
    chosen = [side.stretches[side.number[nearest]] for side in sides]
    if base.closed:
        # Start the samples where the surfaces do not face each other, or are farthest apart.
        turn = int(np.argmax(gap) if off.all() else np.argmin(off))
        off, gap = np.roll(off, -turn), np.roll(gap, -turn)
        s = np.concatenate([s[turn:], s[:turn] + base.length])
        nearest = (nearest - turn) % len(s)
    stretch = _stretch(off, nearest)
    if stretch is None:
        return None
    around = base.closed and bool(off.all())
    first, last = float(s[stretch[0]]), float(s[0] + base.length if around else s[stretch[1]])
    corners = [tuple(one for one in stretch.corners if one is not None) for stretch in chosen]
    tips = [tip for side, stretch in zip(sides, chosen, strict=True) for tip in side.ends_of(stretch)]
    if isinstance(facing.obstacle, Chain):
        tips += as_complex(facing.obstacle.points[~facing.obstacle.smooth]).tolist()
    at = as_real(np.array(tips, dtype=np.complex128))
    ends = base.closest(at)
    away, along = at - base.points(ends), turned(base.normals(ends))
    # Points beyond an end of the base have that end as their closest point.
    exact_ends = ends[np.abs((away * along).sum(axis=1)) <= COARSE_ROUND_OFF * base.length].tolist()
    if base.closed:
        # The samples continue beyond the start of a closed curve.
        exact_ends += [end + base.length for end in exact_ends]
    step = SNAP_SAMPLES * float(s[1] - s[0])
    snapped = [_snapped(one, exact_ends, step) for one in (first, last)]
    whole = around or snapped[0] is not None, around or snapped[1] is not None
    first, last = (one if exact is None else exact for one, exact in zip((first, last), snapped, strict=True))
    inset = ROUND_OFF * base.length  # at a corner: the normal of the stretch
    rays = np.linspace(first + inset, last - inset, RAYS)
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
    """The nearest of the ``ends`` if it is within a ``step``, else None."""
    nearest = min(ends, key=lambda end: abs(end - s), default=np.inf)
    return nearest if abs(nearest - s) <= step else None


def facing_of(case: Case, pairing: Pairing) -> Facing:
    """The surfaces of a contact; the more curved one is the base, and the flatter one defines the direction
    of pressures."""
    contact = next(one for one in case.contact if one.name == pairing.name)
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
    own = _curved(slave.curve, at[0], pairing.points)
    opposite = _curved(master, at[1], pairing.partner)
    slave_first = obstacle is not None or pairing.names[0] < pairing.names[1]
    for one, other in zip(own, opposite, strict=True):
        if abs(one - other) > ALIKE_CURVATURE * max(one, other):
            slave_first = one > other
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
    there, partner, _ = facing.opposite(np.array([_minimum(facing, first, last)]))
    return there, partner


def _curved(curve: Curve, at: FloatArray, points: FloatArray) -> tuple[float, float]:
    """Least curvature of a surface where it initially touches, ``at`` places (k, 2) on it, and the mean over
    its ``points`` (w, 2): flat faces may differ in the rounding of their edges only."""
    here, whole = (np.abs(curve.curvature(curve.closest(one))) for one in (at, points))
    return float(here.min()), float(whole.mean())


@dataclass(frozen=True)
class _Side:
    """One of the two surfaces of a contact: its ``curve``, its ``stretches`` between corners, and for sample
    points (e,) the ``number`` (e,) of their stretch and whether they are ``off`` (e,), that is, away from
    ends without known fields."""

    curve: Curve
    stretches: tuple[SmoothPart, ...]
    number: IntArray
    off: BoolArray

    @classmethod
    def of(
        cls,
        model: BodyModel,
        pairing: Pairing,
        slave: bool,
        stretches: tuple[SmoothPart, ...],
        points: FloatArray,
    ) -> _Side:
        """The side of the slave or the master, at ``points`` (e, 2) on it."""
        surface = pairing.surface_of(slave)
        curve, spacing = surface.curve, model.cloud.spacing[surface.index]
        arc = curve.closest(points)
        starts = np.array([one.first for one in stretches])
        if curve.closed:
            arc = starts[0] + np.mod(arc - starts[0], curve.length)
        number = np.searchsorted(starts, arc, side="right") - 1
        off = np.ones(len(arc), dtype=bool)
        for at, one in enumerate(stretches):
            for end, corner, on in zip((one.first, one.last), one.corners, one.continues, strict=True):
                if corner is None and not on:
                    place = np.mod(end, curve.length) if curve.closed else end
                    near = np.interp(place, surface.arc_length, spacing)
                    off &= (number != at) | (np.abs(arc - end) >= END_CLEARANCE * near)
                elif curve.closed and not on:
                    off[np.argmin(np.abs(arc - end))] = False  # a range must not pass it
        return cls(curve, stretches, number, off)

    def ends_of(self, stretch: SmoothPart) -> list[complex]:
        """The ends of a stretch up to which pressures may extend."""
        ends = np.array([stretch.first, stretch.last])[list(stretch.ended)]
        if self.curve.closed:
            ends = np.mod(ends, self.curve.length)
        return [complex(x, y) for x, y in self.curve.points(ends)]


def _minimum(facing: Facing, first: float, last: float) -> float:
    """The arc length between two others at which the gap is smallest, by successive refinement."""
    for _ in range(MINIMUM_PASSES):
        s = np.linspace(first, last, RAYS)
        least = int(np.argmin(facing.gap(s)))
        first, last = s[max(least - 1, 0)], s[min(least + 1, len(s) - 1)]
    return 0.5 * float(first + last)


def _stretch(chosen: BoolArray, inside: int) -> tuple[int, int] | None:
    """First and last index of the run of ``chosen`` samples that contains ``inside``, None if there is
    none."""
    if not chosen[inside]:
        return None
    before, after = np.flatnonzero(~chosen[:inside]), np.flatnonzero(~chosen[inside:])
    first = int(before[-1]) + 1 if len(before) else 0
    last = inside + int(after[0]) - 1 if len(after) else len(chosen) - 1
    return (first, last) if last > first else None
