"""Outlines drawn from corners, straight sides and curves, and the checks of such input."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from itertools import pairwise

import numpy as np

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.cloud.curves import Arc, Curve, Outline, Point, Segment
from mlsanm_cli.cloud.membership import (
    cross,
    first_crossing,
    inside_polygon,
    numbered,
    signed_area,
    twice_area,
)
from mlsanm_cli.cloud.splines import NodeSpline, Spline
from mlsanm_cli.errors import Fault, OutlineError
from mlsanm_cli.roundoff import COARSE_ROUND_OFF, ROUND_OFF

Named = tuple[str, Curve]

IN_ORDER = "list the points in order around the body"
MAX_CHORDS = 4000
"""Largest number of chords of an outline of sides: with more, the search for crossings takes seconds."""


def polygon(
    points: Sequence[Point], names: Sequence[str], rounding: Sequence[float], arcs: Sequence[str]
) -> list[Named]:
    """Sides and rounded corners of a polygon, counter-clockwise. Side ``names[k]`` goes from point k to the
    next; the arc ``arcs[k]`` of radius ``rounding[k]`` rounds point k. Lists may be shorter than ``points``
    or hold "", for default names and sharp corners. A side of no remaining length is left out. An unnamed arc
    between two sides of one name belongs to their boundary. Raises OutlineError for repeated points,
    collinear points, and radii that are too large."""
    count, corners = len(points), np.array(points)
    size = extent(points)
    small, area = ROUND_OFF * size, signed_area(corners)
    faults = [
        Fault(
            ("points", number),
            f"({x:g}, {y:g}) repeats point {other + 1}",
            "the last point is joined to the first automatically",
        )
        for number, (x, y) in enumerate(points)
        for other in np.flatnonzero(np.hypot(*(corners[:number] - corners[number]).T) <= small)
    ]
    _refuse([*faults, _without_area("points", corners)] if abs(area) <= small * size else faults)
    order = list(range(count))
    if area < 0.0:
        order.reverse()
    radii = [*rounding, *[0.0] * (count - len(rounding))]
    xy = corners[order]
    along = np.roll(xy, -1, axis=0) - xy
    room = np.hypot(*along.T)
    direction = along / room[:, None]
    came = np.roll(direction, 1, axis=0)
    turn = np.arctan2(cross(came, direction), (came * direction).sum(axis=1))
    radius = np.array(radii)[order]
    cut = radius * np.abs(np.tan(0.5 * turn))
    _refuse(_rounding_faults(order, radius, cut, room, small))

    def given(values: Sequence[str], number: int) -> str:
        return values[number] if number < len(values) else ""

    def side(number: int) -> str:
        return given(names, number) or f"side{number + 1}"

    chain: list[Named] = []
    for place, number in enumerate(order):
        following = (place + 1) % count
        start = xy[place] + cut[place] * direction[place]
        x, y = direction[place].tolist()
        if cut[place] > small:
            sign = math.copysign(1.0, turn[place])
            center = start + sign * radius[place] * np.array([-y, x])
            # The arc ends where this side begins, at the angle of the side's normal or its opposite.
            last = math.atan2(-sign * x, sign * y)
            before = side((number - 1) % count)
            default = before if before == side(number) else f"corner{number + 1}"
            (a, b), sweep = center.tolist(), float(turn[place])
            arc = Arc((a, b), float(radius[place]), last - sweep, sweep)
            chain.append((given(arcs, number) or default, arc))
        if room[place] - cut[place] - cut[following] > small:
            (a, b), (c, d) = start.tolist(), (xy[following] - cut[following] * direction[place]).tolist()
            chain.append((side(number if order[0] == 0 else order[following]), Segment((a, b), (c, d))))
    return chain


def closed_chain(
    names: Sequence[str], targets: Sequence[Point | None], curves: Sequence[tuple[Point, ...] | None]
) -> list[Named]:
    """Sides by name, joined end to end, counter-clockwise: smooth ``curves`` through points, even about
    straight sides that they meet at right angles, or straight lines to their ``targets`` or, without one, to
    the start of the next side. Raises OutlineError for sides that do not join, and for collinear points."""
    sides = list(zip(targets, curves, strict=True))
    known = [point for target, curve in sides for point in (curve or (target,)) if point is not None]
    size, count = extent(known or [(0.0, 0.0)]), len(sides)
    starts = [None if curve is None else curve[0] for curve in curves]
    ends = [target if curve is None else curve[-1] for target, curve in sides]
    _refuse(_join_faults(names, curves, starts, ends, COARSE_ROUND_OFF * size))
    chain: list[tuple[str, tuple[Point, ...]]] = []
    closed = False
    for number, (name, points) in enumerate(zip(names, curves, strict=True)):
        following = starts[(number + 1) % count]
        if points is None:
            start, end = ends[number - 1], following or targets[number]
            assert start is not None
            assert end is not None
            chain.append((name, (start, end)))
            continue
        if count == 1:
            # Starts at the highest point, as disks do, so that a vertical symmetry line crosses at a node.
            top = int(np.argmax([y for _, y in points[:-1]]))
            points, closed = (*points[top:-1], *points[: top + 1]), True
        elif following is not None:
            # Ends that coincide within round-off become one point.
            points = (*points[:-1], following)
        chain.append((name, points))
    corners = np.array([point for _, points in chain for point in points[:-1]])
    area = signed_area(corners)
    if len(corners) > MAX_CHORDS:
        raise OutlineError([Fault(("sides",), f"have {len(corners)} points", f"at most {MAX_CHORDS}")])
    if abs(area) <= ROUND_OFF * size**2:
        raise OutlineError([_without_area("sides", corners)])
    if area < 0.0:
        chain = [(name, points[::-1]) for name, points in reversed(chain)]
    beside, found = [points for _, points in (chain[-1], *chain, chain[0])], list[Named]()
    for (name, points), before, after in zip(chain, beside, beside[2:], strict=False):
        if len(points) == 2:
            found.append((name, Segment(points[0], points[1])))
        elif closed:
            found.append((name, NodeSpline(np.array(points), True).between(0, len(points) - 1)))
        else:
            found.append((name, _through(np.array(points), before, after)))
    return found


def _through(points: FloatArray, *sides: Sequence[Point]) -> Spline:
    """The curve through ``points`` (n, 2) between two sides. Where it meets a straight one at a right angle,
    up to the square of its turn from chord to chord, it is that of the whole body of which the side is a
    plane of symmetry: its points are continued by their images."""
    spline, count = NodeSpline(points, False), len(points)
    images = [points[:0], points[:0]]
    for end, side in enumerate(sides):
        if len(side) != 2:
            continue
        ordered = points[::-1] if end else points
        along, chords = np.diff(np.array(side), axis=0)[0], np.diff(ordered[:3], axis=0)
        slope = spline.derivatives(spline.knots[[-end]])[1][0]
        turn = np.arctan2(cross(*chords), chords[0] @ chords[1])
        if abs(slope @ along) <= max(turn**2, ROUND_OFF) * np.hypot(*slope) * np.hypot(*along):
            away, unit = ordered[1:] - ordered[0], along / np.hypot(*along)
            image = ordered[0] + 2.0 * np.outer(away @ unit, unit) - away
            images[end] = image if end else image[::-1]
    first = len(images[0])
    whole = NodeSpline(np.concatenate([images[0], points, images[1]]), False)
    return whole.between(first, first + count - 1)


def with_holes(outer: Sequence[Named], holes: Sequence[tuple[str, Point, float]], key: str) -> Outline:
    """The outline of a chain and circular holes (name, centre, radius). Several curves of one name become
    "name/1", "name/2" and so on. Raises OutlineError where the chain crosses or touches itself (reported at
    ``key``) and for holes that are not surrounded by material."""
    chains = [curve.points(curve.node_arcs) for _, curve in outer]
    parts = [np.hstack([points[:-1], points[1:]]) for points in chains]
    chords = np.concatenate(parts)
    names = [name for (name, _), part in zip(outer, parts, strict=True) for _ in part]
    size = float(np.ptp(chords[:, :2], axis=0).max())
    meeting = dict.fromkeys((names[i], names[j]) for i, j in _meetings(chords, ROUND_OFF * size))
    crossing = 'the boundaries "{}" and "{}" cross or touch'
    _refuse(Fault((key,), crossing.format(*pair), IN_ORDER) for pair in meeting)
    _refuse(_hole_faults(outer, chords, holes, ROUND_OFF * size))
    circles = [(name, Arc(center, r, 0.5 * math.pi, -2.0 * math.pi)) for name, center, r in holes]
    chain = [*outer, *circles]
    starts = (0, *range(len(outer), len(chain)))
    return Outline(numbered([name for name, _ in chain], "{}/{}"), tuple(curve for _, curve in chain), starts)


def extent(points: Sequence[Point]) -> float:
    """Longer side of the bounding box."""
    return float(np.ptp(np.array(points), axis=0).max())


def _refuse(faults: Iterable[Fault]) -> None:
    found = list(faults)
    if found:
        raise OutlineError(found)


def _without_area(key: str, corners: FloatArray) -> Fault:
    """The fault of ``corners`` (n, 2) that enclose no area: they lie on a line, or their sides cross."""
    place = first_crossing(np.hstack([corners, np.roll(corners, -1, axis=0)]))
    if place is None:
        return Fault((key,), "all points lie on a line", "a body needs an area")
    return Fault((key,), f"sides cross near ({place[0]:g}, {place[1]:g})", IN_ORDER)


def _rounding_faults(
    order: Sequence[int], radius: FloatArray, cut: FloatArray, room: FloatArray, small: float
) -> Iterator[Fault]:
    for place, number in enumerate(order):
        following = (place + 1) % len(order)
        if radius[place] and cut[place] <= small:
            yield Fault(("rounding", number), "there is no corner to round at this point", "write 0.0")
        elif cut[place] + cut[following] > room[place] * (1.0 + ROUND_OFF):
            larger, other = (place, following) if cut[place] >= cut[following] else (following, place)
            rest = float(room[place] - cut[other])
            text = f"a radius of {radius[larger]:g} takes {cut[larger]:g} of a side that has {rest:g} left"
            hint = f"at most {rest / cut[larger] * radius[larger]:.4g}" if rest > 0.0 else "reduce it"
            yield Fault(("rounding", order[larger]), text, hint)


def _join_faults(
    names: Sequence[str],
    curves: Sequence[tuple[Point, ...] | None],
    starts: Sequence[Point | None],
    ends: Sequence[Point | None],
    slack: float,
) -> Iterator[Fault]:
    repeated = [
        Fault(("sides", number, "points", k), f"({b[0]:g}, {b[1]:g}) repeats the point before it")
        for number, curve in enumerate(curves)
        for k, (a, b) in enumerate(pairwise(curve or ()), start=1)
        if math.dist(a, b) <= slack
    ]
    if repeated:
        yield repeated[0]
        return
    for number, (name, start) in enumerate(zip(names, starts, strict=True)):
        before, end = names[number - 1], ends[number - 1]
        if start is None and end is None:
            text = f'the point where "{before}" ends and "{name}" begins is missing'
            yield Fault(("sides", number), text, f'write to = [x, y] in "{before}"')
        elif start is not None and end is not None and math.dist(start, end) > slack:
            places = f"({start[0]:g}, {start[1]:g})", f"({end[0]:g}, {end[1]:g})"
            hint = "every side begins where the one before ends"
            if len(names) == 1:
                hint = "end where it begins, or add a side without points: a straight line back"
            text = f'"{name}" begins at {places[0]}, "{before}" ends at {places[1]}'
            yield Fault(("sides", number), text, hint)


def _hole_faults(
    outer: Sequence[Named], chords: FloatArray, holes: Sequence[tuple[str, Point, float]], small: float
) -> Iterator[Fault]:
    for number, (_, center, radius) in enumerate(holes):
        place = np.array([center])
        away = [float(np.hypot(*(c.points(c.closest(place)) - place)[0])) for _, c in outer]
        room = min(away)
        if not inside_polygon(chords, place)[0] and room > small:
            yield Fault(("holes", number, "center"), "the hole lies outside the outer boundary")
        elif room <= radius + small:
            nearest = outer[away.index(room)][0]
            text = f'the hole cuts the boundary "{nearest}", which is {room:g} from its center'
            yield Fault(("holes", number, "radius"), text, "holes lie inside, with material all around")
        for other, (_, there, size) in enumerate(holes[:number]):
            if math.dist(center, there) <= radius + size + small:
                text = f"the hole overlaps or touches hole {other + 1}"
                yield Fault(("holes", number, "center"), text, "separate them")


def _meetings(chords: FloatArray, small: float) -> Iterator[tuple[int, int]]:
    """Pairs of the ``chords`` (e, 4) of a closed chain that come closer than ``small`` other than at a common
    end; neighbouring chords if they fold back on each other."""
    count = len(chords)
    low, high = np.minimum(chords[:, 0], chords[:, 2]), np.maximum(chords[:, 0], chords[:, 2])
    order = np.argsort(low)
    last = np.searchsorted(low[order], high[order] + small, side="right")
    for place, one in enumerate(order.tolist()):
        others = order[place + 1 : last[place]]
        neighbour = np.isin((others - one) % count, (1, count - 1))
        for other in others[neighbour].tolist():
            first, then = chords[[one, other] if (other - one) % count == 1 else [other, one]]
            came, goes = first[2:] - first[:2], then[2:] - then[:2]
            back = float(came @ goes)
            if back < 0.0 and abs(cross(came, goes)) <= ROUND_OFF * abs(back):
                yield one, other
        others = others[~neighbour]
        for other in others[_apart(chords[one], chords[others]) <= small].tolist():
            yield one, other


def _apart(one: FloatArray, others: FloatArray) -> FloatArray:
    """Distance (m,) of a chord (4,) to ``others`` (m, 4), 0 where they cross."""

    def away(point: FloatArray, start: FloatArray, end: FloatArray) -> FloatArray:
        along, offset = end - start, point - start
        part = np.clip((along * offset).sum(axis=1) / (along**2).sum(axis=1), 0.0, 1.0)
        return np.asarray(np.hypot(*(offset - part[:, None] * along).T))

    a, b = np.broadcast_to(one[:2], (len(others), 2)), np.broadcast_to(one[2:], (len(others), 2))
    c, d = others[:, :2], others[:, 2:]
    crossing = twice_area(a, b, c) * twice_area(a, b, d) < 0.0
    crossing &= twice_area(c, d, a) * twice_area(c, d, b) < 0.0
    ends = np.minimum.reduce([away(a, c, d), away(b, c, d), away(c, a, b), away(d, a, b)])
    return np.where(crossing, 0.0, ends)
