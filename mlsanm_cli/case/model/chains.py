"""Closed chains of sides and rounded corners: the geometry of a polygon, for its checks and its outline."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import pairwise

Point = tuple[float, float]

SMALL = 1e-9
"""Lengths below this part of a polygon's size count as nothing."""
CHORDS = 16


@dataclass(frozen=True)
class Side:
    """A straight boundary from ``start`` to ``end``, the material on its left."""

    name: str
    start: Point
    end: Point


@dataclass(frozen=True)
class Round:
    """A circular boundary from angle ``start`` over ``sweep`` (radian); clockwise the material is outside."""

    name: str
    center: Point
    radius: float
    start: float
    sweep: float


@dataclass(frozen=True)
class Smooth:
    """A boundary that is a smooth curve through ``points``, the material on its left; a ``closed`` one names
    its first point again at the end."""

    name: str
    points: tuple[Point, ...]
    closed: bool = False


Piece = Side | Round | Smooth


@dataclass(frozen=True)
class Corner:
    """A vertex: ``number`` in the case file, ``turn`` to the left (radian), ``cut`` off both sides."""

    number: int
    point: Point
    turn: float
    radius: float

    @property
    def cut(self) -> float:
        """Distance from the vertex to the ends of its arc."""
        return self.radius * abs(math.tan(0.5 * self.turn))


@lru_cache(maxsize=64)
def corners(points: tuple[Point, ...], rounding: tuple[float, ...]) -> tuple[Corner, ...]:
    """The vertices in counter-clockwise order."""
    order = list(range(len(points)))
    if signed_area(points) < 0.0:
        order.reverse()
    found = []
    for place, number in enumerate(order):
        before, here, after = (
            points[order[place - 1]],
            points[number],
            points[order[(place + 1) % len(order)]],
        )
        came, goes = _minus(here, before), _minus(after, here)
        turn = math.atan2(_cross(came, goes), came[0] * goes[0] + came[1] * goes[1])
        radius = rounding[number] if number < len(rounding) else 0.0
        found.append(Corner(number, here, turn, radius))
    return tuple(found)


@lru_cache(maxsize=64)
def pieces(
    points: tuple[Point, ...],
    names: tuple[str, ...],
    rounding: tuple[float, ...],
    arcs: tuple[str, ...] = (),
) -> tuple[Piece, ...]:
    """Sides and arcs counter-clockwise; ``names[k]`` is the side from point k to the next one in the file,
    ``arcs[k]`` the arc at point k.

    A side that its arcs use up is left out. An arc without a name between two sides of one name has theirs.
    """
    vertices = corners(points, rounding)
    backwards = signed_area(points) < 0.0
    smallest = SMALL * extent(points)
    count = len(points)

    def side_name(number: int) -> str:
        return names[number] if number < len(names) else f"side{number + 1}"

    chain: list[Piece] = []
    for place, corner in enumerate(vertices):
        following = vertices[(place + 1) % len(vertices)]
        length = math.dist(corner.point, following.point)
        if length == 0.0:
            continue
        along = _minus(following.point, corner.point)
        direction = (along[0] / length, along[1] / length)
        start = _ahead(corner.point, direction, corner.cut)
        if corner.cut > smallest:
            sign = math.copysign(1.0, corner.turn)
            center = _ahead(start, (-direction[1], direction[0]), sign * corner.radius)
            # The arc ends where this side starts, at the angle of the side's normal, or of its opposite.
            last = math.atan2(-sign * direction[0], sign * direction[1])
            before, after = (
                side_name(corner.number - 1 if corner.number else count - 1),
                side_name(corner.number),
            )
            given = arcs[corner.number] if corner.number < len(arcs) else ""
            name = given or (before if before == after else f"corner{corner.number + 1}")
            chain.append(Round(name, center, corner.radius, last - corner.turn, corner.turn))
        if length - corner.cut - following.cut > smallest:
            number = following.number if backwards else corner.number
            chain.append(Side(side_name(number), start, _ahead(following.point, direction, -following.cut)))
    return tuple(chain)


def signed_area(points: Sequence[Point]) -> float:
    """Area enclosed, positive when counter-clockwise."""
    origin = points[0]
    following = (*points[1:], points[0])
    return 0.5 * sum(
        _cross(_minus(a, origin), _minus(b, origin)) for a, b in zip(points, following, strict=True)
    )


def extent(points: Sequence[Point]) -> float:
    """The larger side of the box around the points."""
    return max(max(p[axis] for p in points) - min(p[axis] for p in points) for axis in (0, 1))


def on_round(arc: Round, fraction: float) -> Point:
    """The point at a fraction of an arc's sweep."""
    angle = arc.start + fraction * arc.sweep
    return arc.center[0] + arc.radius * math.cos(angle), arc.center[1] + arc.radius * math.sin(angle)


def chords(chain: Sequence[Piece]) -> list[tuple[str, Point, Point]]:
    """Straight parts of a chain with their boundaries' names: ``CHORDS`` of each arc, of curves those from
    point to point."""
    parts = []
    for piece in chain:
        if isinstance(piece, Side):
            parts.append((piece.name, piece.start, piece.end))
        elif isinstance(piece, Smooth):
            parts += [(piece.name, a, b) for a, b in pairwise(piece.points)]
        else:
            ends = [on_round(piece, k / CHORDS) for k in range(CHORDS + 1)]
            parts += [(piece.name, a, b) for a, b in pairwise(ends)]
    return parts


def crossings(chain: Sequence[Piece], smallest: float) -> Iterator[tuple[str, str]]:
    """Names of boundaries that cross or touch elsewhere than in a common corner."""
    parts = chords(chain)
    order = sorted(range(len(parts)), key=lambda k: min(parts[k][1][0], parts[k][2][0]))
    for place, one in enumerate(order):
        name, a, b = parts[one]
        last = max(a[0], b[0]) + smallest
        for other in order[place + 1 :]:
            second, c, d = parts[other]
            if min(c[0], d[0]) > last:
                break
            if (one - other) % len(parts) in (1, len(parts) - 1):
                first, then = ((a, b), (c, d)) if (other - one) % len(parts) == 1 else ((c, d), (a, b))
                if _folds_back(first, then):
                    yield name, second
            elif _segments_apart(a, b, c, d) <= smallest:
                yield name, second


def inside(chain: Sequence[Piece], point: Point) -> bool:
    """Even-odd rule, arcs taken as their chords."""
    x, y = point
    crossed = [
        (a[1] > y) != (b[1] > y) and x < a[0] + (y - a[1]) / (b[1] - a[1]) * (b[0] - a[0])
        for _, a, b in chords(chain)
    ]
    return sum(crossed) % 2 == 1


def distance(piece: Piece, point: Point) -> float:
    """Distance of a point to a side, an arc, or the points of a curve joined by lines."""
    if isinstance(piece, Side):
        return _to_segment(point, piece.start, piece.end)
    if isinstance(piece, Smooth):
        return min(_to_segment(point, a, b) for a, b in pairwise(piece.points))
    x, y = _minus(point, piece.center)
    angle = math.copysign(1.0, piece.sweep) * (math.atan2(y, x) - piece.start)
    if angle % (2.0 * math.pi) <= abs(piece.sweep):
        return abs(math.hypot(x, y) - piece.radius)
    return min(math.dist(point, on_round(piece, end)) for end in (0.0, 1.0))


def _folds_back(first: tuple[Point, Point], then: tuple[Point, Point]) -> bool:
    """Whether the second of two parts in a row lies on the first."""
    came, goes = _minus(first[1], first[0]), _minus(then[1], then[0])
    back = came[0] * goes[0] + came[1] * goes[1]
    return back < 0.0 and abs(_cross(came, goes)) <= SMALL * abs(back)


def _segments_apart(a: Point, b: Point, c: Point, d: Point) -> float:
    sides = [_cross(_minus(b, a), _minus(p, a)) for p in (c, d)]
    other = [_cross(_minus(d, c), _minus(p, c)) for p in (a, b)]
    if sides[0] * sides[1] < 0.0 and other[0] * other[1] < 0.0:
        return 0.0
    return min(_to_segment(a, c, d), _to_segment(b, c, d), _to_segment(c, a, b), _to_segment(d, a, b))


def _to_segment(point: Point, a: Point, b: Point) -> float:
    along, away = _minus(b, a), _minus(point, a)
    square = along[0] ** 2 + along[1] ** 2
    part = (along[0] * away[0] + along[1] * away[1]) / square if square > 0.0 else 0.0
    return math.dist(point, _ahead(a, along, min(1.0, max(0.0, part))))


def _ahead(point: Point, direction: Point, length: float) -> Point:
    return point[0] + length * direction[0], point[1] + length * direction[1]


def _minus(a: Point, b: Point) -> Point:
    return a[0] - b[0], a[1] - b[1]


def _cross(a: Point, b: Point) -> float:
    return a[0] * b[1] - a[1] * b[0]
