"""Plane curves that make up outlines, traversed with the material on the left."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from functools import cached_property
from itertools import pairwise

import numpy as np

from mlsanm_cli.arrays import FloatArray, IntArray
from mlsanm_cli.cloud.membership import cross
from mlsanm_cli.records import dataclass
from mlsanm_cli.roundoff import ROUND_OFF

ARC_CHORDS = 16
"""Chords that describe an arc."""
Point = tuple[float, float]
Chain = tuple[tuple[int, ...], bool]
"""Curves by index as they follow each other along a loop, and whether they are all of it."""


class Curve:
    """A curve parametrised by arc length ``s`` from 0 to ``length``, the base of all kinds of curves."""

    @property
    def length(self) -> float:
        """Total arc length."""
        raise NotImplementedError

    @property
    def closed(self) -> bool:
        """Whether the curve ends where it starts."""
        return False

    @property
    def corners(self) -> FloatArray:
        """Arc lengths (c,) of the corners within the curve; 0 for one at the start of a closed curve."""
        return np.zeros(0)

    @property
    def data_points(self) -> int:
        """Number of given points that the curve interpolates."""
        return 0

    @property
    def node_arcs(self) -> FloatArray:
        """Arc lengths (k,) of both ends and of points between them that describe the curve."""
        return np.array([0.0, self.length])

    def points(self, s: FloatArray) -> FloatArray:
        """Positions (n, 2) at arc lengths ``s`` (n,)."""
        raise NotImplementedError

    def normals(self, s: FloatArray) -> FloatArray:
        """Unit outward normals (n, 2)."""
        raise NotImplementedError

    def curvature(self, s: FloatArray) -> FloatArray:
        """Curvature (n,), positive where the material is convex."""
        raise NotImplementedError

    def closest(self, points: FloatArray) -> FloatArray:
        """Arc lengths (n,) of the curve's points closest to ``points`` (n, 2); ends included."""
        raise NotImplementedError

    def part(self, first: float, last: float) -> Curve:
        """The part between two arc lengths; on a closed curve ``last`` may lie past its end."""
        raise NotImplementedError

    def merged(self, following: Curve) -> Curve | None:
        """This curve and the ``following`` one as one curve of the same kind; None if they are not parts of
        one line, circle or spline."""
        return None

    def zones(self) -> tuple[tuple[float, ...], ...]:
        """Rows of six numbers, one per straight line or arc, in the format of the spacing kernel."""
        raise NotImplementedError

    @property
    def ends(self) -> tuple[Point, Point]:
        """Start and end."""
        (a, b), (c, d) = self.points(np.array([0.0, self.length])).tolist()
        return (a, b), (c, d)


def turn(before: Curve, after: Curve) -> float:
    """Angle (radians) by which the direction turns left from the end of a curve to the start of the next."""
    (a,), (b,) = before.normals(np.array([before.length])), after.normals(np.zeros(1))
    return math.atan2(float(cross(a, b)), float(a @ b))


def chord_zones(points: FloatArray) -> tuple[tuple[float, ...], ...]:
    """Rows of :meth:`Curve.zones` for the chords between consecutive ``points`` (k, 2)."""
    return tuple((0.0, *a, *b, 0.0) for a, b in pairwise(points.tolist()))


@dataclass(frozen=True)
class Segment(Curve):
    """Straight line from ``start`` to ``end``."""

    start: Point
    end: Point

    @cached_property
    def length(self) -> float:
        return math.dist(self.start, self.end)

    @cached_property
    def _ends(self) -> FloatArray:
        return np.array([self.start, self.end])

    @property
    def ends(self) -> tuple[Point, Point]:
        """Start and end, also of a segment of length 0."""
        return self.start, self.end

    @cached_property
    def _tangent(self) -> FloatArray:
        return np.asarray((self._ends[1] - self._ends[0]) / self.length)

    def points(self, s: FloatArray) -> FloatArray:
        fraction = (s / self.length)[:, None]
        return np.asarray((1.0 - fraction) * self._ends[0] + fraction * self._ends[1])

    def normals(self, s: FloatArray) -> FloatArray:
        return np.tile([self._tangent[1], -self._tangent[0]], (len(s), 1))

    def closest(self, points: FloatArray) -> FloatArray:
        return np.asarray(np.clip((points - self._ends[0]) @ self._tangent, 0.0, self.length))

    def curvature(self, s: FloatArray) -> FloatArray:
        return np.zeros(len(s))

    def part(self, first: float, last: float) -> Segment:
        (a, b), (c, d) = self.points(np.array([first, last])).tolist()
        return Segment((a, b), (c, d))

    def merged(self, following: Curve) -> Segment | None:
        if isinstance(following, Segment) and abs(turn(self, following)) <= ROUND_OFF:
            return Segment(self.start, following.end)
        return None

    def zones(self) -> tuple[tuple[float, ...], ...]:
        return chord_zones(self._ends)


@dataclass(frozen=True)
class Arc(Curve):
    """Circular arc about ``center`` from angle ``start`` over ``sweep``, both in radians. The material lies
    inside the circle if ``sweep`` > 0 (counter-clockwise), outside it if ``sweep`` < 0, as along a hole."""

    center: tuple[float, float]
    radius: float
    start: float
    sweep: float

    @cached_property
    def _turn(self) -> float:
        return math.copysign(1.0, self.sweep)

    @property
    def closed(self) -> bool:
        return abs(self.sweep) >= 2.0 * math.pi

    @property
    def length(self) -> float:
        return self.radius * abs(self.sweep)

    @property
    def node_arcs(self) -> FloatArray:
        return np.linspace(0.0, self.length, ARC_CHORDS + 1)

    def points(self, s: FloatArray) -> FloatArray:
        return np.array(self.center) + self._turn * self.radius * self.normals(s)

    def normals(self, s: FloatArray) -> FloatArray:
        angle = self.start + self._turn * s / self.radius
        return self._turn * np.stack([np.cos(angle), np.sin(angle)], axis=1)

    def closest(self, points: FloatArray) -> FloatArray:
        away = points - np.array(self.center)
        angle = np.mod(self._turn * (np.arctan2(away[:, 1], away[:, 0]) - self.start), 2.0 * math.pi)
        sweep = abs(self.sweep)
        # Past the end: the nearer end in angle is the nearer end in distance.
        beyond = np.where(angle - sweep <= 2.0 * math.pi - angle, sweep, 0.0)
        return self.radius * np.where(angle <= sweep, angle, beyond)

    def curvature(self, s: FloatArray) -> FloatArray:
        return np.full(len(s), self._turn / self.radius)

    def part(self, first: float, last: float) -> Arc:
        angle = self._turn / self.radius
        return Arc(self.center, self.radius, self.start + angle * first, angle * (last - first))

    def merged(self, following: Curve) -> Arc | None:
        if not isinstance(following, Arc) or self.sweep * following.sweep <= 0.0:
            return None
        apart = max(math.dist(self.center, following.center), abs(self.radius - following.radius))
        if apart > ROUND_OFF * self.radius:
            return None
        sweep = self.sweep + following.sweep
        if abs(abs(sweep) - 2.0 * math.pi) <= ROUND_OFF:
            sweep = math.copysign(2.0 * math.pi, sweep)
        return Arc(self.center, self.radius, self.start, sweep)

    def zones(self) -> tuple[tuple[float, ...], ...]:
        first = min(self.start, self.start + self.sweep)
        return ((1.0, *self.center, self.radius, first, min(abs(self.sweep), 2.0 * math.pi)),)


@dataclass(frozen=True, eq=False)
class Outline:
    """Closed loops of named curves with the material on the left, one loop after the other. ``starts`` are
    the indices of the first curve of each loop. An outline that interpolates given nodes has their numbers:
    ``nodes[c]`` (b,) of curve c include both ends, but only one of a closed curve."""

    names: tuple[str, ...]
    curves: tuple[Curve, ...]
    starts: tuple[int, ...] = (0,)
    nodes: tuple[IntArray, ...] = ()

    @property
    def loops(self) -> tuple[slice, ...]:
        """Index range of the curves of each loop."""
        return tuple(map(slice, self.starts, (*self.starts[1:], len(self.curves))))

    def numbers(self, *boundaries: str) -> list[int]:
        """The indices of the curves that form ``boundaries``: "name", or "name/1" and so on of each."""
        named = [(k, name, name.partition("/")[0]) for k, name in enumerate(self.names)]
        return [k for boundary in boundaries for k, name, stem in named if boundary in (name, stem)]

    def neighbours(self, number: int) -> tuple[int, int]:
        """The indices of the curves before and after a curve on its loop."""
        loop = next(loop for loop in self.loops if loop.start <= number < loop.stop)
        count, place = loop.stop - loop.start, number - loop.start
        return loop.start + (place - 1) % count, loop.start + (place + 1) % count

    def chains(self, numbers: Sequence[int]) -> list[Chain]:
        """The contiguous chains of curves by index, in the order of the outline."""
        chains: list[Chain] = []
        for loop in self.loops:
            wanted = [k for k in range(loop.start, loop.stop) if k in numbers]
            gaps = [place for place, k in enumerate(wanted) if self.neighbours(k)[0] not in wanted]
            if wanted and not gaps:
                chains.append((tuple(wanted), True))
            elif gaps and gaps[0] > 0:  # the last chain goes on across the start of the loop
                wanted, gaps = [*wanted[gaps[0] :], *wanted[: gaps[0]]], [place - gaps[0] for place in gaps]
            ends = [*gaps[1:], len(wanted)]
            chains += [(tuple(wanted[a:b]), False) for a, b in zip(gaps, ends, strict=False)]
        return chains

    def pieces(self, number: int, cuts: Sequence[float]) -> list[tuple[str, float, float]]:
        """Name, first and last arc length of the pieces of a curve cut at arc lengths ``cuts``. The pieces of
        "side" are "side/1", "side/2" and so on; a closed curve then begins at its first cut."""
        name, curve, places = self.names[number], self.curves[number], sorted(cuts)
        if not places:
            return [(name, 0.0, curve.length)]
        ends = [*places, places[0] + curve.length] if curve.closed else [0.0, *places, curve.length]
        return [(f"{name}/{k}", first, last) for k, (first, last) in enumerate(pairwise(ends), start=1)]

    def cut(self, cuts: Mapping[int, Sequence[float]]) -> Outline:
        """The outline with curves, given by index, split at arc lengths."""
        named, starts = list[tuple[str, Curve]](), list[int]()
        for number, curve in enumerate(self.curves):
            starts += [len(named)] if number in self.starts else []
            for name, first, last in self.pieces(number, cuts.get(number, ())):
                named.append((name, curve.part(first, last) if cuts.get(number) else curve))
        names, curves = zip(*named, strict=True)
        return Outline(names, curves, tuple(starts))


def rectangle(x: tuple[float, float], y: tuple[float, float]) -> Outline:
    """Rectangle with boundaries bottom, right, top, left."""
    corners = (x[0], y[0]), (x[1], y[0]), (x[1], y[1]), (x[0], y[1])
    sides = tuple(map(Segment, corners, (*corners[1:], corners[0])))
    return Outline(("bottom", "right", "top", "left"), sides)


def disk(center: tuple[float, float], radius: float) -> Outline:
    """Disk with one boundary, arc, starting at the top."""
    return Outline(("arc",), (Arc(center, radius, 0.5 * math.pi, 2.0 * math.pi),))


def annulus(center: tuple[float, float], radii: tuple[float, float]) -> Outline:
    """Full ring between two radii with boundaries outer and inner, starting at the top."""
    inner, outer = (
        Arc(center, radius, 0.5 * math.pi, turn * 2.0 * math.pi)
        for radius, turn in zip(radii, (-1.0, 1.0), strict=True)
    )
    return Outline(("outer", "inner"), (outer, inner), (0, 1))


def half_disk(center: tuple[float, float], radius: float, side: str) -> Outline:
    """The lower, upper, left or right half (``side``) of a disk, with boundaries arc and flat."""
    start = {"lower": 1.0, "right": 1.5, "upper": 0.0, "left": 0.5}[side] * math.pi
    arc = Arc(center, radius, start, math.pi)
    first, last = arc.ends
    return Outline(("arc", "flat"), (arc, Segment(last, first)))


def sector(center: tuple[float, float], radii: tuple[float, float], angles: tuple[float, float]) -> Outline:
    """Ring sector between two radii and two ``angles`` (radians) with boundaries outer, end, inner, start."""
    inner, outer = radii
    first, last = angles
    outside = Arc(center, outer, first, last - first)
    inside = Arc(center, inner, last, first - last)
    (a, b), (c, d) = outside.ends, inside.ends
    return Outline(("outer", "end", "inner", "start"), (outside, Segment(b, c), inside, Segment(d, a)))
