"""Curves composed of others, boundaries as consecutive pieces of an outline, as a side named by the user may
consist of several, and the nodes of one named boundary."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from functools import cached_property
from itertools import accumulate

import numpy as np

from mlsanm_cli.arrays import FloatArray, IntArray
from mlsanm_cli.cloud.curves import Curve, Outline, Point, turn
from mlsanm_cli.memo import digest
from mlsanm_cli.records import dataclass
from mlsanm_cli.roundoff import COARSE_ROUND_OFF, ROUND_OFF

SMOOTH_ANGLE = math.radians(1.0)
"""Largest angle between two curves that counts as a smooth joint: the stress effect of a kink scales with its
angle."""


@dataclass(frozen=True, eq=False)
class Joined(Curve):
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

    @property
    def data_points(self) -> int:
        return sum(piece.data_points for piece in self.pieces)

    def _of(self, s: FloatArray, what: str, columns: tuple[int, ...]) -> FloatArray:
        number = np.clip(np.searchsorted(self.starts, s, side="right") - 1, 0, len(self.pieces) - 1)
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

    def part(self, first: float, last: float) -> Curve:
        found = []
        for shift in (0.0, self.length) if self.closed else (0.0,):
            for piece, start in zip(self.pieces, self.starts + shift, strict=False):
                low, high = max(first - start, 0.0), min(last - start, piece.length)
                if high - low > ROUND_OFF * self.length:
                    found.append(piece.part(low, high))
        return joined(found)

    def zones(self) -> tuple[tuple[float, ...], ...]:
        return tuple(row for piece in self.pieces for row in piece.zones())


def normals_towards(curve: Curve, s: FloatArray, other: FloatArray) -> FloatArray:
    """Outward normals (n, 2) at arc lengths ``s`` (n,); at a corner that of the side which is more opposed to
    the vectors ``other`` (n, 2)."""
    normals = curve.normals(s)
    small = ROUND_OFF * curve.length
    for corner in curve.corners:
        at = np.flatnonzero(np.abs(s - corner) <= small)
        ways = (corner + small, corner - small if corner > 0.0 else curve.length - small)
        for way in ways if len(at) else ():
            side = curve.normals(np.array([way]))[0]
            better = other[at] @ side < (other[at] * normals[at]).sum(axis=1)
            normals[at[better]] = side
    return normals


def joined(curves: Sequence[Curve], around: bool = False) -> Curve:
    """Concatenate curves; ``around`` if the last one ends where the first begins. Collinear lines, arcs of
    one circle and consecutive parts of one curve are merged."""
    pieces: list[Curve] = []
    for curve in curves:
        whole = pieces[-1].merged(curve) if pieces else None
        pieces = [*pieces, curve] if whole is None else [*pieces[:-1], whole]
    return pieces[0] if len(pieces) == 1 else Joined(tuple(pieces), around)


@dataclass(frozen=True, eq=False)
class BoundaryRun:
    """Consecutive pieces of an ``outline`` by ``numbers``, which form a closed loop if they go ``around``, or
    their part between the points nearest to two ``ends``."""

    outline: Outline
    numbers: tuple[int, ...]
    around: bool
    ends: tuple[Point, Point] | None = None

    @property
    def curves(self) -> tuple[Curve, ...]:
        return tuple(self.outline.curves[number] for number in self.numbers)

    @cached_property
    def whole(self) -> Curve:
        """The pieces as one curve."""
        return joined(self.curves, self.around)

    @cached_property
    def starts(self) -> list[float]:
        """Arc lengths at the starts of the pieces and at the end of the last one."""
        return [*accumulate((curve.length for curve in self.curves), initial=0.0)]

    def nearest(self, point: Point) -> tuple[float, float]:
        """The arc length of the nearest point of the pieces, that of an end of a piece if it is there, and
        the distance."""
        place = np.array([point])
        (at,) = arc = self.whole.closest(place)
        end = min(self.starts, key=lambda start: abs(start - at))
        joint = abs(end - at) <= COARSE_ROUND_OFF * self.starts[-1]
        return float(end if joint else at), float(np.hypot(*(self.whole.points(arc) - place)[0]))

    @cached_property
    def range(self) -> tuple[float, float]:
        """Arc length at which the part starts, and its length."""
        if self.ends is None:
            return 0.0, self.starts[-1]
        (start, _), (end, _) = (self.nearest(point) for point in self.ends)
        if self.around:
            return start, (end - start) % self.starts[-1]
        return min(start, end), abs(end - start)

    @cached_property
    def part(self) -> Curve:
        """The part as a curve."""
        first, length = self.range
        return self.whole.part(first, first + length) if self.ends else self.whole

    def continues(self, at: float) -> bool:
        """Whether the pieces continue on both sides of the arc length ``at``."""
        return self.around or COARSE_ROUND_OFF < at / self.starts[-1] < 1.0 - COARSE_ROUND_OFF


@dataclass(frozen=True)
class Surface:
    """The nodes of one named boundary, in order along its curve. ``index`` (b,) are node numbers,
    ``arc_length`` (b,) their positions, ``normal`` (b, 2) the normals of this boundary alone: a corner node
    belongs to both boundaries that meet there, with the normal of each. ``weight`` (b,) is the surface length
    of a node (trapezoidal rule). A surface joined of several has these as ``parts``, on which boundary
    conditions act; at a corner between two parts its normal is their mean."""

    name: str
    curve: Curve
    index: IntArray
    arc_length: FloatArray
    normal: FloatArray
    parts: tuple[Surface, ...] = ()

    @property
    def members(self) -> tuple[tuple[Surface, IntArray], ...]:
        """The body's own surfaces this one consists of, and the positions of their nodes in ``index``."""
        found, first = [], 0
        for part in self.parts or (self,):
            found.append((part, (first + np.arange(len(part.index))) % len(self.index)))
            first += len(part.index) - 1
        return tuple(found)

    @cached_property
    def ends(self) -> FloatArray:
        """Arc lengths (k + 1,) of the ends of the k intervals between neighbouring nodes, closed curves
        included."""
        return np.append(self.arc_length, self.curve.length) if self.curve.closed else self.arc_length

    @cached_property
    def end_normals(self) -> FloatArray:
        """Normals (k, 2, 2) at both ends of the k intervals; at a corner between two parts, those of the part
        the interval belongs to."""
        if self.parts:
            return np.concatenate([part.end_normals for part in self.parts])
        after = np.roll(self.normal, -1, axis=0)
        return np.stack([self.normal, after], axis=1)[: len(self.index) - (not self.curve.closed)]

    @cached_property
    def content(self) -> str:
        """Digest of the nodes and of all that they need to know of their curve."""
        return digest(
            *(self.name, self.index, self.arc_length, self.normal), self.curve.closed, self.curve.length
        )

    @cached_property
    def weight(self) -> FloatArray:
        """Quadrature weights (b,) along the surface (trapezoidal rule)."""
        steps = np.diff(self.ends)
        if self.curve.closed:
            return np.asarray(0.5 * (steps + np.roll(steps, 1)))
        return np.asarray(0.5 * (np.append(steps, 0.0) + np.append(0.0, steps)))


def joined_surface(name: str, parts: Sequence[Surface], around: bool) -> Surface:
    """Concatenate surfaces; ``around`` if the last one ends where the first begins."""
    if len(parts) == 1:
        return parts[0]
    ends = np.cumsum([part.curve.length for part in parts])
    arc = [np.zeros(1)]
    index, normal = [parts[0].index[:1]], [parts[0].normal[:1].copy()]
    for part, end in zip(parts, ends, strict=True):
        arc.append(part.arc_length[1:] + end - part.curve.length)
        index.append(part.index[1:])
        normal[-1][-1:] = _between(normal[-1][-1:], part.normal[:1])
        normal.append(part.normal[1:].copy())
    places, nodes, normals = np.concatenate(arc), np.concatenate(index), np.concatenate(normal)
    if around:
        normals[:1] = _between(normals[-1:], normals[:1])
        places, nodes, normals = places[:-1], nodes[:-1], normals[:-1]
    curve = joined([part.curve for part in parts], around)
    return Surface(name, curve, nodes, places, normals, tuple(parts))


def _between(one: FloatArray, other: FloatArray) -> FloatArray:
    """Unit vector (1, 2) halfway between two."""
    mean = one + other
    return np.asarray(mean / np.hypot(*mean.T)[:, None])


def boundary_of(surfaces: Iterable[Surface]) -> tuple[IntArray, FloatArray, tuple[str, ...]]:
    """The nodes (b,) of surfaces, one after the other, their normals (b, 2) and the names of their
    surfaces."""
    listed = list(surfaces)
    index = np.concatenate([surface.index for surface in listed])
    normal = np.concatenate([surface.normal for surface in listed])
    return index, normal, tuple(surface.name for surface in listed for _ in surface.index)
