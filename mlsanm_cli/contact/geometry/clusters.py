"""Hierarchical matrices for large contact grids: kernels between distant clusters by interpolation.

The range is bisected recursively; the kernel between two clusters separated by more than their size is
interpolated at Chebyshev points of both. Memory and time for m hats are then of order m (Hackbusch and Boerm
2002, doi:10.1007/s00607-002-1450-4). Near pairs are integrated as on small grids.

Equation (8) of docs/method.md.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import product
from typing import Any

import numpy as np
import scipy.sparse as sparse

from mlsanm_cli.arrays import FloatArray, IntArray
from mlsanm_cli.contact.geometry.grid import Hats, chebyshev, lagrange
from mlsanm_cli.contact.geometry.hat_pairs import LOGARITHM, SIGN, Distance, HatPairs, couples
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


def hierarchical(
    pairs: HatPairs, log: FloatArray, turn: FloatArray, along: FloatArray
) -> tuple[sparse.csr_array, list[Chain]]:
    """Near entries (m, m) and matrix products of :meth:`HatPairs.integrals`, ``along`` (g, 2) either side."""
    kernels = [each for each in ((LOGARITHM, log), (SIGN, turn)) if couples(along, each[1], along)]
    near, far = _integrals(pairs, 0.0, kernels, along)
    hats, period = pairs.hats, pairs.hats.period
    if period is None:
        return near, far
    # Of images in a ring, one turn forwards, whose transpose is one backwards. The rest is smooth over the
    # whole range.
    logarithms = [one for one in kernels if one[0] is LOGARITHM]
    ahead, beyond = _integrals(pairs, period, logarithms, along)
    far += beyond + [tuple(one.T for one in reversed(chain)) for chain in beyond]
    points = chebyshev(float(hats.nodes[0]), float(hats.nodes[-1]), CHEBYSHEV_POINTS)
    apart, whole = points[:, None] - points, np.array([[0, len(hats.place)]])
    for function, table in kernels:
        smooth = pairs.kernel(function, apart) - sum(function.values(apart + shift) for shift in hats.shifts)
        if function is LOGARITHM:
            # The values at equal points are limits.
            np.fill_diagonal(smooth, -sum(np.log(abs(shift)) for shift in hats.shifts if shift))
        far += _chains(hats, table, along, smooth, whole, points[None])
    return sparse.csr_array(near + ahead + ahead.T), far


def _integrals(
    pairs: HatPairs, shift: float, kernels: list[tuple[Distance, FloatArray]], along: FloatArray
) -> tuple[sparse.csr_array, list[Chain]]:
    """Near integrals (m, m), and matrix products for far clusters, of kernels of s + ``shift`` - s'."""
    place, nodes, widths = pairs.hats.place, pairs.hats.nodes, pairs.widths
    # Bisect the hats down to leaf clusters: index ranges, end exclusive.
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
    far, close, left = list[tuple[int, int]](), list[tuple[int, int]](), [(0, 0)]
    while left:
        a, b = left.pop()
        start, end = supports[a] + shift
        gap = max(start - supports[b, 1], supports[b, 0] - end)
        if gap >= max(ADMISSIBILITY * max(size[a], size[b]), MIN_WIDTHS * max(widest[a], widest[b])):
            far.append((a, b))
        elif a not in halves and b not in halves:
            close.append((a, b))
        elif b not in halves or (a in halves and size[a] >= size[b]):
            left += [(half, b) for half in halves[a]]
        else:
            left += [(a, half) for half in halves[b]]
    ranges = np.array(bounds, dtype=np.int64)
    near, chains = _near(pairs, shift, ranges[np.array(close)], kernels, along), list[Chain]()
    if far:
        used = np.unique(np.array(far))
        one, other = np.searchsorted(used, np.array(far)).T
        for function, table in kernels:
            # Kernel values between Chebyshev points of far clusters.
            count = 1 if function is SIGN else CHEBYSHEV_POINTS
            points = np.array([chebyshev(first, last, count) for first, last in supports[used]])
            values = function.values(points[one][:, :, None] + shift - points[other][:, None, :])
            index = np.arange(points.size).reshape(points.shape)
            rows, columns = np.broadcast_arrays(index[one][:, :, None], index[other][:, None, :])
            entries = values.ravel(), (rows.ravel(), columns.ravel())
            between = sparse.csr_array(entries, shape=(points.size, points.size))
            chains += _chains(pairs.hats, table, along, between, ranges[used], points)
    return near, chains


def _chains(
    hats: Hats, table: FloatArray, along: FloatArray, between: Any, ranges: IntArray, points: FloatArray
) -> Iterator[Chain]:
    """Matrix products for the kernel values ``between`` the ``points`` (u, k) of clusters with hats
    ``ranges`` (u, 2), end exclusive, times a tensor ``table`` (2, 2)."""
    count, (inner, weights) = points.shape[1], hats.own_points
    first, last = ranges.T
    size = last - first
    cluster = np.repeat(np.arange(len(size)), size)
    rows = np.arange(len(cluster)) - np.repeat(np.cumsum(size) - size, size) + first[cluster]
    indices = np.repeat(rows, count), (cluster[:, None] * count + np.arange(count)).ravel()
    shares = {}
    for c, values in enumerate(along.T):
        if not values.any():
            continue
        # Integrals of the directions times every hat times the Lagrange polynomials of its clusters.
        at, acting, found = hats.points[inner], weights * values[inner], np.empty((len(rows), count))
        for start in range(0, len(rows), BATCH_SIZE):
            some = slice(start, start + BATCH_SIZE)
            nodes = np.repeat(points[cluster[some]], at.shape[1], axis=0)
            each = lagrange(at[rows[some]].ravel(), nodes).reshape(-1, at.shape[1], count)
            found[some] = np.einsum("mq,mqk->mk", acting[rows[some]], each)
        shares[c] = sparse.csr_array((found.ravel(), indices), shape=(len(hats.place), points.size))
    for seen, by in product(shares, repeat=2):
        if abs(table[seen, by]) > FINE_ROUND_OFF * np.abs(table).max():
            yield shares[seen], between, sparse.csr_array(table[seen, by] * shares[by].T)


def _near(
    pairs: HatPairs,
    shift: float,
    close: IntArray,
    kernels: list[tuple[Distance, FloatArray]],
    along: FloatArray,
) -> sparse.csr_array:
    """Integrals (m, m) for hats in ``close`` pairs of clusters (n, 2, 2); without a shift symmetric, since
    the tensor of the logarithm is, and that of the sign antisymmetric."""
    (first, beyond), (start, end) = close.transpose(1, 2, 0)
    count = (beyond - first) * (end - start)
    number = np.arange(count.sum()) - np.repeat(np.cumsum(count) - count, count)
    row, column = np.divmod(number, np.repeat(end - start, count))
    one, other = np.repeat(first, count) + row, np.repeat(start, count) + column
    kept = (one <= other) | bool(shift)
    one, other = one[kept], other[kept]
    total = np.zeros(len(one))
    for function, table in kernels:
        by = along @ table.T
        for begin in range(0, len(one), BATCH_SIZE):
            some = slice(begin, begin + BATCH_SIZE)
            total[some] += pairs.quadrature(function, shift, one[some], other[some], along, by)
        near = pairs.near(function, shift, one, other)
        total[near.chosen] += pairs.correction(near, along, by)
    if shift:
        return sparse.csr_array((total, (one, other)), shape=(len(pairs.widths),) * 2)
    beside = one < other
    values = np.concatenate([total, total[beside]])
    rows, columns = (np.concatenate([a, b[beside]]) for a, b in ((one, other), (other, one)))
    return sparse.csr_array((values, (rows, columns)), shape=(len(pairs.widths),) * 2)
