"""Domains of a tree of fronts: whole subtrees of few nodes, whose panels keep no rows for the border around.

These rows would be many times as much as what the matrix itself has between a domain and its border, the
links. What the domain hands on is found from those and one more substitution within it (George and Liu 1981,
Computer Solution of Large Sparse Positive Definite Systems, chapter 6). The fronts of a domain, and every
front above the domains, are a unit: solutions go from unit to unit.
"""

from __future__ import annotations

import numpy as np

from mlsanm_cli.kernels.aot.jit import kernel
from mlsanm_cli.kernels.aot.signature import Float3, FloatOut3, Index1, Int1, IntOut1


@kernel
def domains(start: Int1, parent: Int1, begin: Int1, border: Int1, most: int) -> tuple[Int1, Int1]:
    """How many nodes of its border, the first ones, every front keeps rows for, (f,), and where units begin
    among the fronts, (u + 1,).

    Subtrees of up to ``most`` nodes are domains, unless a larger one has them.
    """
    fronts = len(parent)
    first, root = np.arange(fronts), np.full(fronts, -1, dtype=np.int64)
    kept, unit = np.empty(fronts, dtype=np.int64), np.zeros(fronts + 1, dtype=np.int64)
    for f in range(fronts):
        if parent[f] >= 0:
            first[parent[f]] = min(first[parent[f]], first[f])
    for f in range(fronts - 1, -1, -1):
        if parent[f] >= 0 and root[parent[f]] >= 0:
            root[f] = root[parent[f]]
        elif start[f + 1] - start[first[f]] <= most:
            root[f] = f
    units = 0
    for f in range(fronts):
        kept[f] = begin[f + 1] - begin[f]
        if root[f] >= 0:
            end, kept[f] = start[root[f] + 1], 0
            while begin[f] + kept[f] < begin[f + 1] and border[begin[f] + kept[f]] < end:
                kept[f] += 1
        if root[f] < 0 or root[f] == f:
            units += 1
            unit[units] = f + 1
    return kept, unit[: units + 1].copy()


@kernel
def count_links(indptr: Index1, indices: Index1, order: Int1, place: Int1, end: Int1, first: IntOut1) -> None:
    """``first`` (n + 1,): where the links of every node, in order of elimination, begin when all are counted
    through. Those of node i are the nodes from ``end[i]`` (n,) on that the matrix joins it with."""
    count = 0
    for position in range(len(order)):
        first[position] = count
        for entry in range(indptr[order[position]], indptr[order[position] + 1]):
            if place[indices[entry]] >= end[position]:
                count += 1
    first[len(order)] = count


@kernel
def fill_links(
    indptr: Index1,
    indices: Index1,
    blocks: Float3,
    order: Int1,
    place: Int1,
    end: Int1,
    other: IntOut1,
    between: FloatOut3,
) -> None:
    """Which nodes the links go to, ``other`` (m,), and their blocks ``between`` (m, 2, 2)."""
    count = 0
    for position in range(len(order)):
        for entry in range(indptr[order[position]], indptr[order[position] + 1]):
            at = place[indices[entry]]
            if at >= end[position]:
                other[count] = at
                for side in range(2):
                    between[count, side, 0] = blocks[entry, side, 0]
                    between[count, side, 1] = blocks[entry, side, 1]
                count += 1
