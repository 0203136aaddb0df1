"""Interpolating splines through boundary nodes, which keep the curvature of a smooth outline. Cubic splines
over chord length (de Boor 1978, doi:10.1007/978-1-4612-6333-3): positions converge with h^4 and normals with
h^3; those of chords converge with h^2 and h."""

from __future__ import annotations

from functools import cached_property

import numpy as np
from scipy.linalg.lapack import dgtsv
from scipy.spatial import cKDTree

from mlsanm_cli.arrays import FloatArray, IntArray
from mlsanm_cli.cloud.curves import Curve, chord_zones
from mlsanm_cli.records import dataclass
from mlsanm_cli.roundoff import LAST_DIGITS, ROUND_OFF

POINTS, WEIGHTS = np.polynomial.legendre.leggauss(6)
"""Gauss points and weights of an interval for arc lengths."""
WRAPPED = 60
"""Nodes by which a closed curve overlaps itself for its slopes: 2^-60 is below round-off."""
SAMPLES = 4
"""Samples per interval for the initial guess of the closest point."""
MAX_ITERATIONS = 60
NEWTON_TOLERANCE = 5e-8
"""A Newton step below this fraction of the curve is the last one: convergence is quadratic."""


@dataclass(frozen=True, eq=False)
class NodeSpline:
    """Cubic spline through ``nodes`` (k, 2), in order; a closed one repeats its first node at the end."""

    nodes: FloatArray
    closed: bool

    @cached_property
    def knots(self) -> FloatArray:
        """Parameters (k,) of the nodes: cumulative chord length."""
        return np.append(0.0, np.cumsum(np.hypot(*np.diff(self.nodes, axis=0).T)))

    @cached_property
    def _slopes(self) -> FloatArray:
        """First derivatives (k, 2) at the knots: C2 everywhere, not-a-knot at the ends of open curves."""
        if not self.closed:
            return _slopes(self.nodes)
        # Several times around: the influence of the ends at least halves from knot to knot.
        around = np.arange(-WRAPPED, len(self.nodes) + WRAPPED) % (len(self.nodes) - 1)
        return _slopes(self.nodes[around])[WRAPPED:-WRAPPED]

    @cached_property
    def _powers(self) -> FloatArray:
        """Coefficients (4, k - 1, 2) of the powers of the distance from the previous knot."""
        steps, slope = np.diff(self.knots)[:, None], self._slopes
        rise = np.diff(self.nodes, axis=0) / steps
        bend = (slope[:-1] + slope[1:] - 2.0 * rise) / steps
        return np.stack([self.nodes[:-1], slope[:-1], (rise - slope[:-1]) / steps - bend, bend / steps])

    @cached_property
    def arcs(self) -> FloatArray:
        """Arc lengths (k,) of the nodes."""
        return np.append(0.0, np.cumsum(self._length(self.knots[:-1], self.knots[1:])))

    def _length(self, start: FloatArray, end: FloatArray) -> FloatArray:
        """Arc lengths (n,) from parameters ``start`` (n,) to ``end`` (n,), each within one interval."""
        half = 0.5 * (end - start)[:, None]
        speed = np.sqrt((self.derivatives(0.5 * (start + end)[:, None] + half * POINTS)[1] ** 2).sum(axis=2))
        return np.asarray((half * WEIGHTS * speed).sum(axis=1))

    def derivatives(self, t: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Position, first and second derivative at parameters ``t``, each (..., 2)."""
        t = np.mod(t, self.knots[-1]) if self.closed else t
        k = self._interval(t, self.knots)
        u, (a, b, c, d) = (t - self.knots[k])[..., None], self._powers.take(k, axis=1)
        twice = 2.0 * c + 6.0 * u * d
        return ((d * u + c) * u + b) * u + a, (3.0 * d * u + 2.0 * c) * u + b, twice

    def _interval(self, values: FloatArray, ends: FloatArray) -> IntArray:
        return np.clip(np.searchsorted(ends, values, side="right") - 1, 0, len(ends) - 2)

    def parameter_of(self, s: FloatArray) -> FloatArray:
        """Parameters (n,) at arc lengths ``s`` (n,), by Newton's method: the speed is nearly constant."""
        turns, s = np.divmod(s, self.arcs[-1]) if self.closed else (0.0, s)
        k = self._interval(s, self.arcs)
        low, high = self.knots[k], self.knots[k + 1]
        t = low + (high - low) * (s - self.arcs[k]) / (self.arcs[k + 1] - self.arcs[k])
        for _ in range(MAX_ITERATIONS):
            speed = np.hypot(*self.derivatives(t)[1].T)
            step = (self.arcs[k] + self._length(low, t) - s) / speed
            t = np.clip(t - step, low, high)
            if (np.abs(step) <= NEWTON_TOLERANCE * self.knots[-1]).all():
                break
        return np.asarray(t + turns * self.knots[-1])

    def arc_of(self, t: FloatArray) -> FloatArray:
        """Arc lengths (n,) at parameters ``t`` (n,)."""
        turns, t = np.divmod(t, self.knots[-1]) if self.closed else (0.0, t)
        k = self._interval(t, self.knots)
        return np.asarray(turns * self.arcs[-1] + self.arcs[k] + self._length(self.knots[k], t))

    def between(self, first: int, last: int) -> Spline:
        """The curve between two nodes."""
        return Spline(self, float(self.arcs[first]), float(self.arcs[last]))


@dataclass(frozen=True, eq=False)
class Spline(Curve):
    """The part of a ``spline`` between the arc lengths ``first`` and ``last``; the whole of a closed one is
    closed, and its parts may pass its start."""

    spline: NodeSpline
    first: float
    last: float

    @property
    def length(self) -> float:
        return self.last - self.first

    @property
    def closed(self) -> bool:
        return self.spline.closed and self.length == self.spline.arcs[-1]

    @cached_property
    def _knots(self) -> FloatArray:
        """Parameters (k,) of both ends and of the nodes between them."""
        first, last = self.spline.parameter_of(np.array([self.first, self.last]))
        knots = self.spline.knots
        if self.spline.closed:
            knots = np.append(knots[:-1], knots + knots[-1])
        small = ROUND_OFF * (last - first)
        return np.concatenate([[first], knots[(knots > first + small) & (knots < last - small)], [last]])

    @property
    def node_arcs(self) -> FloatArray:
        """Arc lengths (k,) of both ends and of the nodes between them."""
        return self.spline.arc_of(self._knots) - self.first

    @property
    def data_points(self) -> int:
        return len(self._knots)

    @cached_property
    def _last_query(self) -> list[tuple[FloatArray, FloatArray]]:
        """Cache of the last arc lengths and their parameters."""
        return []

    def _parameter(self, s: FloatArray) -> FloatArray:
        # Points, normals and curvatures are evaluated at the same arc lengths in turn.
        if self._last_query and np.array_equal(self._last_query[0][0], s):
            return self._last_query[0][1]
        t = self.spline.parameter_of(np.clip(s, 0.0, self.length) + self.first)
        self._last_query[:] = [(np.array(s), t)]
        return t

    def points(self, s: FloatArray) -> FloatArray:
        return self.spline.derivatives(self._parameter(s))[0]

    def normals(self, s: FloatArray) -> FloatArray:
        return _across(self.spline.derivatives(self._parameter(s))[1])

    def curvature(self, s: FloatArray) -> FloatArray:
        _, (x, y), (u, v) = (one.T for one in self.spline.derivatives(self._parameter(s)))
        return np.asarray((x * v - y * u) / np.hypot(x, y) ** 3)

    @cached_property
    def _samples(self) -> tuple[FloatArray, cKDTree]:
        """Sample parameters in ascending order, and a search tree of their points."""
        knots, inner = self._knots, np.arange(SAMPLES) / SAMPLES
        t = np.append((knots[:-1, None] + np.diff(knots)[:, None] * inner).ravel(), knots[-1])
        return t, cKDTree(self.spline.derivatives(t[:-1] if self.closed else t)[0])

    def closest(self, points: FloatArray) -> FloatArray:
        t = self._closest(points)
        arc = np.clip(self.spline.arc_of(t) - self.first, 0.0, self.length)
        # The same arc lengths are evaluated next.
        self._last_query[:] = [(arc.copy(), t)]
        return arc

    def closest_points(self, points: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Points (n, 2) of the curve closest to ``points`` (n, 2), and the normals (n, 2) there."""
        place, along, _ = self.spline.derivatives(self._closest(points))
        return place, _across(along)

    def _closest(self, points: FloatArray) -> FloatArray:
        """Parameters (n,) of the closest points: nearest sample, then Newton's method safeguarded by
        bisection."""
        samples, tree = self._samples
        near = np.asarray(tree.query(points)[1])
        steps = np.diff(samples)
        if self.closed:
            low, high = samples[near] - steps[near - 1], samples[near] + steps[near]
        else:
            low, high = samples[np.maximum(near - 1, 0)], samples[np.minimum(near + 1, len(samples) - 1)]
        t = samples[near]
        for _ in range(MAX_ITERATIONS):
            place, along, bend = self.spline.derivatives(t)
            away = place - points
            slope = (away * along).sum(axis=1)
            growth = (along**2).sum(axis=1) + (away * bend).sum(axis=1)
            low, high = np.where(slope < 0.0, t, low), np.where(slope < 0.0, high, t)
            newton = t - slope / np.where(growth > 0.0, growth, np.inf)
            inside = (growth > 0.0) & (newton >= low) & (newton <= high)
            following = np.where(inside, newton, 0.5 * (low + high))
            done = np.abs(following - t) <= LAST_DIGITS * self.spline.knots[-1]
            t = following
            if done.all():
                break
        return np.mod(t, self.spline.knots[-1]) if self.closed else t

    def part(self, first: float, last: float) -> Spline:
        return Spline(self.spline, self.first + first, self.first + last)

    def merged(self, following: Curve) -> Spline | None:
        if not isinstance(following, Spline) or following.spline is not self.spline:
            return None
        whole, length = float(self.spline.arcs[-1]), self.length + following.length
        if abs(length - whole) > ROUND_OFF * whole:
            return Spline(self.spline, self.first, self.first + length)
        # The whole of a closed curve starts where the curve does, not at the first part.
        return Spline(self.spline, 0.0, whole) if not self.spline.closed or self.first == 0.0 else None

    def zones(self) -> tuple[tuple[float, ...], ...]:
        """Chords between nodes, which are accurate enough for a spacing field."""
        return chord_zones(self.spline.derivatives(self._knots)[0])


def _across(along: FloatArray) -> FloatArray:
    """Unit normals (n, 2) on the right of the tangents ``along`` (n, 2)."""
    normal: FloatArray = np.stack([along[:, 1], -along[:, 0]], axis=1)
    return np.asarray(normal / np.hypot(*along.T)[:, None])


def _slopes(nodes: FloatArray) -> FloatArray:
    """First derivatives (k, 2) at the knots of the not-a-knot spline through ``nodes`` (k, 2). Own code, as
    importing scipy's splines costs more than it does."""
    steps = np.hypot(*np.diff(nodes, axis=0).T)
    rise = np.diff(nodes, axis=0) / steps[:, None]
    before, behind = steps[:-1], steps[1:]
    both = before + behind
    inner = 3.0 * (behind[:, None] * rise[:-1] + before[:, None] * rise[1:])
    if len(steps) == 1:
        return np.repeat(rise, 2, axis=0)
    if len(steps) == 2:  # a parabola
        middle = inner / (3.0 * both)
        return np.concatenate([2.0 * rise[:1] - middle, middle, 2.0 * rise[1:] - middle])

    def end(near: int, far: int, sum_: float) -> FloatArray:
        one, other = steps[near], steps[far]
        return np.asarray(((one + 2.0 * sum_) * other * rise[near] + one**2 * rise[far]) / sum_)

    diagonal = np.concatenate([behind[:1], 2.0 * both, before[-1:]])
    upper, lower = np.append(both[0], before), np.append(behind, both[-1])
    rhs = np.concatenate([[end(0, 1, both[0])], inner, [end(-1, -2, both[-1])]])
    *_, found, info = dgtsv(lower, diagonal, upper, rhs)
    assert info == 0
    return np.asarray(found)
