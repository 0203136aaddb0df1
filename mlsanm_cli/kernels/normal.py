"""Normal matrix A^T A of rows that act on two unknowns per node, in 2 x 2 blocks. Rows on the same nodes,
such as all rows of one stencil, form a group: the positions of its node pairs are looked up once."""

from __future__ import annotations

import numpy as np

from mlsanm_cli.kernels.aot.jit import kernel
from mlsanm_cli.kernels.aot.signature import Float2, FloatOut3, Index1, IndexOut1, Int1, IntOut1
from mlsanm_cli.kernels.dense import copy_to


@kernel
def group_rows(
    indptr: Index1, nodes: Index1, newest: IndexOut1, group: IndexOut1, begin: IndexOut1, members: IndexOut1
) -> int:
    """Number the groups of rows that act on the same nodes in the same order; returns their number.

    ``indptr`` (r + 1,) and ``nodes`` (e,) are the rows in CSR form, ``newest`` (n,) is -1. Output: ``group``
    (r,), -1 for empty rows; ``begin`` (r + 1,), zero at first, and ``members`` (e,), the nodes of the groups.
    """
    older = np.empty(len(group), dtype=np.int32)
    count = 0
    for r in range(len(group)):
        first, size = indptr[r], indptr[r + 1] - indptr[r]
        if size == 0:
            group[r] = -1
            continue
        # Few groups share their first node: it is the nearest one of the stencil.
        found = newest[nodes[first]]
        while found >= 0:
            same = begin[found + 1] - begin[found] == size
            place = 0
            while same and place < size:
                same = members[begin[found] + place] == nodes[first + place]
                place += 1
            if same:
                break
            found = older[found]
        if found < 0:
            found = count
            older[found] = newest[nodes[first]]
            newest[nodes[first]] = found
            begin[found + 1] = begin[found] + size
            copy_to(members[begin[found] :], nodes[first : first + size])
            count += 1
        group[r] = found
    return count


@kernel
def rows_of_nodes(indptr: Index1, nodes: Index1, begin: IndexOut1, row: IndexOut1, entry: IndexOut1) -> None:
    """Transpose a CSR pattern: for every node the rows ``row`` (e,) that act on it and the position ``entry``
    (e,) within these rows. ``indptr`` (r + 1,) and ``nodes`` (e,) are the rows; ``begin`` (n + 1,), zero at
    first, delimits the nodes."""
    count = len(begin) - 1
    for place in range(len(nodes)):
        begin[nodes[place] + 1] += 1
    for node in range(count):
        begin[node + 1] += begin[node]
    for r in range(len(indptr) - 1):
        for place in range(indptr[r], indptr[r + 1]):
            at = begin[nodes[place]]
            row[at], entry[at] = r, place - indptr[r]
            begin[nodes[place]] = at + 1
    for node in range(count, 0, -1):
        begin[node] = begin[node - 1]
    begin[0] = 0


@kernel
def count_neighbours(
    indptr: Index1, nodes: Index1, begin: Index1, row: Index1, mark: IndexOut1, end: IntOut1
) -> None:
    """Cumulative neighbour counts ``end`` (n + 1,), zero at first: neighbours share a row, and each node is
    its own neighbour. ``mark`` (n,) is -1."""
    for node in range(len(begin) - 1):
        count = 0
        for at in range(begin[node], begin[node + 1]):
            for place in range(indptr[row[at]], indptr[row[at] + 1]):
                other = nodes[place]
                if mark[other] != node:
                    mark[other] = node
                    count += 1
        end[node + 1] = end[node] + count


@kernel
def add_blocks(
    left: Float2,
    right: Float2,
    indptr: Index1,
    row: Int1,
    rows: Int1,
    begin: Index1,
    members: Index1,
    start: Index1,
    group: Index1,
    entry: Index1,
    slot: IntOut1,
    end: Int1,
    neighbour: IndexOut1,
    blocks: FloatOut3,
) -> None:
    """Sum over all rows of their outer products, one of ``left`` times one of ``right``: ``neighbour`` (m,)
    and ``blocks`` (m, 2, 2), zero at first.

    ``left`` and ``right`` (e, 2) are the coefficients of both unknowns. Group g has the rows ``row[rows[g] :
    rows[g + 1]]`` and the nodes ``members[begin[g] : begin[g + 1]]``. ``start``, ``group`` and ``entry`` are
    the transpose by :func:`rows_of_nodes` of the groups, the blocks of node i begin at ``end[i]``, ``slot``
    (n,) is -1.
    """
    for node in range(len(start) - 1):
        first, last = end[node], end[node]
        for at in range(start[node], start[node + 1]):
            g, own = group[at], entry[at]
            nodes = members[begin[g] : begin[g + 1]]
            # Two rows at a time: most groups have one for x and one for y.
            for k in range(rows[g], rows[g + 1], 2):
                at_one = indptr[row[k]]
                one = right[at_one : indptr[row[k] + 1]]
                x, y = left[at_one + own, 0], left[at_one + own, 1]
                two, u, v = one, 0.0, 0.0
                if k + 1 < rows[g + 1]:
                    at_two = indptr[row[k + 1]]
                    two = right[at_two : indptr[row[k + 1] + 1]]
                    u, v = left[at_two + own, 0], left[at_two + own, 1]
                for place in range(len(nodes)):
                    target = slot[nodes[place]]
                    if target < first:
                        target = last
                        slot[nodes[place]], neighbour[target] = target, nodes[place]
                        last += 1
                    block = blocks[target]
                    block[0, 0] += x * one[place, 0] + u * two[place, 0]
                    block[0, 1] += x * one[place, 1] + u * two[place, 1]
                    block[1, 0] += y * one[place, 0] + v * two[place, 0]
                    block[1, 1] += y * one[place, 1] + v * two[place, 1]
