"""Double integrals of half-plane kernels with the hat functions of a contact grid.

All pairs of hats are integrated by Gauss quadrature. For near pairs its error with constant directions is
added, from exact integrals in extended precision by repeated integrals of the kernel.

Equations (7) and (8) of docs/method.md.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import cached_property
from typing import Any, NamedTuple, TypeAlias

import numpy as np

from mlsanm_cli.arrays import BoolArray, FloatArray, IntArray
from mlsanm_cli.cloud.membership import MAX_PAIRS
from mlsanm_cli.contact.geometry.grid import Hats
from mlsanm_cli.records import dataclass
from mlsanm_cli.roundoff import FINE_ROUND_OFF

Table: TypeAlias = Callable[[FloatArray], FloatArray]
NEAR_WIDTHS = 5.0
"""Pairs closer than this many widths are integrated exactly; the error of quadrature beyond is 1e-9."""
THREE = np.arange(3)


class Distance(NamedTuple):
    """A kernel of the distance along a contact: ``values``, with all ``images`` on a ring of a circumference,
    fourth to first repeated ``integrals``, and the ``reach`` in widths up to which pairs use these."""

    values: Table
    images: Callable[[FloatArray, float], FloatArray]
    integrals: tuple[Table, ...]
    reach: float


class NearPairs(NamedTuple):
    """Near pairs, ``chosen`` among others, of the hats ``first`` and ``second`` (e,), some of which
    ``overlap`` (e,), and the ``error`` (e,) of quadrature for a kernel of s + ``shift`` - s'."""

    function: Distance
    shift: float
    chosen: IntArray
    first: IntArray
    second: IntArray
    overlap: BoolArray
    error: FloatArray


@dataclass(frozen=True)
class HatPairs:
    """Double integrals with all pairs of ``hats``."""

    hats: Hats

    @cached_property
    def second_derivatives(self) -> tuple[FloatArray, FloatArray]:
        """Second derivatives of the hats: strengths (m, 3) of delta functions at their three nodes, and (m,
        3) of first derivatives of delta functions, which only half hats have."""
        steps = self.hats.steps.astype(np.longdouble)
        slopes = np.where(steps > 0.0, 1.0 / np.where(steps > 0.0, steps, 1.0), 0.0)
        left, right = slopes[:-1], slopes[1:]
        impulses = np.stack([left, -(left + right), right], axis=1)
        doublets = np.zeros_like(impulses)
        doublets[:, 1] = (steps[:-1] == 0.0).astype(float) - (steps[1:] == 0.0)
        return impulses, doublets

    @cached_property
    def widths(self) -> FloatArray:
        """Wider interval (m,) of every hat."""
        return np.asarray(np.maximum(self.hats.steps[1:], self.hats.steps[:-1]))

    def near(self, function: Distance, shift: float, one: IntArray, other: IntArray) -> NearPairs:
        """The near ones among pairs (e,) of hats ``one`` and ``other``. The exact integrals are fourth
        differences, in extended precision as these lose digits; once per pair of nodes."""
        way = np.abs(self.hats.place[one] + shift - self.hats.place[other])
        wide = self.widths[one] + self.widths[other]
        chosen = np.flatnonzero(way <= function.reach * wide)
        one, other, overlap = one[chosen], other[chosen], (way < wide)[chosen]
        nodes: Any = self.hats.nodes.astype(np.longdouble)
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
        fourth, third, second, _ = function.integrals
        exact = np.einsum("ea,eab,eb->e", impulses[one], fourth(t)[pairs], impulses[other])
        if doublets.any():
            rise = third(t)[pairs]
            exact += np.einsum("ea,eab,eb->e", impulses[one], rise, doublets[other])
            exact -= np.einsum("ea,eab,eb->e", doublets[one], rise, impulses[other])
            exact -= np.einsum("ea,eab,eb->e", doublets[one], second(t)[pairs], doublets[other])
        ones = np.ones((len(self.hats.points), 1))
        error = np.asarray(exact, dtype=np.float64)
        error -= self.quadrature(function, shift, one, other, ones, ones)
        return NearPairs(function, shift, chosen, one, other, overlap, error)

    def kernel(self, function: Distance, apart: FloatArray) -> FloatArray:
        """Values (...) of a kernel at distances (...) along the contact, with its images on a ring."""
        period = self.hats.period
        return function.values(apart) if period is None else function.images(apart, period)

    def quadrature(
        self, function: Distance, shift: float, one: IntArray, other: IntArray, *along: FloatArray
    ) -> FloatArray:
        """Double integrals (e,) of a kernel with pairs of hats and directions ``along`` which it is seen and
        acts (g, c) at the points, by Gauss quadrature."""
        points, weights = self.hats.own_points
        at = self.hats.points[points]
        values = function.values(at[one][:, :, None] + shift - at[other][:, None, :])
        left, right = (weights[:, :, None] * side[points] for side in along)
        return np.asarray(np.einsum("epc,epq,eqc->e", left[one], values, right[other]))

    def at(self, function: Distance, places: FloatArray) -> FloatArray:
        """Integrals (e, m) with the hats of a kernel of the distance from ``places`` (e,), with images."""
        hats, (impulses, doublets) = self.hats, self.second_derivatives
        *_, second, first = function.integrals
        values = np.asarray((hats.integrals @ self.kernel(function, places[:, None] - hats.points).T).T)
        points, weights = hats.own_points
        for shift in hats.shifts if function is LOGARITHM else (0.0,):
            apart = places[:, None] + shift - hats.place
            row, column = np.nonzero(np.abs(apart) <= 2.0 * function.reach * self.widths)
            t: Any = (places[row, None] + shift) - hats.nodes.astype(np.longdouble)[column[:, None] + THREE]
            exact = (impulses[column] * second(t) + doublets[column] * first(t)).sum(axis=1)
            away = places[row, None] + shift - hats.points[points[column]]
            rough = (weights[column] * function.values(away)).sum(axis=1)
            values[row, column] += np.asarray(exact, dtype=np.float64) - rough
        return values

    def correction(self, near: NearPairs, seen: FloatArray, by: FloatArray) -> FloatArray:
        """Correction (e,) of quadrature for near pairs with directions ``seen`` and ``by`` (g, 2): for the
        mean directions; for overlapping pairs, where the error arises at coinciding points, for directions at
        the same point."""
        middle = [self.hats.at_places(values) for values in (seen, by)]
        own = self.hats.at_places((seen * by).sum(axis=1, keepdims=True))[:, 0]
        both = (middle[0][near.first] * middle[1][near.second]).sum(axis=1)
        both = np.where(near.overlap, 0.5 * (own[near.first] + own[near.second]), both)
        return np.asarray(both * near.error)

    @cached_property
    def _near(self) -> list[NearPairs]:
        """The near pairs of sgn(s - s'), and of ln|s + shift - s'| for every shift."""
        every = np.indices((len(self.widths),) * 2).reshape(2, -1)
        logarithms = [self.near(LOGARITHM, shift, *every) for shift in self.hats.shifts]
        return [self.near(SIGN, 0.0, *every), *logarithms]

    def integrals(self, log: FloatArray, turn: FloatArray, one: FloatArray, other: FloatArray) -> FloatArray:
        """Double integrals (m, m) of one(s)^T (log ln|s - s'| + turn sgn(s - s')) other(s') with the hats,
        images included. ``log`` and ``turn`` are (2, 2), ``one`` and ``other`` (g, 2) at the points."""
        hats, points = self.hats, self.hats.points
        total = np.zeros((len(hats.place), len(hats.place)))
        for near in self._near:
            table = turn if near.function is SIGN else log
            if not couples(one, table, other):
                continue
            by = other @ table.T
            whole = 0 if near.shift else 1 + len(points) ** 2 // MAX_PAIRS
            for some in np.array_split(np.arange(len(points)), whole) if whole else ():
                values = self.kernel(near.function, points[:, None] - points[some])
                values *= one @ by[some].T
                total += (hats.integrals[:, some] @ (hats.integrals @ values).T).T
            total[near.first, near.second] += self.correction(near, one, by)
        return total


def couples(one: FloatArray, table: FloatArray, other: FloatArray) -> bool:
    """Whether a tensor (2, 2) couples directions ``one`` and ``other`` (g, 2), judged by the extreme ones."""
    ends = (side[np.concatenate([side.argmin(axis=0), side.argmax(axis=0)])] for side in (one, other))
    both = np.abs(next(ends) @ table @ next(ends).T)
    return bool(both.max() > FINE_ROUND_OFF * np.abs(table).max())


def logarithm(distance: FloatArray) -> FloatArray:
    """ln|distance|, 0 at zero distance."""
    size = np.abs(distance)
    size[size == 0.0] = 1.0
    return np.asarray(np.log(size, out=size))


def _power(t: FloatArray, order: int) -> FloatArray:
    """t^n / n!; products are ten times as fast as numpy's power in extended precision."""
    return np.asarray(math.prod(order * (t,)) / math.factorial(order))


def _logarithmic(order: int, numerator: int, denominator: int) -> Table:
    """Repeated integral t^n / n! (ln|t| - H_n) of ln|t|."""
    harmonic = np.longdouble(numerator) / denominator
    return lambda t: np.asarray(_power(t, order) * (logarithm(t) - harmonic))


def _signed(order: int) -> Table:
    """Repeated integral of sgn(t)."""
    return lambda t: np.asarray(np.sign(t) * _power(t, order))


LOGARITHM = Distance(
    logarithm,
    lambda t, period: logarithm(np.sin(np.pi / period * t) * (period / np.pi)),
    (_logarithmic(4, 25, 12), _logarithmic(3, 11, 6), _logarithmic(2, 3, 2), _logarithmic(1, 1, 1)),
    NEAR_WIDTHS,
)
"""ln|t|; on a ring up to a constant."""
SIGN = Distance(
    np.sign,
    lambda t, period: np.asarray(np.sign(t) - 2.0 / period * t),
    (_signed(4), _signed(3), _signed(2), np.abs),
    1.0,
)
"""sgn(t); on a ring the images add up to a function of zero mean."""
