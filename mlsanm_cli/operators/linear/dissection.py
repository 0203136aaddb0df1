"""Geometric nested dissection of a graph whose vertices have positions (George 1973, doi:10.1137/0710032)."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sparse

from mlsanm_cli.arrays import FloatArray, IntArray

LEAF = 48


def nested_dissection(points: FloatArray, graph: sparse.csr_array) -> IntArray:
    """Elimination order (n,) of the vertices: both halves first, the separator between them last.

    ``points`` (n, 2), ``graph`` (n, n) with a symmetric pattern. Parts are cut at the median of their longer
    side; the separator is the right half's vertices that touch the left half.
    """
    order = np.empty(len(points), dtype=np.int64)
    indptr, indices = graph.indptr.astype(np.int64), graph.indices
    left_mark = np.zeros(len(points), dtype=bool)
    stack = [(np.arange(len(points), dtype=np.int64), len(points))]
    while stack:
        part, end = stack.pop()
        if len(part) <= LEAF:
            order[end - len(part) : end] = part
            continue
        axis = int(np.argmax(np.ptp(points[part], axis=0)))
        ranked = part[np.argsort(points[part, axis], kind="stable")]
        left, right = ranked[: len(part) // 2], ranked[len(part) // 2 :]
        left_mark[left] = True
        count = indptr[right + 1] - indptr[right]
        first = np.cumsum(count) - count
        entry = np.repeat(indptr[right] - first, count) + np.arange(count.sum())
        touches = np.logical_or.reduceat(left_mark[indices[entry]], first)
        left_mark[left] = False
        separator, rest = right[touches], right[~touches]
        order[end - len(separator) : end] = separator
        end -= len(separator)
        stack.append((rest, end))
        stack.append((left, end - len(rest)))
    return order
