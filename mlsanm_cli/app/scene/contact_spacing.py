"""Zones of finer nodes at contacts, bonds and clamped sides of a body."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from mlsanm_cli.app.scene.default_spacing import (
    GROWTH,
    PER_ROOT,
    SINGULAR_RATIO,
    along,
    places_along,
    zone_at,
)
from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.cloud.curves import Curve
from mlsanm_cli.cloud.spacing import Zone
from mlsanm_cli.contact.geometry.obstacles import Shape
from mlsanm_cli.roundoff import COARSE_ROUND_OFF

PER_CONTACT_DEPTH = 5.0
"""Spacings between a contact and the nearest other boundary."""
EQUAL_MINIMA = 0.05
"""Another minimum of the gap counts if it is larger by less than this part of its distance from the end."""
PER_END_DISTANCE = 10.0
"""Spacings between the outermost of several such minima and the end of the surface."""
TOUCHING = 0.01
"""Largest gap at a corner that touches: relative to the span over which its fields decay, or the spacing."""
TIP_RADIUS = 3.0
"""For curved conforming surfaces that end at a corner, with PER_ROOT spacings over the span at the tip: the
span over the radius of the fine zone."""
SMOOTH = float(np.cos(np.radians(10.0)))
"""Faces whose normals have at least this cosine form no corner."""
BOND_RATIO, BOND_GROWTH = 2.0, 0.12
"""The spacing of the finer body over that along a bond that ends on a surface that continues, and growth."""
PER_CRACK = 40.0
"""Spacings at its tips over the length of a crack that is in contact."""
CRUSHED_RATIO, CRUSHED_GROWTH = 8.0, 0.1
"""The coarse spacing over that at the ends of clamped sides at finite strain, where such corners are crushed,
and the growth."""
STRAINED_RATIO, STRAINED_BAND, STRAINED_GROWTH = 1.5, 3.0, 0.2
"""The coarse spacing over that along surfaces in contact at finite strain, where strains are largest; depth
of the fine band in its spacings, and growth."""
SHARP_RATIO = 16.0
"""The coarse spacing over that at sharp corners on rigid obstacles. Smooth fits leave a trace of strain at
the tip, which pressures answer to within three spacings."""
RIGHT = 0.05
"""Corners within this angle (radian) of a right one bear pressures that even out."""


def contact_zone(
    rest: Sequence[Curve], own: Curve, other: Curve | None, obstacle: Shape | None, far: float
) -> Iterator[Zone]:
    """Zones of a body where its boundary ``own`` is nearest to the ``other`` surface or a rigid ``obstacle``,
    if the ``rest`` of its outline or an end is close."""
    points = along(own)
    if other is not None:
        partner = other.points(other.closest(points))
    else:
        assert obstacle is not None
        partner, _ = obstacle.closest(points, own.normals(places_along(own)))
    apart = np.hypot(*(points - partner).T)
    if not own.closed:
        yield from _end_zones(points, apart, far)
        if other is not None:
            yield from _tip_zones(own, rest, other, far)
    nearest = np.flatnonzero(apart <= apart.min() + COARSE_ROUND_OFF * own.length)
    place = points[nearest[len(nearest) // 2]]
    distances = [float(np.hypot(*(along(curve) - place).T).min()) for curve in rest]
    if not own.closed:
        distances += np.hypot(*(points[[0, -1]] - place).T).tolist()
    distance = min(distances, default=np.inf)
    if COARSE_ROUND_OFF * own.length < distance < PER_CONTACT_DEPTH * far:
        yield zone_at(place, distance / PER_CONTACT_DEPTH, distance)


def joints(own: Curve, others: Sequence[Curve]) -> Iterator[tuple[FloatArray, Curve, float]]:
    """The ends of a curve at which one of the ``others`` begins or ends: arc length (1,), the other curve,
    and the cosine of the angle between the normals."""
    for at in (np.zeros(1), np.array([own.length])):
        for curve in others:
            ends = np.array([0.0, curve.length])
            apart = np.hypot(*(curve.points(ends) - own.points(at)).T)
            for cosine in (curve.normals(ends) @ own.normals(at)[0])[
                apart <= COARSE_ROUND_OFF * own.length
            ].tolist():
                yield at, curve, cosine


def _tip_zones(own: Curve, rest: Sequence[Curve], other: Curve, far: float) -> Iterator[Zone]:
    """Zones where a curved surface that conforms to the ``other`` one ends at a corner."""
    curved = float(np.abs(own.curvature(places_along(own))).max())
    for at, curve, cosine in joints(own, rest) if curved else ():
        point = own.points(at)
        span = min(own.length, curve.length, 1.0 / curved)
        gap = float(np.hypot(*(other.points(other.closest(point)) - point)[0]))
        if cosine < SMOOTH and gap < TOUCHING * span < TOUCHING * PER_ROOT * far:
            yield zone_at(point[0], span / PER_ROOT, span / TIP_RADIUS)


def bond_zones(own: Curve, ends: Sequence[tuple[float, float]], fine: float) -> Iterator[Zone]:
    """The zone along a bonded boundary with the spacing ``fine`` of the finer body; finer if the bond has
    ``ends`` where a surface continues, at which stresses are singular."""
    if not ends:
        yield Zone(own, fine, 0.0, GROWTH)
        return
    yield Zone(own, fine / BOND_RATIO, 0.0, BOND_GROWTH)
    for end in ends:
        yield Zone.around(end, fine / SINGULAR_RATIO, 0.0, BOND_GROWTH)


def crack_zones(part: Curve, ends: Sequence[tuple[float, float]]) -> Iterator[Zone]:
    """Zones where the ``part`` of a surface in contact ends at one of the ``ends`` of bonds: at the tips of a
    closed crack."""
    for tip in part.points(np.array([0.0, part.length])):
        if any(np.hypot(*(tip - end)) <= COARSE_ROUND_OFF * part.length for end in ends):
            yield zone_at(tip, part.length / PER_CRACK, growth=BOND_GROWTH)


def _end_zones(points: FloatArray, apart: FloatArray, far: float) -> Iterator[Zone]:
    """Zones at the ends of a surface whose gap ``apart`` (s,) at ``points`` (s, 2) has several minima, the
    outermost of which is near the end."""
    least = np.array(
        valleys(apart, COARSE_ROUND_OFF * len(apart) * float(np.hypot(*(points[1] - points[0])))), dtype=int
    )
    for end in (0, -1):
        away = np.hypot(*(points[least] - points[end]).T)
        close = apart[least] <= apart.min() + EQUAL_MINIMA * away
        if close.sum() < 2:
            continue
        distance = float(away[close].min())
        if 0.0 < distance < PER_END_DISTANCE * far:
            yield zone_at(points[end], distance / PER_END_DISTANCE, distance)


def valleys(values: FloatArray, slack: float) -> list[int]:
    """Indices of the local minima of ``values`` (n,) between rises and falls of more than ``slack``, which
    ignores round-off."""
    found, falling, lowest, highest = list[int](), True, 0, 0
    row = values.tolist()
    for k, value in enumerate(row):
        if falling:
            lowest = k if value < row[lowest] else lowest
            if value > row[lowest] + slack:
                found.append(lowest)
                falling, highest = False, k
        else:
            highest = k if value > row[highest] else highest
            if value < row[highest] - slack:
                falling, lowest = True, k
    return [*found, lowest] if falling else found


def clamped_zones(curve: Curve, far: float, finite: bool = False) -> Iterator[Zone]:
    """Zones at both ends of a clamped side, where stresses are singular beside a free one; they determine the
    stiffness of the clamping. At ``finite`` strain these corners are also crushed."""
    finer, growth = (CRUSHED_RATIO, CRUSHED_GROWTH) if finite else (SINGULAR_RATIO, GROWTH)
    if not curve.closed:
        for end in curve.points(np.array([0.0, curve.length])):
            yield zone_at(end, far / finer, growth=growth)


def sharp_ends(rest: Sequence[Curve], own: Curve, obstacle: Shape, far: float) -> Iterator[Zone]:
    """Zones at the ends of a surface ``own`` that touch a rigid ``obstacle`` as drawn, if it makes a corner
    other than a right one with a piece of the ``rest`` of its outline there."""
    if own.closed:
        return
    for at, _, cosine in joints(own, rest):
        point = own.points(at)
        gap = np.hypot(*(point - obstacle.closest(point, own.normals(at))[0])[0])
        if gap <= TOUCHING * far and RIGHT < abs(np.arccos(cosine) - 0.5 * np.pi) < 0.5 * np.pi - RIGHT:
            yield zone_at(point[0], far / SHARP_RATIO)


def strained_zone(own: Curve, far: float) -> Zone:
    """The zone along a surface in contact at finite strain."""
    fine = far / STRAINED_RATIO
    return Zone(own, fine, STRAINED_BAND * fine, STRAINED_GROWTH)
