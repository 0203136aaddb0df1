"""Curves composed of others and parts of curves: a side named by the user may consist of several pieces."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from functools import cached_property
from itertools import accumulate, pairwise

import numpy as np

from mlsanm_cli.arrays import FloatArray, IntArray
from mlsanm_cli.cloud.curves import Arc, Curve, Outline, Segment, chord_zones
from mlsanm_cli.cloud.membership import cross
from mlsanm_cli.cloud.splines import SplinePart
from mlsanm_cli.records import dataclass
from mlsanm_cli.roundoff import ROUND_OFF

SMOOTH_ANGLE = math.radians(1.0)
"""Largest angle between two curves that counts as a smooth joint: the stress effect of a kink scales with its
angle."""
MAX_CHORDS, MAX_TURN = 64, 0.2


@dataclass(frozen=True, eq=False)
class CurvePart:
    """The part of a ``whole`` curve from arc length ``first`` over ``length``; on a closed curve it may pass
    the start."""

    whole: Curve
    first: float
    length: float

    closed = False

    def _arc(self, s: FloatArray) -> FloatArray:
        arc = np.clip(s, 0.0, self.length) + self.first
        return np.mod(arc, self.whole.length) if self.whole.closed else arc

    def points(self, s: FloatArray) -> FloatArray:
        return self.whole.points(self._arc(s))

    def normals(self, s: FloatArray) -> FloatArray:
        return self.whole.normals(self._arc(s))

    def curvature(self, s: FloatArray) -> FloatArray:
        return self.whole.curvature(self._arc(s))

    def closest(self, points: FloatArray) -> FloatArray:
        s = self.whole.closest(points) - self.first
        if self.whole.closed:
            s = np.mod(s, self.whole.length)
        ends = self.points(np.array([0.0, self.length]))
        away = np.hypot(*(points[:, None] - ends).transpose(2, 0, 1))
        nearer = np.where(away[:, 1] < away[:, 0], self.length, 0.0)
        return np.asarray(np.where((s >= 0.0) & (s <= self.length), s, nearer))

    @cached_property
    def _chords(self) -> tuple[tuple[float, ...], ...]:
        return chords(self)

    def zones(self) -> tuple[tuple[float, ...], ...]:
        return self._chords


def chords(curve: Curve) -> tuple[tuple[float, ...], ...]:
    """Chords that approximate a curve well enough for a spacing field: each turns by at most MAX_TURN, unless
    that takes more than MAX_CHORDS chords."""
    x, y = curve.normals(np.linspace(0.0, curve.length, MAX_CHORDS + 1)).T
    whole = float(np.abs(np.diff(np.unwrap(np.arctan2(y, x)))).sum())
    count = min(math.ceil(whole / MAX_TURN) or 1, MAX_CHORDS)
    return chord_zones(curve.points(np.linspace(0.0, curve.length, count + 1)))


@dataclass(frozen=True, eq=False)
class Joined:
    """A composite curve: each piece begins where the previous one ends; ``closed`` if the last one ends where
    the first one begins."""

    pieces: tuple[Curve, ...]
    closed: bool = False

    @cached_property
    def starts(self) -> FloatArray:
        """Arc lengths (k + 1,) at which the pieces begin, and the total length."""
        return np.array([*accumulate((piece.length for piece in self.pieces), initial=0.0)])

    @property
    def length(self) -> float:
        return float(self.starts[-1])

    @cached_property
    def corners(self) -> FloatArray:
        """Arc lengths (c,) of joints that are corners; 0 for one at the start of a closed curve."""
        pairs = [*zip(self.pieces, self.pieces[1:], strict=False)]
        if self.closed:
            pairs.append((self.pieces[-1], self.pieces[0]))
        turns = [turn(before, after) for before, after in pairs]
        places = [*self.starts[1:-1].tolist(), 0.0]
        return np.array([at for at, angle in zip(places, turns, strict=False) if abs(angle) > SMOOTH_ANGLE])

    def _number(self, s: FloatArray) -> IntArray:
        return np.clip(np.searchsorted(self.starts, s, side="right") - 1, 0, len(self.pieces) - 1)

    def _of(self, s: FloatArray, what: str, columns: tuple[int, ...]) -> FloatArray:
        number = self._number(s)
        found = np.empty((len(s), *columns))
        for k in np.unique(number):
            some = number == k
            found[some] = getattr(self.pieces[k], what)(s[some] - self.starts[k])
        return found

    def points(self, s: FloatArray) -> FloatArray:
        return self._of(s, "points", (2,))

    def normals(self, s: FloatArray) -> FloatArray:
        return self._of(s, "normals", (2,))

    def curvature(self, s: FloatArray) -> FloatArray:
        return self._of(s, "curvature", ())

    def closest(self, points: FloatArray) -> FloatArray:
        best, found = np.full(len(points), np.inf), np.zeros(len(points))
        for piece, start in zip(self.pieces, self.starts, strict=False):
            s = piece.closest(points)
            away = np.hypot(*(piece.points(s) - points).T)
            nearer = away < best
            best, found = np.where(nearer, away, best), np.where(nearer, s + start, found)
        return found

    def zones(self) -> tuple[tuple[float, ...], ...]:
        return tuple(row for piece in self.pieces for row in piece.zones())


def turn(before: Curve, after: Curve) -> float:
    """Angle (radians) by which the direction turns left from the end of a curve to the start of the next."""
    (a,), (b,) = before.normals(np.array([before.length])), after.normals(np.zeros(1))
    return math.atan2(float(cross(a, b)), float(a @ b))


def corners_of(curve: Curve) -> FloatArray:
    """Arc lengths (c,) of the corners within a curve."""
    return curve.corners if isinstance(curve, Joined) else np.zeros(0)


def normals_towards(curve: Curve, s: FloatArray, other: FloatArray) -> FloatArray:
    """Outward normals (n, 2) at arc lengths ``s`` (n,); at a corner that of the side which is more opposed to
    the vectors ``other`` (n, 2)."""
    normals = curve.normals(s)
    small = ROUND_OFF * curve.length
    for corner in corners_of(curve):
        at = np.flatnonzero(np.abs(s - corner) <= small)
        ways = (corner + small, corner - small if corner > 0.0 else curve.length - small)
        for way in ways if len(at) else ():
            side = curve.normals(np.array([way]))[0]
            better = other[at] @ side < (other[at] * normals[at]).sum(axis=1)
            normals[at[better]] = side
    return normals


def points_of(curve: Curve) -> int:
    """Number of data points of a spline curve, 0 for other curves."""
    if isinstance(curve, Joined):
        return sum(map(points_of, curve.pieces))
    if isinstance(curve, CurvePart):
        return math.ceil(points_of(curve.whole) * curve.length / curve.whole.length)
    return len(curve.node_arcs) if isinstance(curve, SplinePart) else 0


def joined(curves: Sequence[Curve], around: bool = False) -> Curve:
    """Concatenate curves; ``around`` if the last one ends where the first begins. Collinear lines, arcs of
    one circle and consecutive parts of one curve are merged."""
    pieces: list[Curve] = []
    for curve in curves:
        one = _merged(pieces[-1], curve) if pieces else None
        if one is None:
            pieces.append(curve)
        else:
            pieces[-1] = one
    if len(pieces) == 1:
        return pieces[0]
    return Joined(tuple(pieces), around)


def _merged(one: Curve, other: Curve) -> Curve | None:
    if isinstance(one, Segment) and isinstance(other, Segment):
        straight = abs(turn(one, other)) <= ROUND_OFF
        return Segment(one.start, other.end) if straight else None
    if isinstance(one, Arc) and isinstance(other, Arc):
        size = ROUND_OFF * one.radius
        same = math.dist(one.center, other.center) <= size and abs(one.radius - other.radius) <= size
        if not same or one.sweep * other.sweep <= 0.0:
            return None
        sweep = one.sweep + other.sweep
        if abs(abs(sweep) - 2.0 * math.pi) <= ROUND_OFF:
            sweep = math.copysign(2.0 * math.pi, sweep)
        return Arc(one.center, one.radius, one.start, sweep)
    if isinstance(one, CurvePart) and isinstance(other, CurvePart) and one.whole is other.whole:
        whole, length = one.whole, one.length + other.length
        if abs(length - whole.length) > ROUND_OFF * whole.length:
            return CurvePart(whole, one.first, length)
        # The whole of a closed curve starts where the curve does, not at the first part.
        return whole if not whole.closed or one.first == 0.0 else None
    return None


def part_of(curve: Curve, first: float, last: float) -> Curve:
    """The part of a curve between two arc lengths; on a closed one ``last`` may lie past its end."""
    if isinstance(curve, Segment):
        a, b = curve.points(np.array([first, last])).tolist()
        return Segment((a[0], a[1]), (b[0], b[1]))
    if isinstance(curve, Arc):
        sign = math.copysign(1.0, curve.sweep) / curve.radius
        return Arc(curve.center, curve.radius, curve.start + sign * first, sign * (last - first))
    if isinstance(curve, CurvePart):
        return CurvePart(curve.whole, curve.first + first, last - first)
    return CurvePart(curve, first, last - first)


def cut(outline: Outline, cuts: Mapping[int, Sequence[float]]) -> Outline:
    """Split curves, given by index, at arc lengths. The parts of "side" are "side/1", "side/2" and so on; a
    closed curve then begins at its first cut."""
    names, curves, starts = list[str](), list[Curve](), list[int]()
    for number, (name, curve) in enumerate(zip(outline.names, outline.curves, strict=True)):
        if number in outline.starts:
            starts.append(len(curves))
        places = sorted(cuts.get(number, ()))
        if not places:
            names.append(name)
            curves.append(curve)
            continue
        ends = [*places, places[0] + curve.length] if curve.closed else [0.0, *places, curve.length]
        for k, (first, last) in enumerate(pairwise(ends), start=1):
            names.append(f"{name}/{k}")
            curves.append(part_of(curve, first, last))
    return Outline(tuple(names), tuple(curves), tuple(starts))


Chain = tuple[tuple[int, ...], bool]
"""Curves by index as they follow each other along a loop, and whether they are all of it."""


def chains_of(outline: Outline, numbers: Sequence[int]) -> list[Chain]:
    """The contiguous chains of curves by index, in the order of the outline."""
    chains: list[Chain] = []
    for loop in outline.loops:
        around = range(loop.start, loop.stop)
        before = dict(zip(around, (loop.stop - 1, *around), strict=False))
        wanted = [k for k in around if k in numbers]
        gaps = [place for place, k in enumerate(wanted) if before[k] not in wanted]
        if wanted and not gaps:
            chains.append((tuple(wanted), True))
        elif gaps and gaps[0] > 0:  # the last chain goes on across the start of the loop
            wanted, gaps = [*wanted[gaps[0] :], *wanted[: gaps[0]]], [place - gaps[0] for place in gaps]
        ends = [*gaps[1:], len(wanted)]
        chains += [(tuple(wanted[a:b]), False) for a, b in zip(gaps, ends, strict=False)]
    return chains
