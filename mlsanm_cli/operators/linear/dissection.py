"""Elimination trees: geometric nested dissection of a graph whose vertices have positions (George 1973,
doi:10.1137/0710032)."""

from __future__ import annotations

from typing import TypeAlias

import numpy as np
import scipy.sparse as sparse

from mlsanm_cli.arrays import FloatArray, IntArray
from mlsanm_cli.kernels.dissection import dissect, places_between
from mlsanm_cli.kernels.multifrontal import borders
from mlsanm_cli.operators.linear.interface import structure

LEAF_SIZE = 16
"""Largest part that is not cut."""
DIRECTIONS = 8


Tree: TypeAlias = tuple[IntArray, IntArray, IntArray]
"""Elimination order (n,) of the vertices, and the tree of fronts: front k of f eliminates vertices
``start[k]`` to ``start[k + 1]`` in this order, which are adjacent to later ones of its ancestors only, with
``parent`` (f,), -1 for the root. Descendants come right before their ancestor."""


def nested_dissection(points: FloatArray, graph: sparse.csr_array | sparse.bsr_array) -> Tree:
    """Nested dissection: both halves of the vertices first, the separator between them last. A part of the
    ``points`` (n, 2) with the symmetric pattern ``graph`` is bisected at its median along the one of
    DIRECTIONS directions with the smallest separator. Raises ValueError for a graph of another number of
    vertices."""
    if graph.shape[0] != graph.shape[1] or len(graph.indptr) != len(points) + 1:
        raise ValueError(f"a graph of {len(graph.indptr) - 1} vertices for {len(points)} points")
    angles = np.pi * np.arange(DIRECTIONS) / DIRECTIONS
    heights = points @ np.stack([np.cos(angles), np.sin(angles)])
    ranked = np.argsort(heights.T, axis=1, kind="stable").astype(np.int32)
    order = np.empty(len(points), dtype=np.int64)
    begins, parents = np.empty((2, 2 * len(points) + 1), dtype=np.int64)
    count = dissect(*structure(graph), ranked, LEAF_SIZE, order, begins, parents)
    # The kernel numbers fronts, and parents, from last to first.
    parent = parents[:count][::-1]
    start = np.append(begins[:count][::-1], len(points))
    return order, start, np.where(parent >= 0, count - 1 - parent, -1)


class Fronts:
    """The nested dissection of ``points`` (n, 2) with adjacency ``graph``, of which the last ``negative``
    vertices, not adjacent to each other, come last in their fronts, in the format of the kernels.

    ``order`` (n,) of the nodes, ``place`` (n,) its inverse, ``unknowns`` (2n,) in this order; ``start`` (f +
    1,) of the fronts, the number ``negative`` (f,) of their last nodes with negative pivots, their ``parent``
    (f,); ``begin`` (f + 1,) offsets of their borders in ``border``; ``waiting``, peak size of updates.
    """

    def __init__(self, points: FloatArray, graph: sparse.bsr_array, negative: int = 0) -> None:
        count = len(points) - negative
        if negative:
            entries = (np.ones(len(graph.indices), dtype=np.int8), graph.indices, graph.indptr)
            pattern = sparse.csr_array(entries, shape=(len(points), len(points)))[:count, :count]
            order, start, parent = nested_dissection(points[:count], pattern)
            # They join the front where their neighbours' fronts meet: in the dissection they would pull all
            # adjacent vertices into separators.
            front, found = np.empty(count, dtype=np.int64), np.empty(negative, dtype=np.int64)
            front[order] = np.repeat(np.arange(len(parent)), np.diff(start))
            places_between(*structure(graph), count, front, parent, found)
            of_front = np.bincount(found, minlength=len(parent)).astype(np.int64)
            own = np.concatenate([front[order], found])
            order = np.concatenate([order, count + np.arange(negative)])[np.argsort(own, kind="stable")]
            start = start + np.concatenate([[0], np.cumsum(of_front)])
        else:
            order, start, parent = nested_dissection(points, graph)
            of_front = np.zeros(len(parent), dtype=np.int64)
        place = np.empty_like(order)
        place[order] = np.arange(len(points))
        begin, border, waiting = borders(start, parent, *structure(graph), order, place)
        self.order, self.place, self.start, self.negative, self.parent = order, place, start, of_front, parent
        self.begin, self.border, self.waiting = begin, border, waiting
        self.unknowns = np.stack([2 * order, 2 * order + 1], axis=1).ravel()
