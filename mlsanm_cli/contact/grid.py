"""The contact grid: pressures and tractions along a contact, piecewise linear on places of their own.

Gaps and slips are averages over the same hat functions, so that what pressures do to gaps is symmetric and
positive whatever the grid (Galerkin's method for the half-plane's logarithm).
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property
from typing import TypeAlias

import numpy as np
import scipy.sparse as sparse

from mlsanm_cli.arrays import BoolArray, FloatArray, IntArray
from mlsanm_cli.cloud.cells import GAUSS
from mlsanm_cli.values import dataclass

Kernels: TypeAlias = tuple[FloatArray, FloatArray]
"""A kernel at all pairs of points, and its exact integrals of near pairs."""

RULE = GAUSS[3]
NEAR = 5.0
"""Hats closer than this many widths are integrated exactly, others by Gauss's points: those have 1e-8 left
there."""
NOTHING = 1e-14
STEEPEST = 2.5
"""Neighbouring intervals differ by this factor at most."""


@dataclass(frozen=True)
class Hats:
    """Piecewise linear functions on ``nodes`` (m + 2,), increasing, that vanish at the first and the last."""

    nodes: FloatArray

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
        return np.concatenate([self.nodes[:-1] + at * self.steps for at, _ in RULE])

    @cached_property
    def integrals(self) -> sparse.csr_array:
        """What makes integrals with every function of values at the ``points``: (m, g)."""
        count, number = len(self.steps), np.arange(len(self.steps))
        rows, columns, values = [], [], []
        for turn, (at, weight) in enumerate(RULE):
            for shift, share in ((-1, 1.0 - at), (0, at)):
                rows.append(number + shift)
                columns.append(turn * count + number)
                values.append(weight * share * self.steps)
        row, column, value = (np.concatenate(some) for some in (rows, columns, values))
        kept = (row >= 0) & (row < count - 1)
        shape = (count - 1, len(RULE) * count)
        return sparse.csr_array((value[kept], (row[kept], column[kept])), shape=shape)

    @cached_property
    def near(self) -> tuple[IntArray, IntArray]:
        """Pairs of functions that are near each other or the same."""
        wide = np.maximum(self.steps[1:], self.steps[:-1])
        apart = np.abs(self.place[:, None] - self.place)
        one, other = np.nonzero(apart <= NEAR * (wide[:, None] + wide))
        return one, other

    @cached_property
    def logarithms(self) -> FloatArray:
        """ln|s - s'| at all pairs of the ``points`` (g, g), 0 where they are the same."""
        apart = np.abs(self.points[:, None] - self.points)
        np.fill_diagonal(apart, 1.0)
        return np.asarray(np.log(apart))

    @cached_property
    def signs(self) -> FloatArray:
        """sgn(s - s') at all pairs of the ``points`` (g, g)."""
        return np.sign(self.points[:, None] - self.points)

    def _differences(self, table: FloatArray) -> FloatArray:
        """Second divided differences, along both axes, of a ``table`` (e, 3, 3) of values at near pairs'
        nodes: integrals with hats of what the values are fourth integrals of."""
        one, other = self.near
        left, right = 1.0 / self.steps[:-1].astype(np.longdouble), 1.0 / self.steps[1:].astype(np.longdouble)
        factors = np.stack([left, -(left + right), right], axis=1)
        return np.asarray(np.einsum("ea,eab,eb->e", factors[one], table, factors[other]), dtype=np.float64)

    @cached_property
    def _apart(self) -> FloatArray:
        """Distances (e, 3, 3) between the nodes of near pairs of hats, in extended precision."""
        one, other = self.near
        nodes, three = self.nodes.astype(np.longdouble), np.arange(3)
        return np.asarray(nodes[one[:, None] + three][:, :, None] - nodes[other[:, None] + three][:, None, :])

    @cached_property
    def near_logarithms(self) -> FloatArray:
        """Integrals of ln|s - s'| with both hats of every near pair (e,): t^4 / 24 (ln|t| - 25 / 12) is its
        fourth integral."""
        t = self._apart
        size = np.where(t == 0.0, 1.0, np.abs(t))
        return self._differences(t**4 / 24.0 * (np.log(size) - np.longdouble(25.0) / 12.0))

    @cached_property
    def near_signs(self) -> FloatArray:
        """The same (e,) of sgn(s - s')."""
        t = self._apart
        return self._differences(np.sign(t) * t**4 / 24.0)

    def pairs(self, log: FloatArray, turn: FloatArray, one: FloatArray, other: FloatArray) -> FloatArray:
        """Integrals (m, m) with both hats of one(s)^T (log ln|s - s'| + turn sgn(s - s')) other(s').

        ``log`` and ``turn`` are (2, 2), ``one`` and ``other`` (g, 2) directions at the points.
        """
        logarithms = self._pairs(log, one, other, lambda: (self.logarithms, self.near_logarithms))
        return logarithms + self._pairs(turn, one, other, lambda: (self.signs, self.near_signs))

    def _pairs(
        self, table: FloatArray, one: FloatArray, other: FloatArray, kernels: Callable[[], Kernels]
    ) -> FloatArray:
        """The part of :meth:`pairs` by one kernel, of which there is nothing where directions do not meet."""
        total = np.zeros((len(self.place), len(self.place)))
        turned = other @ table.T
        middle = [self.at_places(values) for values in (one, turned)]
        if np.abs(middle[0] @ middle[1].T).max(initial=0.0) <= NOTHING * np.abs(table).max():
            return total
        kernel, exact = kernels()
        for component in (0, 1):
            right = kernel @ (self.integrals * turned[:, component]).T.toarray()
            total += (self.integrals * one[:, component]) @ right
        # What is lost of the near pairs by Gauss's points, for the directions at the peaks.
        first, second = self.near
        product = (middle[0][first] * middle[1][second]).sum(axis=1)
        total[first, second] += product * (exact - self._rough(kernel)[first, second])
        return total

    def _rough(self, kernel: FloatArray) -> FloatArray:
        return np.asarray(self.integrals @ (kernel @ self.integrals.T.toarray()))

    def at_places(self, values: FloatArray) -> FloatArray:
        """Means (m, c) over the hats of ``values`` (g, c) at the points."""
        return np.asarray(self.integrals @ values) / self.weight[:, None]

    def halved(self, chosen: BoolArray) -> Hats:
        """With the ``chosen`` intervals (m + 1,) halved, and others that would be too much wider than their
        neighbours."""
        nodes = self.nodes
        while chosen.any():
            nodes = np.sort(np.append(nodes, (0.5 * (nodes[1:] + nodes[:-1]))[chosen]))
            steps = np.diff(nodes)
            chosen = np.zeros(len(steps), dtype=bool)
            chosen[:-1] |= steps[:-1] > STEEPEST * steps[1:]
            chosen[1:] |= steps[1:] > STEEPEST * steps[:-1]
        return Hats(nodes)

    def errors(self, values: FloatArray) -> FloatArray:
        """What every interval (m + 1,) has of the L2 error of nodal ``values`` (m,), by their second
        differences: h^(5/2) |p''| / sqrt(120)."""
        padded = np.concatenate([[0.0], values, [0.0]])
        bend = np.zeros(len(padded))
        bend[1:-1] = np.abs(np.diff(np.diff(padded) / self.steps)) / self.weight
        return np.asarray(self.steps**2.5 * np.maximum(bend[1:], bend[:-1]) / np.sqrt(120.0))

    def norm(self, values: FloatArray) -> float:
        """L2 norm of nodal ``values`` (m,), joined linearly."""
        padded = np.concatenate([[0.0], values, [0.0]])
        a, b = padded[:-1], padded[1:]
        return float(np.sqrt((self.steps * (a * a + a * b + b * b) / 3.0).sum()))


def chebyshev(first: float, last: float, count: int) -> FloatArray:
    """Chebyshev's points (k,) of the first kind between two places, increasing."""
    angle = np.pi * (np.arange(count) + 0.5) / count
    return 0.5 * (first + last) - 0.5 * (last - first) * np.cos(angle)


def lagrange(places: FloatArray, nodes: FloatArray) -> FloatArray:
    """Values (e, k) at ``places`` of the polynomials that are 1 at one and 0 at all other Chebyshev's points
    ``nodes`` (k,), by the barycentric formula (Berrut and Trefethen 2004, doi:10.1137/S0036144502417715)."""
    count = len(nodes)
    factor = (-1.0) ** np.arange(count) * np.sin(np.pi * (np.arange(count) + 0.5) / count)
    apart = places[:, None] - nodes
    same = apart == 0.0
    share = factor / np.where(same, 1.0, apart)
    values = share / share.sum(axis=1, keepdims=True)
    row = same.any(axis=1)
    values[row] = same[row]
    return np.asarray(values)
