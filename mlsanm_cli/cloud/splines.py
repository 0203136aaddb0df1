"""Curves through nodes: a smooth outline keeps its curvature between the nodes that a file gives of it.

A cubic spline over the chord length (de Boor 1978, doi:10.1007/978-1-4612-6333-3): positions are off by
h^4 and normals by h^3, where chords are off by h^2 and h.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cache, cached_property

import numpy as np
import scipy.sparse as sparse

from mlsanm_cli.arrays import FloatArray, IntArray
from mlsanm_cli.cloud.curves import Segment
from mlsanm_cli.startup import cKDTree, dgtsv

GAUSS = 6
"""Points of Gauss' rule for the length of an interval."""
SAMPLES = 4
"""Points per interval among which the closest is looked for first."""
ITERATIONS = 60
PRECISION = 4.0 * np.finfo(float).eps
FINAL_STEP = 5e-8
"""Steps of Newton's method below this part of the curve are the last: errors decrease quadratically."""


@cache
def _gauss() -> tuple[FloatArray, FloatArray]:
    return np.polynomial.legendre.leggauss(GAUSS)


@dataclass(frozen=True, eq=False)
class NodeSpline:
    """Spline through ``nodes`` (k, 2), in order; closed ones name their first node again at the end."""

    nodes: FloatArray
    closed: bool

    @cached_property
    def knots(self) -> FloatArray:
        """Parameters (k,) of the nodes: lengths of the chords up to there."""
        return np.append(0.0, np.cumsum(np.hypot(*np.diff(self.nodes, axis=0).T)))

    @cached_property
    def _slopes(self) -> FloatArray:
        """Derivatives (k, 2) at the knots that make second ones continuous; at both ends of open curves the
        third ones too. scipy's splines take longer to import than the rest of it."""
        steps = np.diff(self.knots)
        rise = np.diff(self.nodes, axis=0) / steps[:, None]
        count, last = len(steps), len(steps) - (1 if self.closed else 0)
        if count == 1:
            return np.repeat(rise, 2, axis=0)
        # Numbers of the knots, and of the intervals before and behind them.
        at = np.arange(0 if self.closed else 1, count)
        before, behind = steps[at - 1], steps[at]
        entries = [(at, at, 2.0 * (before + behind))]
        entries += [(at, (at - 1) % (last + 1), behind), (at, (at + 1) % (last + 1), before)]
        rhs = np.zeros((last + 1, 2))
        rhs[at] = 3.0 * (behind[:, None] * rise[at - 1] + before[:, None] * rise[at])
        for end, inner, sign in () if self.closed else ((0, 1, 1), (count, count - 1, -1)):
            one, other = (0, 1) if sign > 0 else (count - 1, count - 2)
            near, far, both = steps[one], steps[other], steps[one] + steps[other]
            row = np.array([end, end])
            if count == 2:  # a parabola
                entries.append((row, np.array([end, inner]), np.ones(2)))
                rhs[end] = 2.0 * rise[one]
                continue
            entries.append((row, np.array([end, inner]), np.array([far, both])))
            rhs[end] = ((near + 2.0 * both) * far * rise[one] + near**2 * rise[other]) / both
        rows, columns, values = (np.concatenate(parts) for parts in zip(*entries, strict=True))
        matrix = sparse.csc_array((values, (rows, columns)), shape=(last + 1, last + 1))
        found = _in_a_ring(matrix, rhs) if self.closed else _in_a_row(matrix, rhs)
        return np.concatenate([found, found[:1]]) if self.closed else found

    @cached_property
    def _powers(self) -> FloatArray:
        """Coefficients (4, k - 1, 2) of the powers of the distance from the knot before."""
        steps, slope = np.diff(self.knots)[:, None], self._slopes
        rise = np.diff(self.nodes, axis=0) / steps
        bend = (slope[:-1] + slope[1:] - 2.0 * rise) / steps
        return np.stack([self.nodes[:-1], slope[:-1], (rise - slope[:-1]) / steps - bend, bend / steps])

    @cached_property
    def arcs(self) -> FloatArray:
        """Arc lengths (k,) of the nodes."""
        return np.append(0.0, np.cumsum(self._length(self.knots[:-1], self.knots[1:])))

    def _length(self, start: FloatArray, end: FloatArray) -> FloatArray:
        """Arc lengths (n,) from parameters ``start`` (n,) to ``end`` (n,), within one interval each."""
        half = 0.5 * (end - start)[:, None]
        points, weights = _gauss()
        t = 0.5 * (start + end)[:, None] + half * points
        speed = np.sqrt((self.derivative(t, 1) ** 2).sum(axis=2))
        return np.asarray((half * weights * speed).sum(axis=1))

    def derivative(self, t: FloatArray, order: int) -> FloatArray:
        """Position (order 0) or its derivatives up to the second at parameters ``t``, shape (..., 2)."""
        t = np.mod(t, self.knots[-1]) if self.closed else t
        k = self._interval(t, self.knots)
        u, total = (t - self.knots[k])[..., None], np.zeros((*t.shape, 2))
        for power in range(3, order - 1, -1):
            total *= u
            total += math.perm(power, order) * self._powers[power].take(k, axis=0)
        return total

    def up_to_second(self, t: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """What :meth:`derivative` says of orders 0, 1 and 2 at parameters ``t`` (n,)."""
        t = np.mod(t, self.knots[-1]) if self.closed else t
        k = self._interval(t, self.knots)
        u, (a, b, c, d) = (t - self.knots[k])[:, None], self._powers.take(k, axis=1)
        twice = 2.0 * c + 6.0 * u * d
        return ((d * u + c) * u + b) * u + a, (3.0 * d * u + 2.0 * c) * u + b, twice

    def _interval(self, values: FloatArray, ends: FloatArray) -> IntArray:
        return np.clip(np.searchsorted(ends, values, side="right") - 1, 0, len(ends) - 2)

    def arc_of(self, t: FloatArray) -> FloatArray:
        """Arc lengths (n,) at parameters ``t`` (n,) between the first and the last knot."""
        k = self._interval(t, self.knots)
        return self.arcs[k] + self._length(self.knots[k], t)

    def parameter_of(self, s: FloatArray) -> FloatArray:
        """Parameters (n,) at arc lengths ``s`` (n,), by Newton's method: speed hardly varies."""
        k = self._interval(s, self.arcs)
        low, high = self.knots[k], self.knots[k + 1]
        t = low + (high - low) * (s - self.arcs[k]) / (self.arcs[k + 1] - self.arcs[k])
        for _ in range(ITERATIONS):
            speed = np.hypot(*self.derivative(t, 1).T)
            step = (self.arcs[k] + self._length(low, t) - s) / speed
            t = np.clip(t - step, low, high)
            if (np.abs(step) <= FINAL_STEP * self.knots[-1]).all():
                break
        return t


@dataclass(frozen=True, eq=False)
class SplinePart:
    """The part of a spline between the nodes ``first`` and ``last``; a whole closed one is closed."""

    spline: NodeSpline
    first: int
    last: int

    @property
    def closed(self) -> bool:
        return self.spline.closed and self.last - self.first == len(self.spline.nodes) - 1

    @property
    def _start(self) -> float:
        return float(self.spline.arcs[self.first])

    @property
    def length(self) -> float:
        return float(self.spline.arcs[self.last]) - self._start

    @property
    def node_arcs(self) -> FloatArray:
        """Arc lengths of the nodes, both ends included."""
        return np.asarray(self.spline.arcs[self.first : self.last + 1] - self._start)

    @cached_property
    def _asked(self) -> list[tuple[FloatArray, FloatArray]]:
        """The arc lengths asked for last, and their parameters."""
        return []

    def _parameter(self, s: FloatArray) -> FloatArray:
        # Points, normals and curvatures are asked for one after the other.
        if self._asked and np.array_equal(self._asked[0][0], s):
            return self._asked[0][1]
        t = self.spline.parameter_of(np.clip(s, 0.0, self.length) + self._start)
        self._asked[:] = [(np.array(s), t)]
        return t

    def points(self, s: FloatArray) -> FloatArray:
        return self.spline.derivative(self._parameter(s), 0)

    def normals(self, s: FloatArray) -> FloatArray:
        return _across(self.spline.derivative(self._parameter(s), 1))

    def curvature(self, s: FloatArray) -> FloatArray:
        t = self._parameter(s)
        (x, y), (u, v) = self.spline.derivative(t, 1).T, self.spline.derivative(t, 2).T
        return np.asarray((x * v - y * u) / np.hypot(x, y) ** 3)

    @cached_property
    def _samples(self) -> tuple[FloatArray, cKDTree]:
        """Parameters in order and a tree of their places."""
        knots = self.spline.knots[self.first : self.last + 1]
        inner = np.arange(SAMPLES) / SAMPLES
        t = np.append((knots[:-1, None] + np.diff(knots)[:, None] * inner).ravel(), knots[-1])
        return t, cKDTree(self.spline.derivative(t[:-1] if self.closed else t, 0))

    def closest(self, points: FloatArray) -> FloatArray:
        t = self._closest(points)
        arc = np.asarray(self.spline.arc_of(t) - self._start)
        # What is there is asked for next.
        self._asked[:] = [(arc.copy(), t)]
        return arc

    def closest_points(self, points: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Points (n, 2) of the curve closest to ``points`` (n, 2), and the normals (n, 2) there."""
        place, along, _ = self.spline.up_to_second(self._closest(points))
        return place, _across(along)

    def _closest(self, points: FloatArray) -> FloatArray:
        """Parameters (n,) of the closest points: the nearest of some samples, then Newton's method, halving
        where it would leave its interval."""
        samples, tree = self._samples
        near = np.asarray(tree.query(points)[1])
        steps = np.diff(samples)
        if self.closed:
            low, high = samples[near] - steps[near - 1], samples[near] + steps[near]
        else:
            low, high = samples[np.maximum(near - 1, 0)], samples[np.minimum(near + 1, len(samples) - 1)]
        t = samples[near]
        for _ in range(ITERATIONS):
            place, along, bend = self.spline.up_to_second(t)
            away = place - points
            slope = (away * along).sum(axis=1)
            growth = (along**2).sum(axis=1) + (away * bend).sum(axis=1)
            low, high = np.where(slope < 0.0, t, low), np.where(slope < 0.0, high, t)
            newton = t - slope / np.where(growth > 0.0, growth, np.inf)
            inside = (growth > 0.0) & (newton >= low) & (newton <= high)
            following = np.where(inside, newton, 0.5 * (low + high))
            done = np.abs(following - t) <= PRECISION * self.spline.knots[-1]
            t = following
            if done.all():
                break
        return np.mod(t, self.spline.knots[-1]) if self.closed else t

    def zones(self) -> tuple[tuple[float, ...], ...]:
        """The chords between nodes: near enough for a node spacing."""
        return tuple(
            row
            for a, b in zip(
                self.spline.nodes[self.first : self.last],
                self.spline.nodes[self.first + 1 : self.last + 1],
                strict=True,
            )
            for row in Segment((float(a[0]), float(a[1])), (float(b[0]), float(b[1]))).zones()
        )


def _across(along: FloatArray) -> FloatArray:
    """Unit normals (n, 2) on the right of ways ``along`` (n, 2)."""
    normal: FloatArray = np.stack([along[:, 1], -along[:, 0]], axis=1)
    return np.asarray(normal / np.hypot(*along.T)[:, None])


def _in_a_row(matrix: sparse.csc_array, rhs: FloatArray) -> FloatArray:
    """Solution (n, c) of a tridiagonal system."""
    if len(rhs) == 1:
        return np.asarray(rhs / matrix.diagonal())
    *_, found, info = dgtsv(*(matrix.diagonal(k) for k in (-1, 0, 1)), rhs)
    assert info == 0
    return np.asarray(found)


def _in_a_ring(matrix: sparse.csc_array, rhs: FloatArray) -> FloatArray:
    """Solution (n, c) of a system that is tridiagonal but for its first and last unknowns, which are
    neighbours too: what is without the last one is."""
    row, column, last = matrix[[-1], :-1].toarray(), matrix[:-1, [-1]].toarray(), matrix[-1, -1]
    both = _in_a_row(matrix[:-1, :-1], np.hstack([rhs[:-1], column]))
    free, by_last = both[:, :-1], both[:, -1:]
    end = (rhs[-1:] - row @ free) / (last - row @ by_last)
    return np.concatenate([free - by_last * end, end])
