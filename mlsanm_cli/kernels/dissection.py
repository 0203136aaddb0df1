"""Nested dissection of a graph whose vertices are sorted along several directions."""

from __future__ import annotations

import numpy as np

from mlsanm_cli.arrays import IndexArray, IntArray
from mlsanm_cli.kernels.aot.jit import inner, kernel
from mlsanm_cli.kernels.aot.signature import Index1, IndexOut2, Int1, IntOut1
from mlsanm_cli.kernels.dense import copy_to

STACK_SIZE = 256
"""Stack size: pending parts, halved by every cut."""


@inner
def _touches(vertex: int, indptr: IndexArray, indices: IndexArray, side: IntArray, other: int) -> bool:
    """Whether a neighbour of ``vertex`` is on the ``other`` side."""
    found = False
    for entry in range(indptr[vertex], indptr[vertex + 1]):
        if side[indices[entry]] == other:
            found = True
            break
    return found


@inner
def _separator(
    part: IndexArray,
    cut: int,
    upper: bool,
    indptr: IndexArray,
    indices: IndexArray,
    extents: tuple[IndexArray, IndexArray, IndexArray],
    side: IntArray,
    names: tuple[int, int],
    limit: int,
) -> int:
    """Size of the separator of a ``part`` (in rank order) cut before ``cut``: vertices of its upper or lower
    half that touch the other half; at most ``limit``.

    ``extents`` (n,) are the ranks of vertices, and the lowest and highest of them and their neighbours;
    ``side`` (n,) labels the lower and upper half with ``names``. The loop starts at the cut and skips
    vertices whose neighbours all rank on their own side.
    """
    rank, lowest, highest = extents
    count = 0
    for step in range(len(part) - cut if upper else cut):
        vertex = part[cut + step] if upper else part[cut - 1 - step]
        near = lowest[vertex] < rank[part[cut]] if upper else highest[vertex] > rank[part[cut - 1]]
        if near and _touches(vertex, indptr, indices, side, names[0] if upper else names[1]):
            count += 1
            if count >= limit:
                return limit
    return count


@kernel
def dissect(
    indptr: Index1,
    indices: Index1,
    ranked: IndexOut2,
    leaf: int,
    order: IntOut1,
    begins: IntOut1,
    parents: IntOut1,
) -> int:
    """Split parts of more than ``leaf`` vertices into two halves and a separator; returns the number of
    fronts.

    ``ranked`` (d, n) are the vertices sorted along d directions; it is overwritten. Output, fronts from last
    to first: ``order`` (n,), ``begins`` (2n + 1,) the start of each front in it, ``parents`` (2n + 1,), -1
    for the root. A part is bisected along the direction, and on the side of the cut, with the smallest
    separator.
    """
    directions, count = ranked.shape
    rank = np.empty((directions, count), dtype=np.int32)
    lowest = np.empty((directions, count), dtype=np.int32)
    highest = np.empty((directions, count), dtype=np.int32)
    for direction in range(directions):
        for place in range(count):
            rank[direction, ranked[direction, place]] = place
        # Extreme ranks of every vertex and its neighbours.
        for vertex in range(count):
            low = high = rank[direction, vertex]
            for entry in range(indptr[vertex], indptr[vertex + 1]):
                other = rank[direction, indices[entry]]
                low, high = min(low, other), max(high, other)
            lowest[direction, vertex], highest[direction, vertex] = low, high
    # Label of the last half every vertex was in; its group: kept half, other half, separator.
    side, group = np.full(count, -1, dtype=np.int64), np.zeros(count, dtype=np.int32)
    waiting = np.zeros((STACK_SIZE, 4), dtype=np.int64)
    waiting[0, 1], waiting[0, 2], waiting[0, 3] = count, count, -1
    depth, fronts, cuts = 1, 0, 0
    while depth > 0:
        depth -= 1
        low, high, end, parent = waiting[depth, 0], waiting[depth, 1], waiting[depth, 2], waiting[depth, 3]
        size = high - low
        parents[fronts] = parent
        fronts += 1
        if size <= leaf:
            copy_to(order[end - size :], ranked[0, low:high])
            begins[fronts - 1] = end - size
            continue
        half, smallest, chosen, above = size // 2, size + 1, 0, False
        for direction in range(directions):
            part = ranked[direction, low:high]
            cuts += 1
            names = (2 * cuts, 2 * cuts + 1)
            for place in range(size):
                side[part[place]] = names[0] if place < half else names[1]
            extents = (rank[direction], lowest[direction], highest[direction])
            for upper in (True, False):
                found = _separator(part, half, upper, indptr, indices, extents, side, names, smallest)
                if found < smallest:
                    smallest, chosen, above = found, direction, upper
        cuts += 1
        names = (2 * cuts, 2 * cuts + 1)
        part = ranked[chosen, low:high]
        for place in range(size):
            side[part[place]] = names[0] if (place < half) == above else names[1]
        for place in range(size):
            vertex = part[place]
            group[vertex] = 0
            if side[vertex] == names[1]:
                group[vertex] = 2 if _touches(vertex, indptr, indices, side, names[0]) else 1
        kept = half if above else size - half
        rest = size - kept - smallest
        # Stable sort by groups in every direction.
        for direction in range(directions):
            copy = ranked[direction, low:high].copy()
            at = np.array([low, low + kept, low + kept + rest])
            for vertex in copy:
                ranked[direction, at[group[vertex]]] = vertex
                at[group[vertex]] += 1
        copy_to(order[end - smallest :], ranked[0, high - smallest : high])
        begins[fronts - 1] = end - smallest
        middle, last = low + kept, end - smallest
        for first, final, stop in ((low, middle, last - rest), (middle, middle + rest, last)):
            waiting[depth, 0], waiting[depth, 1] = first, final
            waiting[depth, 2], waiting[depth, 3] = stop, fronts - 1
            depth += 1
    return fronts


@kernel
def places_between(
    indptr: Index1, indices: Index1, first: int, front: Int1, parent: Int1, found: IntOut1
) -> None:
    """Front in which each vertex from ``first`` on can be eliminated: the lowest one of which every
    neighbour's front is an ancestor or descendant.

    Earlier vertices have the fronts ``front`` (n,) in a tree with parents ``parent`` (f,), where descendants
    come right before their ancestor. Later vertices are not adjacent to each other. Output: ``found`` (m,).
    """
    fronts = len(parent)
    lowest = np.arange(fronts)
    for f in range(fronts):
        if parent[f] >= 0:
            lowest[parent[f]] = min(lowest[parent[f]], lowest[f])
    for late in range(len(found)):
        place = fronts - 1
        for entry in range(indptr[first + late], indptr[first + late + 1]):
            if indices[entry] < first:
                place = min(place, front[indices[entry]])
        for entry in range(indptr[first + late], indptr[first + late + 1]):
            if indices[entry] < first:
                other = front[indices[entry]]
                while not (lowest[place] <= other <= place or lowest[other] <= place <= other):
                    place = parent[place]
        found[late] = place
