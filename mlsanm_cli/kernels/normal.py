"""Normal equations of rows that act on two unknowns a node, as 2 x 2 blocks."""

from __future__ import annotations

from mlsanm_cli.kernels.jit import kernel
from mlsanm_cli.kernels.signature import Float2, FloatOut3, Index1, IndexOut1, Int1, IntOut1


@kernel
def rows_of_nodes(indptr: Index1, nodes: Index1, begin: IndexOut1, row: IndexOut1, entry: IndexOut1) -> None:
    """Which rows act on every node, in order: ``row`` (e,) and the ``entry`` (e,) of the rows that does.

    ``indptr`` (r + 1,) and ``nodes`` (e,) are the rows; those of node i go from ``begin[i]`` to
    ``begin[i + 1]``, (n + 1,), zero at first.
    """
    count = len(begin) - 1
    for place in range(len(nodes)):
        begin[nodes[place] + 1] += 1
    for node in range(count):
        begin[node + 1] += begin[node]
    for r in range(len(indptr) - 1):
        for place in range(indptr[r], indptr[r + 1]):
            at = begin[nodes[place]]
            row[at], entry[at] = r, place
            begin[nodes[place]] = at + 1
    for node in range(count, 0, -1):
        begin[node] = begin[node - 1]
    begin[0] = 0


@kernel
def count_neighbours(
    indptr: Index1,
    nodes: Index1,
    begin: Index1,
    row: Index1,
    mark: IndexOut1,
    end: IntOut1,
) -> None:
    """``end`` (n + 1,), zero at first: where the neighbours of every node begin when all are counted
    through. Nodes that a row acts on together are neighbours, each is its own too; ``mark`` (n,) is -1."""
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
    indptr: Index1,
    nodes: Index1,
    values: Float2,
    begin: Index1,
    row: Index1,
    entry: Index1,
    slot: IntOut1,
    end: Int1,
    neighbour: IndexOut1,
    blocks: FloatOut3,
) -> None:
    """``neighbour`` (m,) and the ``blocks`` (m, 2, 2), zero at first, of the sum of every row's square.

    ``values`` (e, 2) are what the rows multiply both unknowns by, ``end`` is that of
    :func:`count_neighbours`, ``slot`` (n,) is -1.
    """
    for node in range(len(begin) - 1):
        first, last = end[node], end[node]
        for at in range(begin[node], begin[node + 1]):
            own = entry[at]
            x, y = values[own, 0], values[own, 1]
            for place in range(indptr[row[at]], indptr[row[at] + 1]):
                other = nodes[place]
                target = slot[other]
                if target < first:
                    target = last
                    slot[other] = target
                    neighbour[target] = other
                    last += 1
                blocks[target, 0, 0] += x * values[place, 0]
                blocks[target, 0, 1] += x * values[place, 1]
                blocks[target, 1, 0] += y * values[place, 0]
                blocks[target, 1, 1] += y * values[place, 1]
