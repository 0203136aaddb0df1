"""The spacing of bodies whose case leaves it to us.

Contacts do not ask for fine nodes, as their pressures act in closed form; what is left changes over the
distance from the contact to the nearest other boundary. Bodies that bend need some nodes across, and arcs
some along.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import pairwise

import numpy as np

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.cloud.curves import Arc, Curve, Outline, Segment
from mlsanm_cli.cloud.joined import Joined, part_of, points_of
from mlsanm_cli.cloud.spacing import Zone
from mlsanm_cli.cloud.tips import SMOOTH_TURN
from mlsanm_cli.contact.geometry.obstacles import Shape

ALONG, ACROSS = 20.0, 6.0
"""Spacings over the size of a body, and over twice its area divided by its perimeter."""
IN_FRONT = 5.0
"""Spacings between a contact and the nearest other boundary."""
PER_RADIUS, IN_HOLLOWS = 5.0, 14.0
"""Spacings over the radius of an arc; around holes and in hollows stresses concentrate: their peaks were 2 to
4 % low with 10, and are 1 % low."""
CONFORMING, IN_EACH_OTHER = 1.5, 16.0
"""Arcs in each other whose radii differ by less than this factor, and spacings over these radii."""
GROWTH = 0.15
"""Increase of the spacing per unit length. At 0.25 rows of fits that are flat and wide see displacements that
change from node to node too little where spacings grow: pressures at the lip of a keyway were three times too
high, frames with sharp corners 0.7 % too soft (0.15), for as much CPU time."""
AT_ROOTS = 20.0
"""Spacings along sides between two corners that point into the material: fits then know the fields of both. A
hub on a keyed shaft is within 0.7 %, with 13 it was 4 % off; a slit within 0.7 %, with 8 it was 1.3 %."""
SHORTEST, SHORTEST_ROOT = 1.0 / 64.0, 1.0 / 256.0
"""Spacings at short sides, over that far away, at least, and at such roots: with 1/64 a slit opened by 4 to
8 % too little."""
SAMPLES, PER_POINT = 200, 4
LEVELS, FINER = 12, 2.0**-0.5
"""Spacings that are tried on curves are each this part of the one before."""
HOLLOW = 0.5
"""Curves that turn back by more than this angle (radian) within a spacing far away are hollows."""
CLOSE = 0.05
"""Surfaces come close at one more place if the gap there is larger by less than this part of the distance
to the end."""
AT_ENDS = 10.0
"""Spacings between the outermost of several such places and the end of the surface."""
BESIDE = 8.0
"""Spacings along short faces next to a surface in contact."""
TOUCHING = 0.01
AT_TIPS, AROUND_TIPS = 20.0, 3.0
"""Curved surfaces that lie in each other, up to this part of the distance over which fields of a corner fade
out, and end at one: spacings at the tip, and how far nodes are as fine, as parts of that distance. A hub on a
keyed shaft opened 1.3 % too far without, and opens within 0.5 %."""
SMOOTH = float(np.cos(np.radians(10.0)))
"""Faces whose normals have at least this cosine form no corner."""
BY_BOND_ENDS, AT_BOND_ENDS, SLOWLY = 2.0, 4.0, 0.12
"""The finer body's spacing over those along a bond that ends on a surface that continues, and at its end. A
post on a block was then within 1 % of one piece, with 678 nodes, and its energies within 6 %; with spacings
that grow faster energies were up to 26 % off."""
AT_CLAMPED = 4.0
"""Spacings far away over those at the ends of clamped sides. A cantilever with 6 spacings across was 1.2 %
too soft at degree 4 without, and 0.2 % with; at degree 2 0.3 %, and 0.4 %."""
AT_CRUSHED, CRUSHED_GROWTH = 8.0, 0.1
"""The same at finite strain, where such corners are crushed, and how fast spacings grow. A block between
bonded plates, 30 % down with nu = 0.44, was 4 to 5 % too stiff with a quarter of the spacing that grows by
0.25, and is within 1 %; with a sixteenth that grows by 0.25 it was 3 to 4 % off."""
AT_NODES, BAND, SLOWER = 1.5, 3.0, 0.2
"""Spacings far away over those along surfaces in contact at finite strain, where pressures live at nodes; how
many of these deep, and how fast they grow. A tyre pressed by 0.15 and pushed aside by 0.3 was 1.6 % too soft
down and 2.3 % aside without, and is within 0.2 %; without the band equations of degree 4 do not settle."""
FLAT = 1e-6
"""Gaps that differ by less than this part of the length are the same."""


def automatic_spacing(outline: Outline) -> float:
    """The spacing far from everything."""
    return min(_sizes(outline))


def bends(outline: Outline) -> bool:
    """Whether a body is so thin that its spacing is that across it."""
    along, across = _sizes(outline)
    return across < along


def _sizes(outline: Outline) -> tuple[float, float]:
    """The spacings that a body's size and its thickness ask for."""
    area = length = 0.0
    for curve in outline.curves:
        (x, y), (ahead_x, ahead_y) = (points := _along(curve))[:-1].T, points[1:].T
        area += 0.5 * float((x * ahead_y - ahead_x * y).sum())
        length += curve.length
    return _extent(outline) / ALONG, 2.0 * area / length / ACROSS


def _extent(outline: Outline) -> float:
    """The longer side of the box around a body, along the straight side for which that is least, and of
    bodies without one their width: turned bodies have turned boxes."""
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
    """Finer nodes along arcs of small radius, and where curves turn, by one more factor ``finer``; and at
    short sides, whose ends are nodes, above all at the roots of slits."""
    roots = _roots(outline)
    for number, curve in enumerate(outline.curves):
        if isinstance(curve, Segment):
            parts, least = (AT_ROOTS, SHORTEST_ROOT) if number in roots else (1.0, SHORTEST)
            if curve.length < parts * far:
                yield Zone(curve, max(curve.length / parts, least * far), 0.0, GROWTH)
        elif isinstance(curve, Arc):
            fine = curve.radius / (finer * (PER_RADIUS if curve.sweep > 0.0 else IN_HOLLOWS))
            if fine < far:
                yield Zone(curve, fine, 0.0, GROWTH)
        else:
            yield from _turning_zones(curve, far, finer)


def _roots(outline: Outline) -> set[int]:
    """Numbers of the curves between two corners that point into the material."""
    found = set()
    for loop in outline.loops:
        numbers = range(len(outline.curves))[loop]
        ends = [outline.curves[k].normals(np.array([0.0, outline.curves[k].length])) for k in numbers]
        crossed = [
            a[1, 0] * b[0, 1] - a[1, 1] * b[0, 0] for a, b in zip(ends, ends[1:] + ends[:1], strict=True)
        ]
        inward = [turn < -SMOOTH_TURN for turn in crossed]
        found |= {number for k, number in enumerate(numbers) if inward[k] and inward[k - 1]}
    return found


def _turning_zones(curve: Curve, far: float, finer: float) -> Iterator[Zone]:
    """Finer nodes where a curve turns by more than that of an arc of ``PER_RADIUS`` spacings over its radius
    does within a spacing.

    What counts is the turn and not the curvature: shallow waves, however short, need no fine nodes.
    """
    count = max(SAMPLES, PER_POINT * points_of(curve))
    s = np.linspace(0.0, curve.length, count + 1)
    x, y = curve.normals(s).T
    angle = np.unwrap(np.arctan2(y, x))
    step = curve.length / count
    wanted = np.full(len(s), np.inf)
    whole = _turns(angle, max(round(far / step), 1), curve.closed)
    for level in range(LEVELS):
        size = far * FINER**level
        width = round(size / step)
        if width < 1:
            break
        least, most, net = _turns(angle, width, curve.closed)
        allowed = np.where((net < 0.0) & (whole[2] < -HOLLOW), 1.0 / IN_HOLLOWS, 1.0 / PER_RADIUS) / finer
        wanted = np.where(np.isinf(wanted) & (most - least <= allowed), size, wanted)
        if np.isfinite(wanted).all():
            break
    wanted = np.where(np.isinf(wanted), far * FINER**LEVELS, wanted)
    cuts = np.flatnonzero(np.diff(wanted)) + 1
    for first, last in pairwise([0, *cuts.tolist(), len(s) - 1]):
        if wanted[first] < far and last > first:
            yield Zone(part_of(curve, float(s[first]), float(s[last])), float(wanted[first]), 0.0, GROWTH)


def _turns(angle: FloatArray, width: int, closed: bool) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Least and largest direction (n,) within windows of ``width`` steps about every one of the ``angle``
    (n,) of a curve's samples, and what it turns by from end to end."""
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
    rest: Sequence[Curve],
    own: Curve,
    other: Curve | None,
    obstacle: Shape | None,
    far: float,
    others_far: float,
) -> Iterator[Zone]:
    """Finer nodes of a body where its boundary ``own`` comes nearest to the ``other`` surface, or to a rigid
    ``obstacle``, if the ``rest`` of its outline or an end is close to that place; and where surfaces lie in
    each other, which needs like spacings on both."""
    if isinstance(own, Arc) and isinstance(other, Arc) and _conform(own, other):
        # Contact and bodies have one scale.
        yield Zone(own, min(own.radius / IN_EACH_OTHER, others_far), 0.0, GROWTH)
    points = _along(own)
    if other is not None:
        partner = other.points(other.closest(points))
        # Where short pieces of a surface touch at last, both sides need like spacings.
        yield from _beside_zones(other, (), min(far, others_far))
    else:
        assert obstacle is not None
        partner, _ = obstacle.closest(points, own.normals(_places(own)))
    apart = np.hypot(*(points - partner).T)
    if not own.closed:
        yield from _end_zones(points, apart, far)
        yield from _beside_zones(own, rest, far)
        if other is not None:
            yield from _tip_zones(own, rest, other, far)
    nearest = np.flatnonzero(apart <= apart.min() + FLAT * own.length)
    place = points[nearest[len(nearest) // 2]]
    distances = [float(np.hypot(*(_along(curve) - place).T).min()) for curve in rest]
    if not own.closed:
        distances += np.hypot(*(points[[0, -1]] - place).T).tolist()
    distance = min(distances, default=np.inf)
    if FLAT * own.length < distance < IN_FRONT * far:
        yield Zone.around((float(place[0]), float(place[1])), distance / IN_FRONT, distance, GROWTH)


def nodal_zone(own: Curve, far: float) -> Zone:
    """Finer nodes along a surface whose contact pressures live at its nodes."""
    fine = far / AT_NODES
    return Zone(own, fine, BAND * fine, SLOWER)


def _beside_zones(own: Curve, rest: Sequence[Curve], far: float) -> Iterator[Zone]:
    """Finer nodes along short faces that make a corner with a surface in contact, or with another one of its
    own pieces: lips and edges bend."""
    pieces = own.pieces if isinstance(own, Joined) else (own,)
    for number, piece in enumerate(pieces):
        point, normal = (of(np.array([0.0, piece.length])) for of in (piece.points, piece.normals))
        others = [one for k, one in enumerate(pieces) if abs(k - number) == 1 or (own.closed and k != number)]
        for curve in [*others, *(rest if number in (0, len(pieces) - 1) else ())]:
            if curve.length >= BESIDE * far:
                continue
            ends = np.array([0.0, curve.length])
            apart = np.hypot(*(curve.points(ends) - point[:, None]).transpose(2, 0, 1))
            corner = (apart <= FLAT * own.length) & (normal @ curve.normals(ends).T < SMOOTH)
            if corner.any():
                yield Zone(curve, curve.length / BESIDE, 0.0, GROWTH)


def _tip_zones(own: Curve, rest: Sequence[Curve], other: Curve, far: float) -> Iterator[Zone]:
    """Finer nodes where a curved surface that lies in the ``other`` one ends at a corner."""
    ends = np.array([0.0, own.length])
    for point, normal in zip(own.points(ends), own.normals(ends), strict=True):
        x, y = point.tolist()
        for curve in rest:
            both = np.array([0.0, curve.length])
            apart = np.hypot(*(curve.points(both) - point).T)
            corner = (apart <= FLAT * own.length) & (curve.normals(both) @ normal < SMOOTH)
            curved = float(np.abs(own.curvature(_places(own))).max())
            span = min(own.length, curve.length, 1.0 / curved if curved else np.inf)
            gap = np.hypot(*(other.points(other.closest(point[None])) - point).T)[0]
            if curved and corner.any() and gap < TOUCHING * span < TOUCHING * AT_TIPS * far:
                yield Zone.around((x, y), span / AT_TIPS, span / AROUND_TIPS, GROWTH)


def bond_zones(own: Curve, ends: Sequence[tuple[float, float]], fine: float) -> Iterator[Zone]:
    """Nodes as ``fine`` as the finer body's where a boundary is bonded to another one, and finer ones if it
    has ``ends`` where a surface continues: stresses are singular there."""
    if not ends:
        yield Zone(own, fine, 0.0, GROWTH)
        return
    yield Zone(own, fine / BY_BOND_ENDS, 0.0, SLOWLY)
    for end in ends:
        yield Zone.around(end, fine / AT_BOND_ENDS, 0.0, SLOWLY)


def _end_zones(points: FloatArray, apart: FloatArray, far: float) -> Iterator[Zone]:
    """Finer nodes at the ends of a surface that comes close to another one, by ``apart`` (s,) at ``points``
    (s, 2), in several places, of which the outermost is near the end."""
    least = np.array(valleys(apart, FLAT * len(apart) * float(np.hypot(*(points[1] - points[0])))), dtype=int)
    for end in (0, -1):
        away = np.hypot(*(points[least] - points[end]).T)
        close = apart[least] <= apart.min() + CLOSE * away
        if close.sum() < 2:
            continue
        distance = float(away[close].min())
        if 0.0 < distance < AT_ENDS * far:
            x, y = points[end].tolist()
            yield Zone.around((x, y), distance / AT_ENDS, distance, GROWTH)


def valleys(values: FloatArray, slack: float) -> list[int]:
    """Where ``values`` (n,) in a row are lowest between rises and falls by more than ``slack``: what flat
    surfaces differ by in their last bits is none."""
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
    """Finer nodes at both ends of a clamped side, where stresses are singular if the next one is free: what
    bends is as soft as it is held there. At ``finite`` strain they are also crushed."""
    finer, growth = (AT_CRUSHED, CRUSHED_GROWTH) if finite else (AT_CLAMPED, GROWTH)
    if not curve.closed:
        for x, y in curve.points(np.array([0.0, curve.length])).tolist():
            yield Zone.around((x, y), far / finer, 0.0, growth)


def _conform(one: Arc, other: Arc) -> bool:
    """Whether two arcs lie in each other, nearly alike."""
    unlike = max(one.radius, other.radius) / min(one.radius, other.radius)
    return one.sweep * other.sweep < 0.0 and unlike < CONFORMING


def _along(curve: Curve) -> FloatArray:
    """Points (s, 2) along a curve, both ends included."""
    return curve.points(_places(curve))


def _places(curve: Curve) -> FloatArray:
    """Arc lengths (s,) that show what a curve does."""
    return np.linspace(0.0, curve.length, max(SAMPLES, PER_POINT * points_of(curve)) + 1)
