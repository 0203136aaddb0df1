"""The normal equations of sparse rows, node by node."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sparse

from mlsanm_cli.kernels.normal import add_blocks, count_neighbours, group_rows, rows_of_nodes
from mlsanm_cli.operators.structure import refuse_too_many, structure


def normal_equations(rows: sparse.csr_array) -> sparse.bsr_array:
    """M^T M of ``rows`` M (r, 2n), in blocks of a node's two unknowns (2 x 2), which need no sorting.

    Raises NumericalError where there are too many of them to be counted.
    """
    pairs = _pairs(rows)
    indptr, nodes = structure(pairs)
    count = rows.shape[1] // 2
    group, begin = np.empty(rows.shape[0], dtype=np.int32), np.zeros(rows.shape[0] + 1, dtype=np.int32)
    members = np.empty_like(nodes)
    groups = group_rows(indptr, nodes, np.full(count, -1, dtype=np.int32), group, begin, members)
    begin, members = begin[: groups + 1], members[: begin[groups]]
    start, end = np.zeros(count + 1, dtype=np.int32), np.zeros(count + 1, dtype=np.int64)
    of_node, entry = np.empty((2, len(members)), dtype=np.int32)
    rows_of_nodes(begin, members, start, of_node, entry)
    count_neighbours(begin, members, start, of_node, np.full(count, -1, dtype=np.int32), end)
    refuse_too_many(int(end[-1]))
    neighbour, blocks = np.empty(end[-1], dtype=np.int32), np.zeros((end[-1], 2, 2))
    row = np.argsort(group, kind="stable")
    grouped = (row, np.searchsorted(group[row], np.arange(groups + 1)), begin, members)
    values, slot = pairs.data.reshape(-1, 2), np.full(count, -1, dtype=np.int64)
    add_blocks(indptr, values, *grouped, start, of_node, entry, slot, end, neighbour, blocks)
    return sparse.bsr_array((blocks, neighbour, end.astype(np.int32)), shape=(2 * count, 2 * count))


def _pairs(rows: sparse.csr_array) -> sparse.bsr_array:
    """The rows in blocks of a node's two unknowns (1 x 2), without copies where all entries are in pairs."""
    first, second = rows.indices[::2], rows.indices[1::2]
    if (rows.indptr % 2).any() or (first % 2).any() or not np.array_equal(second, first + 1):
        return sparse.bsr_array(rows, blocksize=(1, 2))
    return sparse.bsr_array((rows.data.reshape(-1, 1, 2), first // 2, rows.indptr // 2), shape=rows.shape)
