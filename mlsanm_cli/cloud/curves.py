"""Plane curves that make up outlines, traversed with the material on the left."""

from __future__ import annotations

import math
from functools import cached_property
from itertools import pairwise
from typing import Protocol

import numpy as np

from mlsanm_cli.arrays import FloatArray, IntArray
from mlsanm_cli.records import dataclass


class Curve(Protocol):
    """A curve parametrised by arc length ``s`` from 0 to ``length``."""

    @property
    def length(self) -> float:
        """Total arc length."""

    @property
    def closed(self) -> bool:
        """Whether the curve ends where it starts."""

    def points(self, s: FloatArray) -> FloatArray:
        """Positions (n, 2) at arc lengths ``s`` (n,)."""

    def normals(self, s: FloatArray) -> FloatArray:
        """Unit outward normals (n, 2)."""

    def closest(self, points: FloatArray) -> FloatArray:
        """Arc lengths (n,) of the curve's points closest to ``points`` (n, 2); ends included."""

    def curvature(self, s: FloatArray) -> FloatArray:
        """Curvature (n,), positive where the material is convex."""

    def zones(self) -> tuple[tuple[float, ...], ...]:
        """Rows of six numbers, one per straight line or arc, in the format of the spacing kernel."""


def chord_zones(points: FloatArray) -> tuple[tuple[float, ...], ...]:
    """Rows of :meth:`Curve.zones` for the chords between consecutive ``points`` (k, 2)."""
    return tuple((0.0, *a, *b, 0.0) for a, b in pairwise(points.tolist()))


@dataclass(frozen=True)
class Segment:
    """Straight line from ``start`` to ``end``."""

    start: tuple[float, float]
    end: tuple[float, float]

    closed = False

    @cached_property
    def length(self) -> float:
        return math.dist(self.start, self.end)

    @cached_property
    def _ends(self) -> FloatArray:
        return np.array([self.start, self.end])

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

    def zones(self) -> tuple[tuple[float, ...], ...]:
        return chord_zones(self._ends)


@dataclass(frozen=True)
class Arc:
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

    def zones(self) -> tuple[tuple[float, ...], ...]:
        first = min(self.start, self.start + self.sweep)
        return ((1.0, *self.center, self.radius, first, min(abs(self.sweep), 2.0 * math.pi)),)


def ends_of(curve: Curve) -> tuple[tuple[float, float], tuple[float, float]]:
    """Start and end of a curve."""
    (a, b), (c, d) = curve.points(np.array([0.0, curve.length])).tolist()
    return (a, b), (c, d)


@dataclass(frozen=True)
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
    first, last = ends_of(arc)
    return Outline(("arc", "flat"), (arc, Segment(last, first)))


def sector(center: tuple[float, float], radii: tuple[float, float], angles: tuple[float, float]) -> Outline:
    """Ring sector between two radii and two ``angles`` (radians) with boundaries outer, end, inner, start."""
    inner, outer = radii
    first, last = angles
    outside = Arc(center, outer, first, last - first)
    inside = Arc(center, inner, last, first - last)
    (a, b), (c, d) = map(ends_of, (outside, inside))
    return Outline(("outer", "end", "inner", "start"), (outside, Segment(b, c), inside, Segment(d, a)))
