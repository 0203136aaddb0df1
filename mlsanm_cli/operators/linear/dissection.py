"""Geometric nested dissection of a graph whose vertices have positions (George 1973, doi:10.1137/0710032)."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sparse

from mlsanm_cli.arrays import BoolArray, FloatArray, IntArray
from mlsanm_cli.values import dataclass

LEAF = 32
DIRECTIONS = 4


@dataclass(frozen=True)
class Dissection:
    """Elimination ``order`` (n,) of the vertices, and the tree of fronts they are eliminated in.

    Front k of f eliminates those from ``start[k]`` to ``start[k + 1]``, and touches of the later ones no
    others than those of its ancestors: ``parent`` (f,) and on, -1 after the last. Descendants come right
    before their ancestor.
    """

    order: IntArray
    start: IntArray
    parent: IntArray


def nested_dissection(points: FloatArray, graph: sparse.csr_array) -> Dissection:
    """Both halves of the vertices first, the separator between them last.

    ``points`` (n, 2), ``graph`` (n, n) with a symmetric pattern. A part is cut at its median along the one of
    DIRECTIONS directions that leaves the smallest separator: the vertices of one half that touch the other.
    Graded clouds are far from boxes; one direction by their extent left up to half as much fill again.
    """
    angles = np.pi * np.arange(DIRECTIONS) / DIRECTIONS
    heights = points @ np.stack([np.cos(angles), np.sin(angles)])
    indptr, indices = graph.indptr.astype(np.int64), graph.indices.astype(np.int64)
    mark = np.zeros(len(points), dtype=bool)
    order = np.empty(len(points), dtype=np.int64)
    # Fronts from the last to the first: where they begin, and what their parent is, counted the same way.
    begins, parents = [], []
    stack = [(np.arange(len(points), dtype=np.int64), len(points), -1)]
    while stack:
        part, end, parent = stack.pop()
        parents.append(parent)
        if len(part) <= LEAF:
            order[end - len(part) : end] = part
            begins.append(end - len(part))
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
        begins.append(end - smallest)
        stack.append((kept, end - smallest - len(rest), len(parents) - 1))
        stack.append((rest, end - smallest, len(parents) - 1))
    last = len(parents) - 1
    return Dissection(
        order,
        np.array([*reversed(begins), len(points)], dtype=np.int64),
        np.array([last - parent if parent >= 0 else -1 for parent in reversed(parents)], dtype=np.int64),
    )


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
