"""The contact grid: pressures and tractions along a contact, piecewise linear on places of their own.

Gaps and slips are averages over the same hat functions, so that what pressures do to gaps is symmetric and
positive whatever the grid (Galerkin's method for the half-plane's logarithm).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import scipy.sparse as sparse

from mlsanm_cli.arrays import BoolArray, FloatArray, IntArray
from mlsanm_cli.cloud.cells import GAUSS

RULE = GAUSS[3]
CORNER_HALVINGS = 8
"""Number of halvings of an interval towards a corner."""
MAX_LENGTH_RATIO = 2.5
"""Largest ratio of the lengths of adjacent intervals."""


@dataclass(frozen=True)
class Hats:
    """Piecewise linear functions on ``nodes`` (m + 2,), increasing, that vanish at the first and the last.

    Where a contact ends at a corner the first two nodes, or the last two, are one place, and the function of
    that place is half a hat. If a contact goes all around a closed surface, of length ``period``, the first
    and the last place are the same.
    """

    nodes: FloatArray
    period: float | None = None

    @classmethod
    def on(cls, nodes: FloatArray, whole: tuple[bool, bool], period: float | None = None) -> Hats:
        """On ``nodes``, increasing, with half a hat at the ends that are ``whole``."""
        before = nodes[:1] if whole[0] else nodes[:0]
        after = nodes[-1:] if whole[1] else nodes[:0]
        return cls(np.concatenate([before, nodes, after]), period)

    @property
    def shifts(self) -> tuple[float, ...]:
        """By which places are at once, 0 and on a closed surface a turn ahead and back."""
        return (0.0,) if self.period is None else (0.0, self.period, -self.period)

    @property
    def whole(self) -> tuple[bool, bool]:
        """At which ends there is half a hat."""
        return bool(self.steps[0] == 0.0), bool(self.steps[-1] == 0.0)

    @property
    def ends(self) -> FloatArray:
        """Where the intervals begin and end, every place once."""
        first, last = self.whole
        return self.nodes[int(first) : len(self.nodes) - int(last)]

    @property
    def place(self) -> FloatArray:
        """Where the m functions have their peaks."""
        return self.nodes[1:-1]

    @cached_property
    def steps(self) -> FloatArray:
        """Lengths (m + 1,) of the intervals."""
        return np.diff(self.nodes)

    @cached_property
    def weight(self) -> FloatArray:
        """Integrals (m,) of the functions."""
        return np.asarray(0.5 * (self.steps[1:] + self.steps[:-1]))

    @cached_property
    def points(self) -> FloatArray:
        """Gauss's points (g,), interval by interval."""
        return _gauss(self.nodes[:-1], self.steps)[0]

    @cached_property
    def integrals(self) -> sparse.csr_array:
        """What makes integrals with every function of values at the ``points``: (m, g)."""
        points, weights = _gauss(self.nodes[:-1], self.steps)
        return self._integrals(points, np.tile(np.arange(len(self.steps)), len(RULE)), weights)

    @cached_property
    def towards_ends(self) -> tuple[FloatArray, sparse.csr_array]:
        """Points (e,) that crowd towards the ends, for kernels that change with the logarithm of the distance
        from there, and what makes integrals (m, e) with the functions."""
        starts, steps, interval = self.nodes[:-1], self.steps, np.arange(len(self.steps))
        parts = 0.5 ** np.arange(CORNER_HALVINGS, -1, -1)
        first, last = int(self.whole[0]), len(self.steps) - 1 - self.whole[1]
        for number, ends in ((last, 1.0 - np.append(parts[::-1], 0.0)), (first, np.append(0.0, parts))):
            crowded = starts[number] + steps[number] * ends
            starts, steps, interval = (
                np.concatenate([whole[:number], part, whole[number + 1 :]])
                for whole, part in (
                    (starts, crowded[:-1]),
                    (steps, np.diff(crowded)),
                    (interval, np.full(len(ends) - 1, number)),
                )
            )
        kept = steps > 0.0
        points, weights = _gauss(starts[kept], steps[kept])
        return points, self._integrals(points, np.tile(interval[kept], len(RULE)), weights)

    def _integrals(self, points: FloatArray, interval: IntArray, weights: FloatArray) -> sparse.csr_array:
        """What makes integrals (m, e) of values at ``points`` (e,) in intervals (e,), of ``weights`` (e,)."""
        step = self.steps[interval]
        share = np.where(step > 0.0, (points - self.nodes[interval]) / np.where(step > 0.0, step, 1.0), 0.0)
        row, value = np.concatenate([interval - 1, interval]), np.concatenate([1.0 - share, share])
        column, count = np.tile(np.arange(len(points)), 2), len(self.place)
        kept = (row >= 0) & (row < count)
        entries = (value * np.tile(weights, 2))[kept]
        return sparse.csr_array((entries, (row[kept], column[kept])), shape=(count, len(points)))

    @cached_property
    def own_points(self) -> tuple[IntArray, FloatArray]:
        """The points (m, q) of every function and their weights (m, q) in its integral."""
        shape = len(self.place), -1
        points: IntArray = self.integrals.indices.astype(np.int64).reshape(shape)
        return points, self.integrals.data.reshape(shape)

    def at_places(self, values: FloatArray) -> FloatArray:
        """Means (m, c) over the hats of ``values`` (g, c) at the points."""
        return np.asarray(self.integrals @ values) / self.weight[:, None]

    def halved(self, chosen: BoolArray) -> Hats:
        """With the ``chosen`` intervals (m + 1,) halved, and others that would be too much wider than their
        neighbours."""
        nodes, chosen = self.nodes, chosen & (self.steps > 0.0)
        while chosen.any():
            nodes = np.sort(np.append(nodes, (0.5 * (nodes[1:] + nodes[:-1]))[chosen]))
            steps = np.diff(nodes)
            chosen = np.zeros(len(steps), dtype=bool)
            chosen[:-1] |= (steps[:-1] > MAX_LENGTH_RATIO * steps[1:]) & (steps[1:] > 0.0)
            chosen[1:] |= (steps[1:] > MAX_LENGTH_RATIO * steps[:-1]) & (steps[:-1] > 0.0)
        return replace(self, nodes=nodes)

    def errors(self, values: FloatArray) -> FloatArray:
        """What every interval (m + 1,) has of the L2 error of nodal ``values`` (m,), by their second
        differences: h^(5/2) |p''| / sqrt(120)."""
        padded = np.concatenate([[0.0], values, [0.0]])
        bend = np.zeros(len(padded))
        # Half a hat has no pressures beyond it that its own could differ from.
        rise = np.diff(padded) / np.where(self.steps > 0.0, self.steps, np.inf)
        inner = (self.steps[1:] > 0.0) & (self.steps[:-1] > 0.0)
        bend[1:-1] = np.where(inner, np.abs(np.diff(rise)) / self.weight, 0.0)
        return np.asarray(self.steps**2.5 * np.maximum(bend[1:], bend[:-1]) / np.sqrt(120.0))

    def norm(self, values: FloatArray) -> float:
        """L2 norm of nodal ``values`` (m,), joined linearly."""
        padded = np.concatenate([[0.0], values, [0.0]])
        a, b = padded[:-1], padded[1:]
        return float(np.sqrt((self.steps * (a * a + a * b + b * b) / 3.0).sum()))


def logarithm(distance: FloatArray) -> FloatArray:
    """ln|distance|, 0 where there is none."""
    return np.asarray(np.log(np.where(distance == 0.0, 1.0, np.abs(distance))))


def _gauss(start: FloatArray, step: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Gauss's points and weights on intervals, all first points first."""
    return np.concatenate([start + at * step for at, _ in RULE]), np.concatenate([w * step for _, w in RULE])
