"""Hierarchical matrices for large contact grids: kernels between distant clusters by interpolation.

The range is bisected recursively; the kernel between two clusters separated by more than their size is
interpolated at Chebyshev points of both. Memory and time for m hats are then of order m (Hackbusch and Boerm
2002, doi:10.1007/s00607-002-1450-4). Near pairs are integrated as on small grids.

Equation (8) of docs/method.md.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import product
from typing import Any

import numpy as np
import scipy.sparse as sparse

from mlsanm_cli.arrays import FloatArray, IntArray
from mlsanm_cli.contact.geometry.hat_pairs import LOGARITHM, SIGN, Distance, HatPairs, couples
from mlsanm_cli.contact.geometry.panels import chebyshev, lagrange
from mlsanm_cli.roundoff import FINE_ROUND_OFF

LEAF_SIZE = 16
"""Hats per leaf cluster."""
CHEBYSHEV_POINTS = 12
"""Chebyshev points per cluster: the relative error of far integrals is 1e-11."""
ADMISSIBILITY = 0.7
"""Admissibility: least distance of far clusters over the size of the larger one."""
BATCH_SIZE = 2000
"""Hats, or pairs of hats, processed at once, to fit into the processor's cache."""
MIN_WIDTHS = 10.0
"""Least distance of far clusters in widths of the widest interval, for Gauss quadrature to be accurate."""

Chain = tuple[Any, ...]
"""Factors, sparse or dense, of a matrix product."""


@dataclass(frozen=True)
class Clusters:
    """The hats of ``pairs`` in clusters: index ranges ``bounds`` (c, 2), end exclusive, ``supports`` (c, 2),
    and pairs of clusters that are ``far`` (f, 2) and ``close`` (n, 2)."""

    pairs: HatPairs
    bounds: IntArray
    supports: FloatArray
    far: IntArray
    close: IntArray

    @classmethod
    def of(cls, pairs: HatPairs) -> Clusters:
        """Bisect the hats down to leaf clusters."""
        place, nodes, widths = pairs.hats.place, pairs.hats.nodes, pairs.widths
        bounds, halves = [(0, len(place))], dict[int, tuple[int, int]]()
        for number, (first, last) in enumerate(bounds):  # which grows
            if last - first > LEAF_SIZE:
                middle = int(np.searchsorted(place, 0.5 * (place[first] + place[last - 1])))
                middle = min(max(middle, first + LEAF_SIZE // 4), last - LEAF_SIZE // 4)
                halves[number] = len(bounds), len(bounds) + 1
                bounds += [(first, middle), (middle, last)]
        supports = np.array([(nodes[first], nodes[last + 1]) for first, last in bounds])
        widest = [float(widths[first:last].max()) for first, last in bounds]
        size = supports[:, 1] - supports[:, 0]
        far, close, left = [], [], [(0, 0)]
        while left:
            a, b = left.pop()
            gap = max(supports[a, 0] - supports[b, 1], supports[b, 0] - supports[a, 1])
            if gap >= max(ADMISSIBILITY * max(size[a], size[b]), MIN_WIDTHS * max(widest[a], widest[b])):
                far.append((a, b))
            elif a not in halves and b not in halves:
                close.append((a, b))
            elif b not in halves or (a in halves and size[a] >= size[b]):
                left += [(half, b) for half in halves[a]]
            else:
                left += [(a, half) for half in halves[b]]
        shaped = [np.array(one, dtype=np.int64).reshape(-1, 2) for one in (bounds, far, close)]
        return cls(pairs, shaped[0], supports, shaped[1], shaped[2])

    @cached_property
    def _close_pairs(self) -> tuple[IntArray, IntArray]:
        """Pairs (e,) of hats in close clusters, each pair once."""
        (first, beyond), (start, end) = self.bounds[self.close].transpose(1, 2, 0)
        count = (beyond - first) * (end - start)
        number = np.arange(count.sum()) - np.repeat(np.cumsum(count) - count, count)
        row, column = np.divmod(number, np.repeat(end - start, count))
        one, other = np.repeat(first, count) + row, np.repeat(start, count) + column
        return one[one <= other], other[one <= other]

    def near(self, log: FloatArray, turn: FloatArray, along: FloatArray) -> sparse.csr_array:
        """Integrals (m, m) of :meth:`HatPairs.integrals` for hats in close clusters, with directions
        ``along`` (g, 2) on either side; symmetric, since ``log`` is symmetric and ``turn`` antisymmetric."""
        pairs, place, (one, other) = self.pairs, self.pairs.hats.place, self._close_pairs
        total = np.zeros(len(one))
        for function, table in ((LOGARITHM, log), (SIGN, turn)):
            if couples(along, table, along):
                by = along @ table.T
                for first in range(0, len(one), BATCH_SIZE):
                    some = slice(first, first + BATCH_SIZE)
                    total[some] += pairs.quadrature(function, 0.0, one[some], other[some], along, by)
                near = pairs.near(function, 0.0, one, other)
                total[near.chosen] += pairs.correction(near, along, by)
        beside = one < other
        values = np.concatenate([total, total[beside]])
        rows, columns = (np.concatenate([a, b[beside]]) for a, b in ((one, other), (other, one)))
        return sparse.csr_array((values, (rows, columns)), shape=(len(place), len(place)))

    def beyond(self, log: FloatArray, turn: FloatArray, along: FloatArray) -> list[Chain]:
        """Matrix products to be added to :meth:`near` for far clusters."""
        found = list[Chain]()
        for function, table in ((LOGARITHM, log), (SIGN, turn)):
            if not len(self.far) or not couples(along, table, along):
                continue
            count = 1 if function is SIGN else CHEBYSHEV_POINTS
            between = self._between(function, count)
            shares = {c: self._shares(values, count) for c, values in enumerate(along.T) if values.any()}
            for seen, by in product(shares, repeat=2):
                if abs(table[seen, by]) > FINE_ROUND_OFF * np.abs(table).max():
                    spread = sparse.csr_array(table[seen, by] * shares[by].T)
                    found.append((shares[seen], between, spread))
        return found

    @cached_property
    def _used(self) -> IntArray:
        """Clusters that have a far partner."""
        return np.unique(self.far)

    def _points(self, count: int) -> FloatArray:
        """Chebyshev points (u, k) of every used cluster."""
        return np.array([chebyshev(first, last, count) for first, last in self.supports[self._used]])

    def _between(self, function: Distance, count: int) -> sparse.csr_array:
        """Kernel values between the Chebyshev points of far clusters."""
        one, other = np.searchsorted(self._used, self.far).T
        points, within = self._points(count), np.arange(count)
        values = function.values(points[one][:, :, None] - points[other][:, None, :])
        rows, columns = np.broadcast_arrays(
            (one[:, None] * count + within)[:, :, None], (other[:, None] * count + within)[:, None, :]
        )
        return sparse.csr_array(
            (values.ravel(), (rows.ravel(), columns.ravel())), shape=(points.size, points.size)
        )

    def _shares(self, values: FloatArray, count: int) -> sparse.csr_array:
        """Integrals (m, u k) of ``values`` (g,) times every hat times the Lagrange polynomials of its
        clusters."""
        hats, places = self.pairs.hats, self._points(count)
        points, weights = hats.own_points
        at, weights = hats.points[points], weights * values[points]
        first, last = self.bounds[self._used].T
        size = last - first
        cluster = np.repeat(np.arange(len(size)), size)
        rows = np.arange(len(cluster)) - np.repeat(np.cumsum(size) - size, size) + first[cluster]
        found = np.empty((len(rows), count))
        for start in range(0, len(rows), BATCH_SIZE):
            some = slice(start, start + BATCH_SIZE)
            nodes = np.repeat(places[cluster[some]], at.shape[1], axis=0)
            shares = lagrange(at[rows[some]].ravel(), nodes).reshape(-1, at.shape[1], count)
            found[some] = np.einsum("mq,mqk->mk", weights[rows[some]], shares)
        columns = cluster[:, None] * count + np.arange(count)
        entries = found.ravel(), (np.repeat(rows, count), columns.ravel())
        return sparse.csr_array(entries, shape=(len(hats.place), places.size))
