"""Automatic spacing.

Contacts need no fine nodes, as the fields of their pressures are known in closed form; the remainder varies
over the distance from the contact to the nearest other boundary. Bodies that bend need some nodes across
their thickness, and arcs some along them.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import pairwise

import numpy as np

from mlsanm_cli.app.scene.roots import PER_ROOT, roots_of
from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.cloud.curves import Arc, Curve, Outline, Segment
from mlsanm_cli.cloud.joined import part_of, points_of
from mlsanm_cli.cloud.spacing import Zone
from mlsanm_cli.contact.geometry.obstacles import Shape
from mlsanm_cli.roundoff import COARSE_ROUND_OFF

PER_SIZE, PER_THICKNESS = 20.0, 6.0
"""Spacings over the size of a body, and over its mean thickness, twice its area divided by its perimeter."""
PER_CONTACT_DEPTH = 5.0
"""Spacings between a contact and the nearest other boundary."""
PER_RADIUS, PER_CONCAVE_RADIUS = 5.0, 14.0
"""Spacings over the radius of an arc; stresses concentrate around holes and in hollows: their peaks were 2 to
4 % low with 10, and are 1 % low. In orthotropic bodies concave arcs have more by the ratio of decay lengths:
at a hole in plates of E1/E2 = 4 to 14 peaks were 2 to 9 % low with its root, and are 1 % low."""
GROWTH = 0.15
"""Increase of the spacing per unit length. At 0.25 the wide, flat stencils where the spacing grows hardly
resist displacements that alternate from node to node: pressures at the lip of a keyway were three times too
high, and frames with sharp corners 0.7 % too soft (0.15), for as much CPU time."""
MIN_SIDE_RATIO, MIN_ROOT_RATIO = 1.0 / 64.0, 1.0 / 256.0
"""Least spacing at short sides over the coarse one, and at such roots: with 1/64 a slit opened by 4 to 8 %
too little."""
SAMPLES, PER_POINT = 200, 4
LEVELS, LEVEL_RATIO = 12, 2.0**-0.5
"""Number and ratio of the spacings that are tried on curves."""
HOLLOW_ANGLE = 0.5
"""Curves that turn to the concave side by more than this angle (radian) within a coarse spacing are
hollows."""
EQUAL_MINIMA = 0.05
"""Another minimum of the gap counts if it is larger by less than this part of its distance from the end."""
PER_END_DISTANCE = 10.0
"""Spacings between the outermost of several such minima and the end of the surface."""
TOUCHING = 0.01
PER_TIP_SPAN, TIP_RADIUS = 20.0, 3.0
"""For curved conforming surfaces (gap up to this part of the span over which fields of a corner decay) that
end at a corner: spacings over the span at the tip, and the radius of the fine zone as a part of the span. A
hub on a keyed shaft opened 1.3 % too far without, and opens within 0.5 %."""
SMOOTH = float(np.cos(np.radians(10.0)))
"""Faces whose normals have at least this cosine form no corner."""
BOND_RATIO, BOND_END_RATIO, BOND_GROWTH = 2.0, 4.0, 0.12
"""The spacing of the finer body over those along a bond that ends on a surface that continues, and at its
end. A post on a block was then within 1 % of one piece, with 678 nodes, and its energies within 6 %; with
spacings that grow faster energies were up to 26 % off."""
PER_CRACK = 40.0
"""Spacings at its tips over the length of a crack that is in contact. One pressed and sheared with friction
slipped 11 % too little with 10 nodes of the bonds' spacing along it, and does so within 0.2 %."""
CLAMPED_RATIO = 4.0
"""The coarse spacing over that at the ends of clamped sides. A cantilever with 6 spacings across was 1.2 %
too soft at degree 4 without, and 0.2 % with; at degree 2 0.3 % and 0.4 %."""
CRUSHED_RATIO, CRUSHED_GROWTH = 8.0, 0.1
"""The same at finite strain, where such corners are crushed, and the growth. A block between bonded plates,
compressed by 30 % with nu = 0.44, was 4 to 5 % too stiff with a quarter of the spacing that grows by 0.25,
and is within 1 %; with a sixteenth that grows by 0.25 it was 3 to 4 % off."""
NODAL_RATIO, NODAL_BAND, NODAL_GROWTH = 1.5, 3.0, 0.2
"""The coarse spacing over that along surfaces in contact at finite strain, where pressures are nodal; depth
of the fine band in its spacings, and growth. A tyre pressed by 0.15 and pushed aside by 0.3 was 1.6 % too
soft vertically and 2.3 % horizontally without, and is within 0.2 %; without the band equations of degree 4 do
not converge."""


def automatic_spacing(outline: Outline) -> float:
    """The coarsest spacing of a body."""
    return min(_sizes(outline))


def bends(outline: Outline) -> bool:
    """Whether the thickness of a body, and not its size, determines its spacing."""
    along, across = _sizes(outline)
    return across < along


def leans(outline: Outline, clamped: Sequence[Curve], stretch: float) -> bool:
    """Whether a body extends so far from its ``clamped`` sides that their compliance rotates it. The depth of
    fields that decay ``stretch`` times as slowly as in an isotropic body counts accordingly."""
    return stretch * _area(outline) > sum(curve.length for curve in clamped) ** 2 > 0.0


def _sizes(outline: Outline) -> tuple[float, float]:
    """The spacings required by the size and by the thickness of a body."""
    length = sum(curve.length for curve in outline.curves)
    return _extent(outline) / PER_SIZE, 2.0 * _area(outline) / length / PER_THICKNESS


def _area(outline: Outline) -> float:
    """Enclosed area."""
    area = 0.0
    for curve in outline.curves:
        (x, y), (ahead_x, ahead_y) = (points := _along(curve))[:-1].T, points[1:].T
        area += 0.5 * float((x * ahead_y - ahead_x * y).sum())
    return area


def _extent(outline: Outline) -> float:
    """The longer side of the smallest bounding box parallel to a straight side, or the largest width of a
    body without one: invariant under rotation."""
    points = [_along(curve) for curve in outline.curves]
    straight = [
        one[-1] - one[0] for one, c in zip(points, outline.curves, strict=True) if isinstance(c, Segment)
    ]
    along = np.array(straight) if straight else np.concatenate([np.diff(one, axis=0) for one in points])
    along = along[np.hypot(*along.T) > 0.0]
    along /= np.hypot(*along.T)[:, None]
    both = np.stack([along, along[:, ::-1] * [-1.0, 1.0]])
    sides = np.ptp(np.einsum("nc,bkc->bkn", np.concatenate(points), both), axis=2).max(axis=0)
    return float(sides.min() if straight else sides.max())


def arc_zones(outline: Outline, far: float, finer: float = 1.0) -> Iterator[Zone]:
    """Zones along arcs of small radius and where curves turn, with a further factor ``finer``, in hollows
    with its square; and at short sides, whose ends are nodes, above all at roots of slits."""
    roots = roots_of(outline)
    for number, curve in enumerate(outline.curves):
        if isinstance(curve, Segment):
            parts, least = (PER_ROOT, MIN_ROOT_RATIO) if number in roots else (1.0, MIN_SIDE_RATIO)
            if curve.length < parts * far:
                yield Zone(curve, max(curve.length / parts, least * far), 0.0, GROWTH)
        elif isinstance(curve, Arc):
            fine = curve.radius / (PER_RADIUS * finer if curve.sweep > 0.0 else PER_CONCAVE_RADIUS * finer**2)
            if fine < far:
                yield Zone(curve, fine, 0.0, GROWTH)
        else:
            yield from _turning_zones(curve, far, finer)


def _turning_zones(curve: Curve, far: float, finer: float) -> Iterator[Zone]:
    """Zones where a curve turns within a spacing by more than an arc with ``PER_RADIUS`` spacings over its
    radius. The turning angle counts, not the curvature: shallow waves, however short, need no fine nodes.
    """
    count = max(SAMPLES, PER_POINT * points_of(curve))
    s = np.linspace(0.0, curve.length, count + 1)
    x, y = curve.normals(s).T
    angle = np.unwrap(np.arctan2(y, x))
    step = curve.length / count
    wanted = np.full(len(s), np.inf)
    whole = _turns(angle, max(round(far / step), 1), curve.closed)
    for level in range(LEVELS):
        size = far * LEVEL_RATIO**level
        width = round(size / step)
        if width < 1:
            break
        least, most, net = _turns(angle, width, curve.closed)
        hollow = (net < 0.0) & (whole[2] < -HOLLOW_ANGLE)
        allowed = np.where(hollow, 1.0 / (PER_CONCAVE_RADIUS * finer**2), 1.0 / (PER_RADIUS * finer))
        wanted = np.where(np.isinf(wanted) & (most - least <= allowed), size, wanted)
        if np.isfinite(wanted).all():
            break
    wanted = np.where(np.isinf(wanted), far * LEVEL_RATIO**LEVELS, wanted)
    cuts = np.flatnonzero(np.diff(wanted)) + 1
    for first, last in pairwise([0, *cuts.tolist(), len(s) - 1]):
        if wanted[first] < far and last > first:
            yield Zone(part_of(curve, float(s[first]), float(s[last])), float(wanted[first]), 0.0, GROWTH)


def _turns(angle: FloatArray, width: int, closed: bool) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Least and largest direction (n,) within a window of ``width`` steps about each sample with the
    direction ``angle`` (n,), and the turning angle over the window."""
    before, after = width // 2, width - width // 2
    if closed:
        around = angle[-1] - angle[0]
        before, after = min(before, len(angle) - 1), min(after, len(angle) - 1)
        start, end = angle[len(angle) - 1 - before : -1] - around, angle[1 : 1 + after] + around
    else:
        start, end = np.full(before, angle[0]), np.full(after, angle[-1])
    windows = np.lib.stride_tricks.sliding_window_view(
        np.concatenate([start, angle, end]), before + after + 1
    )
    return windows.min(axis=1), windows.max(axis=1), windows[:, -1] - windows[:, 0]


def contact_zone(
    rest: Sequence[Curve], own: Curve, other: Curve | None, obstacle: Shape | None, far: float
) -> Iterator[Zone]:
    """Zones of a body where its boundary ``own`` is nearest to the ``other`` surface or a rigid ``obstacle``,
    if the ``rest`` of its outline or an end is close."""
    points = _along(own)
    if other is not None:
        partner = other.points(other.closest(points))
    else:
        assert obstacle is not None
        partner, _ = obstacle.closest(points, own.normals(_places(own)))
    apart = np.hypot(*(points - partner).T)
    if not own.closed:
        yield from _end_zones(points, apart, far)
        if other is not None:
            yield from _tip_zones(own, rest, other, far)
    nearest = np.flatnonzero(apart <= apart.min() + COARSE_ROUND_OFF * own.length)
    place = points[nearest[len(nearest) // 2]]
    distances = [float(np.hypot(*(_along(curve) - place).T).min()) for curve in rest]
    if not own.closed:
        distances += np.hypot(*(points[[0, -1]] - place).T).tolist()
    distance = min(distances, default=np.inf)
    if COARSE_ROUND_OFF * own.length < distance < PER_CONTACT_DEPTH * far:
        yield Zone.around((float(place[0]), float(place[1])), distance / PER_CONTACT_DEPTH, distance, GROWTH)


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
    curved = float(np.abs(own.curvature(_places(own))).max())
    for at, curve, cosine in joints(own, rest) if curved else ():
        point = own.points(at)
        span = min(own.length, curve.length, 1.0 / curved)
        gap = float(np.hypot(*(other.points(other.closest(point)) - point)[0]))
        if cosine < SMOOTH and gap < TOUCHING * span < TOUCHING * PER_TIP_SPAN * far:
            x, y = point[0].tolist()
            yield Zone.around((x, y), span / PER_TIP_SPAN, span / TIP_RADIUS, GROWTH)


def bond_zones(own: Curve, ends: Sequence[tuple[float, float]], fine: float) -> Iterator[Zone]:
    """The zone along a bonded boundary with the spacing ``fine`` of the finer body; finer if the bond has
    ``ends`` where a surface continues, at which stresses are singular."""
    if not ends:
        yield Zone(own, fine, 0.0, GROWTH)
        return
    yield Zone(own, fine / BOND_RATIO, 0.0, BOND_GROWTH)
    for end in ends:
        yield Zone.around(end, fine / BOND_END_RATIO, 0.0, BOND_GROWTH)


def crack_zones(part: Curve, ends: Sequence[tuple[float, float]]) -> Iterator[Zone]:
    """Zones where the ``part`` of a surface in contact ends at one of the ``ends`` of bonds: at the tips of a
    closed crack."""
    for tip in part.points(np.array([0.0, part.length])):
        if any(np.hypot(*(tip - end)) <= COARSE_ROUND_OFF * part.length for end in ends):
            x, y = tip.tolist()
            yield Zone.around((x, y), part.length / PER_CRACK, 0.0, BOND_GROWTH)


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
            x, y = points[end].tolist()
            yield Zone.around((x, y), distance / PER_END_DISTANCE, distance, GROWTH)


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
    finer, growth = (CRUSHED_RATIO, CRUSHED_GROWTH) if finite else (CLAMPED_RATIO, GROWTH)
    if not curve.closed:
        for x, y in curve.points(np.array([0.0, curve.length])).tolist():
            yield Zone.around((x, y), far / finer, 0.0, growth)


def _along(curve: Curve) -> FloatArray:
    """Points (s, 2) along a curve, both ends included."""
    return curve.points(_places(curve))


def _places(curve: Curve) -> FloatArray:
    """Arc lengths (s,) that sample a curve."""
    return np.linspace(0.0, curve.length, max(SAMPLES, PER_POINT * points_of(curve)) + 1)
