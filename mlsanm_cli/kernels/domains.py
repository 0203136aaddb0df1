"""Domains of a tree of fronts: whole subtrees of few nodes, whose panels keep no rows for the border around.

These rows would be many times as much as what the matrix itself has between a domain and its border, the
links. What the domain hands on is found from those and one more substitution within it (George and Liu 1981,
Computer Solution of Large Sparse Positive Definite Systems, chapter 6). The fronts of a domain, and every
front above the domains, are a unit: solutions go from unit to unit.
"""

from __future__ import annotations

import numpy as np

from mlsanm_cli.kernels.jit import kernel
from mlsanm_cli.kernels.signature import Float3, Index1, Int1


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
def links(
    start: Int1,
    begin: Int1,
    kept: Int1,
    unit: Int1,
    indptr: Index1,
    indices: Index1,
    blocks: Float3,
    order: Int1,
    place: Int1,
) -> tuple[Int1, Int1, Float3]:
    """What of the matrix joins the nodes of domains to those around: where each node's links begin (n + 1,),
    in order of elimination, which nodes they go to (m,), and their blocks (m, 2, 2).

    Arguments are those of :func:`mlsanm_cli.kernels.multifrontal.factorise` and :func:`domains`.
    """
    first = np.zeros(len(order) + 1, dtype=np.int64)
    other, between = np.empty(0, dtype=np.int64), np.empty((0, 2, 2))
    for filling in (False, True):
        count = 0
        for u in range(len(unit) - 1):
            root = unit[u + 1] - 1
            bare, end = kept[root] < begin[root + 1] - begin[root], start[unit[u + 1]]
            for position in range(start[unit[u]], end):
                first[position] = count
                for entry in range(indptr[order[position]], indptr[order[position] + 1]):
                    at = place[indices[entry]]
                    if bare and at >= end:
                        if filling:
                            other[count] = at
                            between[count] = blocks[entry]
                        count += 1
        first[len(order)] = count
        if not filling:
            other, between = np.empty(count, dtype=np.int64), np.empty((count, 2, 2))
    return first, other, between
