"""Double integrals of half-plane kernels with the hat functions of a contact grid.

Near pairs of hats are integrated exactly, in extended precision, by repeated integrals of the kernel; distant
pairs by multipole moments about their peaks.

Equations (7) and (8) of docs/method.md.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import cached_property
from typing import Any, TypeAlias

import numpy as np

from mlsanm_cli.arrays import BoolArray, FloatArray, IntArray
from mlsanm_cli.contact.geometry.grid import Hats, logarithm

Table: TypeAlias = Callable[[FloatArray], FloatArray]
NEAR_WIDTHS = 5.0
"""Pairs closer than this many widths are integrated exactly; the error of moments beyond is 1e-9."""
MOMENT_ORDERS = 8
"""Highest order of the moments."""
ZERO_COMPONENT = 1e-14
THREE = np.arange(3)
BATCH_SIZE = 50_000
"""Pairs processed at once, to fit into the processor's cache."""


@dataclass(frozen=True)
class Distance:
    """A kernel of the distance along a contact: its ``values``, its fourth, third and second repeated
    ``integrals``, and the ``reach`` in widths up to which pairs are integrated by these. A kernel
    ``constant`` on either side of 0 needs moments of order 0 only. The ``parity`` is 1 for even and -1 for
    odd kernels."""

    values: Table
    integrals: tuple[Table, Table, Table]
    reach: float
    constant: bool
    parity: float


@dataclass(frozen=True)
class NearPairs:
    """The ``exact`` double integrals (e,) of a kernel with the ``first`` and ``second`` (e,) hats of pairs,
    some of which ``overlap`` (e,), and its ``values`` (e, q, q) at the points of both."""

    values: FloatArray
    first: IntArray
    second: IntArray
    exact: FloatArray
    overlap: BoolArray

    def opposite(self, parity: float) -> NearPairs:
        """The pairs in reverse order, of a function of given parity."""
        values = parity * self.values.transpose(0, 2, 1)
        return NearPairs(values, self.second, self.first, parity * self.exact, self.overlap)


@dataclass(frozen=True)
class HatPairs:
    """Double integrals with all pairs of ``hats``."""

    hats: Hats

    @cached_property
    def second_derivatives(self) -> tuple[FloatArray, FloatArray]:
        """Second derivatives of the hats: strengths (m, 3) of delta functions at their three nodes, and (m,
        3) of first derivatives of delta functions, which only half hats have."""
        steps = self.hats.steps.astype(np.longdouble)
        left, right = (
            np.where(one > 0.0, 1.0 / np.where(one > 0.0, one, 1.0), 0.0) for one in (steps[:-1], steps[1:])
        )
        impulses = np.stack([left, -(left + right), right], axis=1)
        doublets = np.zeros_like(impulses)
        doublets[:, 1] = (steps[:-1] == 0.0).astype(float) - (steps[1:] == 0.0)
        return impulses, doublets

    @cached_property
    def widths(self) -> FloatArray:
        """Wider interval (m,) of every hat."""
        return np.asarray(np.maximum(self.hats.steps[1:], self.hats.steps[:-1]))

    def moments(self, values: FloatArray) -> FloatArray:
        """Moments (m, k): integrals of ``values`` (g,) times every hat times powers of the distance from its
        peak."""
        points, weights = self.hats.own_points
        away, part = self.hats.points[points] - self.hats.place[:, None], weights * values[points]
        found = [part.sum(axis=1)]
        for _ in range(MOMENT_ORDERS):
            part *= away
            found.append(part.sum(axis=1))
        return np.stack(found, axis=1)

    def near(self, function: Distance, shift: float, one: IntArray, other: IntArray) -> NearPairs:
        """A kernel ``function`` of s + ``shift`` - s' for pairs (e,) of hats ``one`` and ``other``."""
        hats, wide = self.hats, self.widths
        # Extended precision, as fourth differences lose digits; once per pair of nodes.
        nodes: Any = hats.nodes.astype(np.longdouble)
        lowest, highest = int((other - one).min(initial=0)) - 2, int((other - one).max(initial=0)) + 2
        first, last = (one[:, None] + THREE)[:, :, None], (other[:, None] + THREE)[:, None, :]
        beside = last - first - lowest
        number = np.zeros((len(nodes), highest - lowest + 1), dtype=np.int32)
        number[first, beside] = 1
        rows, columns = np.nonzero(number)
        number[rows, columns] = np.arange(len(rows))
        pairs = number[first, beside]
        t = nodes[rows] + shift - nodes[rows + columns + lowest]
        impulses, doublets = self.second_derivatives
        fourth, third, second = function.integrals
        exact = np.einsum("ea,eab,eb->e", impulses[one], fourth(t)[pairs], impulses[other])
        if doublets.any():
            rise = third(t)[pairs]
            exact += np.einsum("ea,eab,eb->e", impulses[one], rise, doublets[other])
            exact -= np.einsum("ea,eab,eb->e", doublets[one], rise, impulses[other])
            exact -= np.einsum("ea,eab,eb->e", doublets[one], second(t)[pairs], doublets[other])
        way = np.abs(hats.place[one] + shift - hats.place[other])
        at = hats.points[hats.own_points[0]]
        seen = function.values(at[one][:, :, None] + shift - at[other][:, None, :])
        return NearPairs(seen, one, other, exact.astype(np.float64), way < wide[one] + wide[other])

    def directed(self, near: NearPairs, one: FloatArray, turned: FloatArray) -> FloatArray:
        """Double integrals (e,) of near pairs with directions ``one`` and ``turned`` (g, 2) at the points."""
        points, weights = self.hats.own_points
        first, second = near.first, near.second
        middle = [self.hats.at_places(values) for values in (one, turned)]
        own = self.hats.at_places((one * turned).sum(axis=1, keepdims=True))[:, 0]
        # Correction of the quadrature error for the mean directions; for overlapping pairs, where the error
        # arises at coinciding points, for directions at the same point.
        both = (middle[0][first] * middle[1][second]).sum(axis=1)
        both = np.where(near.overlap, 0.5 * (own[first] + own[second]), both)
        rough = np.einsum("ep,epq,eq->e", weights[first], near.values, weights[second])
        total = both * (near.exact - rough)
        for seen, by in zip(one.T, turned.T, strict=True):
            if seen.any() and by.any():
                sides = (weights * values[points] for values in (seen, by))
                total += np.einsum("ep,epq,eq->e", next(sides)[first], near.values, next(sides)[second])
        return np.asarray(total)

    @cached_property
    def logarithms(self) -> tuple[tuple[NearPairs, FloatArray], ...]:
        """For every shift, the near pairs of ln|s + shift - s'|, each once without a shift, and the distances
        (m, m) of the others."""
        return tuple(self._parted(LOGARITHM, shift) for shift in self.hats.shifts)

    @cached_property
    def signs(self) -> tuple[NearPairs, FloatArray]:
        """The same for sgn(s - s')."""
        return self._parted(SIGN, 0.0)

    def _parted(self, function: Distance, shift: float) -> tuple[NearPairs, FloatArray]:
        way = self.hats.place[:, None] + shift - self.hats.place
        close = np.abs(way) <= function.reach * (self.widths[:, None] + self.widths)
        found = self.near(function, shift, *np.nonzero(close if shift else np.triu(close)))
        way[close] = 1.0
        return found, way

    def integrals(self, log: FloatArray, turn: FloatArray, one: FloatArray, other: FloatArray) -> FloatArray:
        """Double integrals (m, m) of one(s)^T (log ln|s - s'| + turn sgn(s - s')) other(s') with the hats,
        with the logarithms of all shifts. ``log`` and ``turn`` are (2, 2), ``one`` and ``other`` (g, 2)
        directions at the points."""
        logarithms = self._integrals(LOGARITHM, log, one, other, lambda: self.logarithms)
        return logarithms + self._integrals(SIGN, turn, one, other, lambda: (self.signs,))

    def meet(self, table: FloatArray, one: FloatArray, turned: FloatArray) -> bool:
        """Whether directions ``one`` and ``turned`` (g, 2) have common components, judged by the extreme
        ones."""
        extreme = []
        for values in (one, turned):
            middle = self.hats.at_places(values)
            extreme.append(middle[np.concatenate([middle.argmin(axis=0), middle.argmax(axis=0)])])
        both = np.abs(extreme[0] @ extreme[1].T)
        return bool(both.max(initial=0.0) > ZERO_COMPONENT * np.abs(table).max())

    def _integrals(
        self,
        function: Distance,
        table: FloatArray,
        one: FloatArray,
        other: FloatArray,
        parted: Callable[[], Iterable[tuple[NearPairs, FloatArray]]],
    ) -> FloatArray:
        """Part of :meth:`integrals` by one kernel; zero if the directions have no common components."""
        total = np.zeros((len(self.hats.place), len(self.hats.place)))
        turned = other @ table.T
        if not self.meet(table, one, turned):
            return total
        acting = [(a, b) for a, b in zip(one.T, turned.T, strict=True) if a.any() and b.any()]
        moments = [np.stack([self.moments(side) for side in sides]) for sides in zip(*acting, strict=True)]
        odd = np.abs(table - function.parity * table.T).max()
        symmetric = np.array_equal(one, other) and odd <= ZERO_COMPONENT * np.abs(table).max()
        for shift, (near, way) in zip(self.hats.shifts, parted(), strict=False):
            part = np.zeros_like(total)
            if acting:
                part = function.values(way) * (moments[0][:, :, 0].T @ moments[1][:, :, 0])
                if not function.constant:
                    part += _beyond(way, *moments)
            found = self.directed(near, one, turned)
            part[near.first, near.second] = found
            if not shift:
                back = found if symmetric else self.directed(near.opposite(function.parity), one, turned)
                part[near.second, near.first] = back
            total += part
        return total


def _beyond(way: FloatArray, one: FloatArray, other: FloatArray) -> FloatArray:
    """Taylor series of double integrals of logarithms at distances ``way`` (m, m) beyond order zero, from
    moments (c, m, k) of components on either side."""
    total, inverse = np.zeros_like(way), 1.0 / way
    power = np.ones_like(way)
    for order in range(1, MOMENT_ORDERS + 1):
        power *= inverse
        share = np.arange(order + 1)
        left, right = np.concatenate(one[:, :, order - share] * taylor(order), axis=1), other[:, :, share]
        total += power * (left @ np.concatenate(right, axis=1).T)
    return total


def taylor(order: int) -> FloatArray:
    """Coefficients (order + 1,) of products of moments in the series of ln|t + a - b|."""
    share = np.arange(order + 1)
    binomial = np.array([math.comb(order, int(k)) for k in share])
    return np.asarray(-((-1.0) ** (order + share)) * binomial / order)


def far_logarithms(way: FloatArray, one: FloatArray, other: FloatArray) -> FloatArray:
    """Double integrals (e,) of logarithms at distances ``way`` (e,), from moments (e, k)."""
    total = np.empty(len(way))
    for first in range(0, len(way), BATCH_SIZE):
        some = slice(first, first + BATCH_SIZE)
        a, b, inverse = one[some].T, other[some].T, 1.0 / way[some]
        part, power = np.log(np.abs(way[some])) * a[0] * b[0], np.ones(len(inverse))
        for order in range(1, MOMENT_ORDERS + 1):
            power = power * inverse
            factors = taylor(order)
            part += power * sum(factors[k] * a[order - k] * b[k] for k in range(order + 1))
        total[some] = part
    return total


def _power(t: FloatArray, order: int) -> FloatArray:
    """t^order; numpy's power is ten times as slow for integer exponents in extended precision."""
    return np.asarray(math.prod(order * (t,)))


def _logarithmic(order: int, factor: int, sum_of_inverses: tuple[int, int]) -> Table:
    """Repeated integral of ln|t|; the fourth is t^4 / 24 (ln|t| - 25 / 12)."""
    harmonic = np.longdouble(sum_of_inverses[0]) / sum_of_inverses[1]
    return lambda t: _power(t, order) / factor * (logarithm(t) - harmonic)


def _signed(order: int, factor: int) -> Table:
    """Repeated integral of sgn(t)."""
    return lambda t: np.sign(t) * _power(t, order) / factor


LOGARITHM = Distance(
    logarithm,
    (_logarithmic(4, 24, (25, 12)), _logarithmic(3, 6, (11, 6)), _logarithmic(2, 2, (3, 2))),
    NEAR_WIDTHS,
    constant=False,
    parity=1.0,
)
SIGN = Distance(np.sign, (_signed(4, 24), _signed(3, 6), _signed(2, 2)), 1.0, constant=True, parity=-1.0)
