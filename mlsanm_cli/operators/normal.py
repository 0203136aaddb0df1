"""The normal equations of sparse rows, node by node."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sparse

from mlsanm_cli.arrays import IndexArray
from mlsanm_cli.kernels.normal import add_blocks, count_neighbours, rows_of_nodes


def normal_equations(rows: sparse.csr_array) -> sparse.bsr_array:
    """M^T M of ``rows`` M (r, 2n), in blocks of a node's two unknowns (2 x 2), which need no sorting."""
    pairs = sparse.bsr_array(rows, blocksize=(1, 2))
    indptr, nodes = pairs.indptr.astype(np.int32, copy=False), pairs.indices.astype(np.int32, copy=False)
    count = rows.shape[1] // 2
    begin, end = np.zeros((2, count + 1), dtype=np.int32)
    row, entry = np.empty((2, len(nodes)), dtype=np.int32)
    rows_of_nodes(indptr, nodes, begin, row, entry)
    count_neighbours(indptr, nodes, begin, row, _unmarked(count), end)
    neighbour, blocks = np.empty(end[-1], dtype=np.int32), np.zeros((end[-1], 2, 2))
    values = np.ascontiguousarray(pairs.data).reshape(-1, 2)
    add_blocks(indptr, nodes, values, begin, row, entry, _unmarked(count), end, neighbour, blocks)
    return sparse.bsr_array((blocks, neighbour, end), shape=(2 * count, 2 * count))


def _unmarked(count: int) -> IndexArray:
    return np.full(count, -1, dtype=np.int32)
