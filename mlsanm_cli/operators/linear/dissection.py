"""Geometric nested dissection of a graph whose vertices have positions (George 1973, doi:10.1137/0710032)."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sparse

from mlsanm_cli.arrays import BoolArray, FloatArray, IntArray

LEAF = 32
DIRECTIONS = 4


def nested_dissection(points: FloatArray, graph: sparse.csr_array) -> IntArray:
    """Elimination order (n,) of the vertices: both halves first, the separator between them last.

    ``points`` (n, 2), ``graph`` (n, n) with a symmetric pattern. A part is cut at its median along the one of
    DIRECTIONS directions that leaves the smallest separator: the vertices of one half that touch the other.
    Graded clouds are far from boxes; one direction by their extent left up to half as much fill again.
    """
    angles = np.pi * np.arange(DIRECTIONS) / DIRECTIONS
    heights = points @ np.stack([np.cos(angles), np.sin(angles)])
    indptr, indices = graph.indptr.astype(np.int64), graph.indices.astype(np.int64)
    mark = np.zeros(len(points), dtype=bool)
    order = np.empty(len(points), dtype=np.int64)
    stack = [(np.arange(len(points), dtype=np.int64), len(points))]
    while stack:
        part, end = stack.pop()
        if len(part) <= LEAF:
            order[end - len(part) : end] = part
            continue
        smallest = len(part) + 1
        for height in heights.T:
            ranked = part[np.argsort(height[part], kind="stable")]
            low, high = ranked[: len(part) // 2], ranked[len(part) // 2 :]
            for half, other in ((low, high), (high, low)):
                touches = _touching(indptr, indices, half, other, mark)
                if touches.sum() < smallest:
                    smallest = int(touches.sum())
                    kept, separator, rest = half, other[touches], other[~touches]
        order[end - smallest : end] = separator
        stack.append((rest, end - smallest))
        stack.append((kept, end - smallest - len(rest)))
    return order


def _touching(
    indptr: IntArray, indices: IntArray, half: IntArray, other: IntArray, mark: BoolArray
) -> BoolArray:
    """Which vertices of ``other`` have a neighbour in ``half``; ``mark`` (n,) is false and stays so."""
    mark[half] = True
    count = indptr[other + 1] - indptr[other]
    first = np.cumsum(count) - count
    entry = np.repeat(indptr[other] - first, count) + np.arange(count.sum())
    # A vertex without neighbours has no entries, which reduceat does not know.
    found = np.append(mark[indices[entry]], False)
    touches = np.logical_or.reduceat(found, first) & (count > 0)
    mark[half] = False
    return np.asarray(touches, dtype=bool)
