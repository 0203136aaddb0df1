"""Domains of the elimination tree: small subtrees whose panels do not store rows of their border.

These rows would need many times the memory of the matrix entries between a domain and its border, the links.
The contribution to the border is computed from the links and one more substitution within the domain (George
and Liu 1981, Computer Solution of Large Sparse Positive Definite Systems, chapter 6). A domain is one unit,
and so is every front above the domains; substitution proceeds from unit to unit.
"""

from __future__ import annotations

import numpy as np

from mlsanm_cli.kernels.aot.jit import kernel
from mlsanm_cli.kernels.aot.signature import Float3, FloatOut3, Index1, Int1, IntOut1


@kernel
def domains(start: Int1, parent: Int1, begin: Int1, border: Int1, most: int) -> tuple[Int1, Int1]:
    """Number of leading border nodes for which each front stores rows (f,), and unit offsets (u + 1,) into
    the fronts. Maximal subtrees of up to ``most`` nodes become domains."""
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
    """Offsets ``first`` (n + 1,) of the links of every node, in order of elimination. The links of node i are
    its neighbours from ``end[i]`` (n,) on."""
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
    """Target nodes ``other`` (m,) of the links and their matrix blocks ``between`` (m, 2, 2)."""
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
