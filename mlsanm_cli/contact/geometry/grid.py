"""The contact grid: pressures and tractions along a contact, piecewise linear on places of their own.

Gaps and slips are averages over the same hat functions, so that what pressures do to gaps is symmetric and
positive whatever the grid (Galerkin's method for the half-plane's logarithm).

Equations (7) and (8) of docs/method.md.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from functools import cached_property, partial
from itertools import product
from typing import Any, TypeAlias

import numpy as np
import scipy.sparse as sparse

from mlsanm_cli.arrays import BoolArray, FloatArray, IntArray
from mlsanm_cli.cloud.cells import GAUSS

Table: TypeAlias = Callable[[FloatArray], FloatArray]
RULE = GAUSS[3]
NEAR = 5.0
"""Hats closer than this many widths are integrated exactly, others by their moments: those have 1e-9 left
there."""
ORDERS = 8
"""Powers of the distances from their places that moments of hats are of."""
CROWDED = 8
"""An interval that ends at a corner is halved towards it so many times."""
NOTHING = 1e-14
THREE = np.arange(3)
STEEPEST = 2.5
"""Neighbouring intervals differ by this factor at most."""


@dataclass(frozen=True)
class PairKernel:
    """A kernel's ``exact`` integrals (e,) with both hats of near pairs, the ``first`` and the ``second``
    (e,), of which some ``overlap`` (e,), and its ``values`` (e, q, q) at the points of both; ``far`` (m, m)
    makes integrals of far pairs of the moments (m, k) of what is on either side."""

    values: FloatArray
    first: IntArray
    second: IntArray
    exact: FloatArray
    overlap: BoolArray
    far: Callable[[FloatArray, FloatArray], FloatArray]


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
        parts = 0.5 ** np.arange(CROWDED, -1, -1)
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
    def _second(self) -> tuple[FloatArray, FloatArray]:
        """Second derivatives of the functions: strengths (m, 3) of the unit impulses at their three nodes,
        and (m, 3) of their first derivatives; of these only half a hat has one."""
        steps = self.steps.astype(np.longdouble)
        left, right = (
            np.where(one > 0.0, 1.0 / np.where(one > 0.0, one, 1.0), 0.0) for one in (steps[:-1], steps[1:])
        )
        impulses = np.stack([left, -(left + right), right], axis=1)
        doublets = np.zeros_like(impulses)
        doublets[:, 1] = (steps[:-1] == 0.0).astype(float) - (steps[1:] == 0.0)
        return impulses, doublets

    @cached_property
    def _own_points(self) -> tuple[IntArray, FloatArray]:
        """The points (m, q) of every function and their weights (m, q) in its integral."""
        shape = len(self.place), -1
        points: IntArray = self.integrals.indices.astype(np.int64).reshape(shape)
        return points, self.integrals.data.reshape(shape)

    def _moments(self, values: FloatArray) -> FloatArray:
        """Integrals (m, k) with every function of ``values`` (g,) at the points times powers of the distance
        from its place."""
        points, weights = self._own_points
        away, part = self.points[points] - self.place[:, None], weights * values[points]
        found = [part.sum(axis=1)]
        for _ in range(ORDERS):
            part *= away
            found.append(part.sum(axis=1))
        return np.stack(found, axis=1)

    def _kernel(
        self, values: Table, shift: float, fourth: Table, third: Table, second: Table, reach: float = NEAR
    ) -> PairKernel:
        """A kernel of the distance s + ``shift`` - s', of which ``fourth``, ``third`` and ``second`` are
        repeated integrals; pairs are near up to a ``reach`` in widths."""
        wide = np.maximum(self.steps[1:], self.steps[:-1])
        way = self.place[:, None] + shift - self.place
        near = np.abs(way) <= reach * (wide[:, None] + wide)
        one, other = np.nonzero(near)
        # In extended precision, as fourth differences lose digits; of every pair of nodes once.
        nodes: Any = self.nodes.astype(np.longdouble)
        count = len(self.place)
        involved = np.zeros((len(nodes), len(nodes)), dtype=bool)
        for a, b in product(range(3), repeat=2):
            involved[a : a + count, b : b + count] |= near
        first, last = np.nonzero(involved)
        number = np.zeros(involved.shape, dtype=np.int64)
        number[first, last] = np.arange(len(first))
        pairs = number[(one[:, None] + THREE)[:, :, None], (other[:, None] + THREE)[:, None, :]]
        t = nodes[first] + shift - nodes[last]
        impulses, doublets = self._second
        exact = np.einsum("ea,eab,eb->e", impulses[one], fourth(t)[pairs], impulses[other])
        if doublets.any():
            rise = third(t)[pairs]
            exact += np.einsum("ea,eab,eb->e", impulses[one], rise, doublets[other])
            exact -= np.einsum("ea,eab,eb->e", doublets[one], rise, impulses[other])
            exact -= np.einsum("ea,eab,eb->e", doublets[one], second(t)[pairs], doublets[other])
        overlap = np.abs(way)[one, other] < wide[one] + wide[other]
        at = self.points[self._own_points[0]]
        seen = values(at[one][:, :, None] + shift - at[other][:, None, :])
        way[near] = 1.0
        return PairKernel(
            seen, one, other, exact.astype(np.float64), overlap, partial(_far, values(way), way)
        )

    @cached_property
    def logarithms(self) -> tuple[PairKernel, ...]:
        """ln|s + shift - s'|, of all :attr:`shifts`: its fourth integral is t^4 / 24 (ln|t| - 25 / 12)."""

        def integral(order: int, factor: int, sum_of_inverses: tuple[int, int]) -> Table:
            harmonic = np.longdouble(sum_of_inverses[0]) / sum_of_inverses[1]
            return lambda t: _power(t, order) / factor * (logarithm(t) - harmonic)

        integrals = integral(4, 24, (25, 12)), integral(3, 6, (11, 6)), integral(2, 2, (3, 2))
        return tuple(self._kernel(logarithm, shift, *integrals) for shift in self.shifts)

    @cached_property
    def signs(self) -> PairKernel:
        """sgn(s - s')."""

        def integral(order: int, factor: int) -> Table:
            return lambda t: np.sign(t) * _power(t, order) / factor

        # Where hats do not overlap, their moments of order 0 are all there is to it.
        found = self._kernel(np.sign, 0.0, integral(4, 24), integral(3, 6), integral(2, 2), 1.0)
        sign = np.sign(self.place[:, None] - self.place)
        return replace(found, far=lambda one, other: sign * np.outer(one[:, 0], other[:, 0]))

    def pairs(self, log: FloatArray, turn: FloatArray, one: FloatArray, other: FloatArray) -> FloatArray:
        """Integrals (m, m) with both hats of one(s)^T (log ln|s - s'| + turn sgn(s - s')) other(s'), with the
        logarithms of all ``shifts``.

        ``log`` and ``turn`` are (2, 2), ``one`` and ``other`` (g, 2) directions at the points.
        """
        logarithms = self._pairs(log, one, other, lambda: self.logarithms)
        return logarithms + self._pairs(turn, one, other, lambda: (self.signs,))

    def _pairs(
        self,
        table: FloatArray,
        one: FloatArray,
        other: FloatArray,
        kernels: Callable[[], Iterable[PairKernel]],
    ) -> FloatArray:
        """The part of :meth:`pairs` by some kernels, of which there is nothing where directions do not
        meet."""
        total = np.zeros((len(self.place), len(self.place)))
        turned = other @ table.T
        middle = [self.at_places(values) for values in (one, turned)]
        if np.abs(middle[0] @ middle[1].T).max(initial=0.0) <= NOTHING * np.abs(table).max():
            return total
        own = self.at_places((one * turned).sum(axis=1, keepdims=True))[:, 0]
        points, weights = self._own_points
        for kernel in kernels():
            first, second = kernel.first, kernel.second
            # What is lost of the near pairs by Gauss's points, for their mean directions, and where they
            # overlap, as it is lost there, for directions at one place.
            product = (middle[0][first] * middle[1][second]).sum(axis=1)
            product = np.where(kernel.overlap, 0.5 * (own[first] + own[second]), product)
            rough = np.einsum("ep,epq,eq->e", weights[first], kernel.values, weights[second])
            near, part = product * (kernel.exact - rough), np.zeros_like(total)
            for seen, by in zip(one.T, turned.T, strict=True):
                if seen.any() and by.any():
                    part += kernel.far(self._moments(seen), self._moments(by))
                    sides = (weights * values[points] for values in (seen, by))
                    near += np.einsum("ep,epq,eq->e", next(sides)[first], kernel.values, next(sides)[second])
            part[first, second] = near
            total += part
        return total

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
            chosen[:-1] |= (steps[:-1] > STEEPEST * steps[1:]) & (steps[1:] > 0.0)
            chosen[1:] |= (steps[1:] > STEEPEST * steps[:-1]) & (steps[:-1] > 0.0)
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


def _far(values: FloatArray, way: FloatArray, one: FloatArray, other: FloatArray) -> FloatArray:
    """Integrals (m, m) of logarithms with ``values`` (m, m) at distances ``way`` (m, m) of moments (m, k) on
    either side, by Taylor's series."""
    total, inverse = values * np.outer(one[:, 0], other[:, 0]), 1.0 / way
    power = np.ones_like(way)
    for order in range(1, ORDERS + 1):
        power *= inverse
        share = np.arange(order + 1)
        factors = [-((-1.0) ** int(k)) * math.comb(order, int(k)) / order for k in share]
        total += power * ((one[:, order - share] * factors) @ other[:, share].T * (-1.0) ** order)
    return total


def _power(t: FloatArray, order: int) -> FloatArray:
    """t^order; numpy takes ten times as long for whole powers in extended precision."""
    return np.asarray(math.prod(order * (t,)))


def _gauss(start: FloatArray, step: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Gauss's points and weights on intervals, all first points first."""
    return np.concatenate([start + at * step for at, _ in RULE]), np.concatenate([w * step for _, w in RULE])
