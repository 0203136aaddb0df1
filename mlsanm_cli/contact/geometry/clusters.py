"""Hierarchical matrices for large contact grids: kernels between distant clusters by interpolation.

The range is bisected recursively; the kernel between two clusters separated by more than their size is
interpolated at Chebyshev points of both. Memory and time for m hats are then of order m (Hackbusch and Boerm
2002, doi:10.1007/s00607-002-1450-4). Near pairs are integrated as on small grids.

Equation (8) of docs/method.md.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import cached_property
from itertools import product
from typing import Any

import numpy as np
import scipy.sparse as sparse

from mlsanm_cli.arrays import FloatArray, IntArray
from mlsanm_cli.contact.geometry.grid import chebyshev, lagrange
from mlsanm_cli.contact.geometry.hat_pairs import LOGARITHM, SIGN, Distance, HatPairs, couples
from mlsanm_cli.records import dataclass
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
    and pairs of clusters that are ``far`` (f, 2) and ``close`` (n, 2), the first of each at coordinates
    increased by a ``shift``."""

    pairs: HatPairs
    shift: float
    bounds: IntArray
    supports: FloatArray
    far: IntArray
    close: IntArray

    @classmethod
    def of(cls, pairs: HatPairs, shift: float = 0.0) -> Clusters:
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
            first, last = supports[a] + shift
            gap = max(first - supports[b, 1], supports[b, 0] - last)
            if gap >= max(ADMISSIBILITY * max(size[a], size[b]), MIN_WIDTHS * max(widest[a], widest[b])):
                far.append((a, b))
            elif a not in halves and b not in halves:
                close.append((a, b))
            elif b not in halves or (a in halves and size[a] >= size[b]):
                left += [(half, b) for half in halves[a]]
            else:
                left += [(a, half) for half in halves[b]]
        shaped = [np.array(one, dtype=np.int64).reshape(-1, 2) for one in (bounds, far, close)]
        return cls(pairs, shift, shaped[0], supports, shaped[1], shaped[2])

    @property
    def _kernels(self) -> tuple[Distance, ...]:
        """The singular kernels; of images in a ring only logarithms count."""
        return (LOGARITHM,) if self.shift else (LOGARITHM, SIGN)

    @cached_property
    def _close_pairs(self) -> tuple[IntArray, IntArray]:
        """Pairs (e,) of hats in close clusters, without a shift each pair once."""
        (first, beyond), (start, end) = self.bounds[self.close].transpose(1, 2, 0)
        count = (beyond - first) * (end - start)
        number = np.arange(count.sum()) - np.repeat(np.cumsum(count) - count, count)
        row, column = np.divmod(number, np.repeat(end - start, count))
        one, other = np.repeat(first, count) + row, np.repeat(start, count) + column
        kept = (one <= other) | bool(self.shift)
        return one[kept], other[kept]

    def near(self, log: FloatArray, turn: FloatArray, along: FloatArray) -> sparse.csr_array:
        """Integrals (m, m) of :meth:`HatPairs.integrals` for hats in close clusters, with directions
        ``along`` (g, 2) on either side; symmetric without a shift, since ``log`` is and ``turn`` is
        antisymmetric."""
        pairs, place, (one, other) = self.pairs, self.pairs.hats.place, self._close_pairs
        total = np.zeros(len(one))
        for function, table in zip(self._kernels, (log, turn), strict=False):
            if couples(along, table, along):
                by = along @ table.T
                for first in range(0, len(one), BATCH_SIZE):
                    some = slice(first, first + BATCH_SIZE)
                    total[some] += pairs.quadrature(function, self.shift, one[some], other[some], along, by)
                near = pairs.near(function, self.shift, one, other)
                total[near.chosen] += pairs.correction(near, along, by)
        shape = (len(place),) * 2
        if self.shift:
            return sparse.csr_array((total, (one, other)), shape=shape)
        beside = one < other
        values = np.concatenate([total, total[beside]])
        rows, columns = (np.concatenate([a, b[beside]]) for a, b in ((one, other), (other, one)))
        return sparse.csr_array((values, (rows, columns)), shape=shape)

    def beyond(self, log: FloatArray, turn: FloatArray, along: FloatArray) -> list[Chain]:
        """Matrix products to be added to :meth:`near` for far clusters: kernel values between their Chebyshev
        points, with shares."""
        used, chains = np.unique(self.far), list[Chain]()
        one, other = np.searchsorted(used, self.far).T
        for function, table in zip(self._kernels, (log, turn), strict=False):
            if not len(self.far) or not couples(along, table, along):
                continue
            count = 1 if function is SIGN else CHEBYSHEV_POINTS
            points = np.array([chebyshev(first, last, count) for first, last in self.supports[used]])
            values = function.values(points[one][:, :, None] + self.shift - points[other][:, None, :])
            place = np.arange(points.size).reshape(points.shape)
            rows, columns = np.broadcast_arrays(place[one][:, :, None], place[other][:, None, :])
            entries = values.ravel(), (rows.ravel(), columns.ravel())
            between = sparse.csr_array(entries, shape=(points.size, points.size))
            chains += self._chains(table, along, between, self.bounds[used], points)
        return chains

    def around(self, log: FloatArray, turn: FloatArray, along: FloatArray) -> list[Chain]:
        """Matrix products for the rest of the kernels of a ring, without one turn forwards and backwards: it
        is smooth over the whole range."""
        hats, found = self.pairs.hats, list[Chain]()
        points = chebyshev(float(hats.nodes[0]), float(hats.nodes[-1]), CHEBYSHEV_POINTS)
        apart = points[:, None] - points
        span = np.array([[0, len(hats.place)]])
        for function, table in ((LOGARITHM, log), (SIGN, turn)):
            plain = sum(function.values(apart + shift) for shift in hats.shifts)
            smooth = self.pairs.kernel(function, apart) - plain
            if function is LOGARITHM:
                # The values at equal points are limits.
                np.fill_diagonal(smooth, -sum(np.log(abs(shift)) for shift in hats.shifts if shift))
            found += self._chains(table, along, smooth, span, points[None])
        return found

    def _chains(
        self, table: FloatArray, along: FloatArray, between: Any, spans: IntArray, points: FloatArray
    ) -> Iterator[Chain]:
        """Matrix products for the kernel values ``between`` the ``points`` (u, k) of clusters with hats
        ``spans`` (u, 2), end exclusive, times a tensor ``table`` (2, 2)."""
        shares = {c: self._shares(values, spans, points) for c, values in enumerate(along.T) if values.any()}
        for seen, by in product(shares, repeat=2):
            if abs(table[seen, by]) > FINE_ROUND_OFF * np.abs(table).max():
                yield shares[seen], between, sparse.csr_array(table[seen, by] * shares[by].T)

    def _shares(self, values: FloatArray, spans: IntArray, places: FloatArray) -> sparse.csr_array:
        """Integrals (m, u k) of ``values`` (g,) times every hat times the Lagrange polynomials of ``places``
        (u, k) of its clusters, of hats ``spans`` (u, 2)."""
        hats, count = self.pairs.hats, places.shape[1]
        points, weights = hats.own_points
        at, weights = hats.points[points], weights * values[points]
        first, last = spans.T
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


def hierarchical(
    pairs: HatPairs, log: FloatArray, turn: FloatArray, along: FloatArray
) -> tuple[sparse.csr_array, list[Chain]]:
    """:meth:`HatPairs.integrals` with directions ``along`` (g, 2) on either side: near entries (m, m), and
    matrix products."""
    clusters, period = Clusters.of(pairs), pairs.hats.period
    near, far = clusters.near(log, turn, along), clusters.beyond(log, turn, along)
    if period is None:
        return near, far
    ahead = Clusters.of(pairs, period)
    beside, beyond = ahead.near(log, turn, along), ahead.beyond(log, turn, along)
    # One turn backwards is the transpose of one forwards.
    behind = [tuple(one.T for one in reversed(chain)) for chain in beyond]
    total = sparse.csr_array(near + beside + beside.T)
    return total, [*far, *beyond, *behind, *clusters.around(log, turn, along)]
