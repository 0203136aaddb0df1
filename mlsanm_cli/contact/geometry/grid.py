"""Contact grid: piecewise linear pressures and tractions on nodes independent of the clouds. Gaps and slips
are averaged over the same hat functions (Galerkin), so that the compliance is symmetric and positive definite
on any grid. Also interpolation along a contact, at Chebyshev points and on logarithmic panels."""

from __future__ import annotations

from dataclasses import replace
from functools import cached_property

import numpy as np
import scipy.sparse as sparse

from mlsanm_cli.arrays import BoolArray, FloatArray, IntArray
from mlsanm_cli.cloud.cells import GAUSS
from mlsanm_cli.records import dataclass

RULE = GAUSS[3]
END_HALVINGS = 8
"""Number of halvings of an interval towards a corner at its end."""
MAX_RATIO = 2.5
"""Largest ratio of neighbouring intervals."""
PANEL, PANEL_POINTS = 0.5, 10
"""Width of panels in the logarithm of the distance from a corner, and points per panel: corner terms are
accurate to 1e-6 for a corner of 25 degrees, to 1e-10 for 90 degrees."""


@dataclass(frozen=True)
class Hats:
    """Hat functions on increasing ``nodes`` (m + 2,), zero at the first and the last one. At a contact that
    ends at a corner the first or last two nodes coincide, which makes a half hat. On a closed surface of
    length ``period`` the first and last nodes are the same point."""

    nodes: FloatArray
    period: float | None = None

    @classmethod
    def on(cls, nodes: FloatArray, whole: tuple[bool, bool], period: float | None = None) -> Hats:
        """Hats on increasing ``nodes``, with half hats at ``whole`` ends."""
        first, last = int(whole[0]), len(nodes) - int(whole[1])
        return cls(np.concatenate([nodes[:first], nodes, nodes[last:]]), period)

    @property
    def shifts(self) -> tuple[float, ...]:
        """Offsets under which a coordinate recurs: 0, and on a closed surface one period either way."""
        return (0.0,) if self.period is None else (0.0, self.period, -self.period)

    @property
    def whole(self) -> tuple[bool, bool]:
        """Which ends have a half hat."""
        return bool(self.steps[0] == 0.0), bool(self.steps[-1] == 0.0)

    @property
    def ends(self) -> FloatArray:
        """Distinct nodes: ends of the intervals."""
        first, last = self.whole
        return self.nodes[int(first) : len(self.nodes) - int(last)]

    @property
    def place(self) -> FloatArray:
        """Coordinates of the m peaks."""
        return self.nodes[1:-1]

    @cached_property
    def steps(self) -> FloatArray:
        """Lengths (m + 1,) of the intervals."""
        return np.diff(self.nodes)

    @cached_property
    def weight(self) -> FloatArray:
        """Integrals (m,) of the hats."""
        return np.asarray(0.5 * (self.steps[1:] + self.steps[:-1]))

    @cached_property
    def points(self) -> FloatArray:
        """Gauss points (g,): the first point of every interval, then the second of every interval."""
        return _gauss(self.nodes[:-1], self.steps)[0]

    @cached_property
    def integrals(self) -> sparse.csr_array:
        """Integration matrix (m, g): values at ``points`` times every hat."""
        points, weights = _gauss(self.nodes[:-1], self.steps)
        return self._integrals(points, np.tile(np.arange(len(self.steps)), len(RULE)), weights)

    @cached_property
    def towards_ends(self) -> tuple[FloatArray, sparse.csr_array]:
        """Points (e,) graded towards the ends, for kernels of the logarithm of the distance from them, and
        the integration matrix (m, e) with the hats."""
        parts = np.append(0.0, 0.5 ** np.arange(END_HALVINGS, -1, -1))
        ends, interval = [self.nodes[:-1]], [np.arange(len(self.steps))]
        for place in self.nodes[[0, -1]].tolist():
            for number in np.flatnonzero((self.nodes[:-1] <= place) & (place <= self.nodes[1:])).tolist():
                first, last = self.nodes[number], self.nodes[number + 1]
                inner = np.concatenate([place + (last - place) * parts, place + (first - place) * parts])
                inner = np.unique(inner[(inner > first) & (inner < last)])
                ends.append(inner)
                interval.append(np.full(len(inner), number))
        starts, owner = np.concatenate(ends), np.concatenate(interval)
        order = np.lexsort((starts, owner))
        starts, owner = starts[order], owner[order]
        steps = np.append(starts[1:], self.nodes[-1]) - starts
        kept = steps > 0.0
        points, weights = _gauss(starts[kept], steps[kept])
        return points, self._integrals(points, np.tile(owner[kept], len(RULE)), weights)

    def _integrals(self, points: FloatArray, interval: IntArray, weights: FloatArray) -> sparse.csr_array:
        """Integration matrix (m, e) for ``points`` (e,) in intervals (e,) with ``weights`` (e,)."""
        step = self.steps[interval]
        share = np.where(step > 0.0, (points - self.nodes[interval]) / np.where(step > 0.0, step, 1.0), 0.0)
        row, value = np.concatenate([interval - 1, interval]), np.concatenate([1.0 - share, share])
        column, count = np.tile(np.arange(len(points)), 2), len(self.place)
        kept = (row >= 0) & (row < count)
        entries = (value * np.tile(weights, 2))[kept]
        return sparse.csr_array((entries, (row[kept], column[kept])), shape=(count, len(points)))

    @cached_property
    def own_points(self) -> tuple[IntArray, FloatArray]:
        """Quadrature points (m, q) in every hat's support and their weights (m, q), hat included."""
        shape = len(self.place), -1
        points: IntArray = self.integrals.indices.astype(np.int64).reshape(shape)
        return points, self.integrals.data.reshape(shape)

    def at_places(self, values: FloatArray) -> FloatArray:
        """Averages (m, c) over the hats of ``values`` (g, c) at the points."""
        return np.asarray(self.integrals @ values) / self.weight[:, None]

    def halved(self, chosen: BoolArray) -> Hats:
        """Halve the ``chosen`` intervals (m + 1,), and further ones to keep the ratio of neighbours."""
        nodes, chosen = self.nodes, chosen & (self.steps > 0.0)
        while chosen.any():
            nodes = np.sort(np.append(nodes, (0.5 * (nodes[1:] + nodes[:-1]))[chosen]))
            steps = np.diff(nodes)
            chosen = np.zeros(len(steps), dtype=bool)
            chosen[:-1] |= (steps[:-1] > MAX_RATIO * steps[1:]) & (steps[1:] > 0.0)
            chosen[1:] |= (steps[1:] > MAX_RATIO * steps[:-1]) & (steps[:-1] > 0.0)
        return replace(self, nodes=nodes)

    def errors(self, values: FloatArray) -> FloatArray:
        """Contribution of every interval (m + 1,) to the L2 error of nodal ``values`` (m,), from their second
        differences: h^(5/2) |p''| / sqrt(120), the terms of equation (9) of docs/method.md."""
        padded = np.pad(values, 1)
        bend = np.zeros(len(padded))
        # A half hat has no interval beyond it to form a second difference.
        rise = np.diff(padded) / np.where(self.steps > 0.0, self.steps, np.inf)
        inner = (self.steps[1:] > 0.0) & (self.steps[:-1] > 0.0)
        bend[1:-1] = np.where(inner, np.abs(np.diff(rise)) / self.weight, 0.0)
        return np.asarray(self.steps**2.5 * np.maximum(bend[1:], bend[:-1]) / np.sqrt(120.0))

    def norm(self, values: FloatArray) -> float:
        """L2 norm of the piecewise linear function with nodal ``values`` (m,)."""
        return l2(self.nodes, np.pad(values, 1))


def _gauss(start: FloatArray, step: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Gauss points and weights on intervals, all first points first."""
    return np.concatenate([start + at * step for at, _ in RULE]), np.concatenate([w * step for _, w in RULE])


def l2(arc: FloatArray, values: FloatArray) -> float:
    """L2 norm of the piecewise linear function with ``values`` (m,) at ``arc`` (m,)."""
    a, b = values[:-1], values[1:]
    return float(np.sqrt((np.diff(arc) * (a * a + a * b + b * b) / 3.0).sum()))


def chebyshev(first: float, last: float, count: int) -> FloatArray:
    """Chebyshev points (k,) of the first kind on an interval, increasing."""
    angle = np.pi * (np.arange(count) + 0.5) / count
    return 0.5 * (first + last) - 0.5 * (last - first) * np.cos(angle)


def lagrange(places: FloatArray, nodes: FloatArray) -> FloatArray:
    """Lagrange polynomials (e, k) at ``places`` (e,) for Chebyshev ``nodes`` (k,), or (e, k) individual ones,
    by the barycentric formula (Berrut and Trefethen 2004, doi:10.1137/S0036144502417715)."""
    count = nodes.shape[-1]
    factor = (-1.0) ** np.arange(count) * np.sin(np.pi * (np.arange(count) + 0.5) / count)
    apart = places[:, None] - nodes
    same = apart == 0.0
    share = factor / np.where(same, 1.0, apart)
    values = share / share.sum(axis=1, keepdims=True)
    row = same.any(axis=1)
    values[row] = same[row]
    return np.asarray(values)


def on_panels(x: FloatArray) -> tuple[FloatArray, sparse.csr_array]:
    """Chebyshev points (k,) on panels in ln x that cover ``x`` (e,) > 0, and interpolation (e, k) in ln x."""
    t = np.log(x)
    count = max(1, int(np.ceil(float(np.ptp(t)) / PANEL)))
    if count * PANEL_POINTS >= len(x):
        return x, sparse.csr_array(sparse.eye_array(len(x), format="csr"))
    width = float(np.ptp(t)) / count
    panel = np.clip(((t - t.min()) / width).astype(np.int64), 0, count - 1)
    nodes = chebyshev(0.0, 1.0, PANEL_POINTS)
    values = lagrange((t - t.min()) / width - panel, nodes)
    column = panel[:, None] * PANEL_POINTS + np.arange(PANEL_POINTS)
    start = np.arange(len(x) + 1) * PANEL_POINTS
    entries = values.ravel(), column.ravel(), start
    shares = sparse.csr_array(entries, shape=(len(x), count * PANEL_POINTS))
    return np.exp(t.min() + width * (np.arange(count)[:, None] + nodes).ravel()), shares
