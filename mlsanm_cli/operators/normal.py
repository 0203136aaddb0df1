"""The normal equations of sparse rows, node by node."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sparse

from mlsanm_cli.kernels.normal import add_blocks, count_neighbours, rows_of_nodes
from mlsanm_cli.operators.structure import refuse_too_many, structure


def normal_equations(rows: sparse.csr_array) -> sparse.bsr_array:
    """M^T M of ``rows`` M (r, 2n), in blocks of a node's two unknowns (2 x 2), which need no sorting.

    Raises NumericalError where there are too many of them to be counted.
    """
    pairs = sparse.bsr_array(rows, blocksize=(1, 2))
    indptr, nodes = structure(pairs)
    count = rows.shape[1] // 2
    begin, end = np.zeros(count + 1, dtype=np.int32), np.zeros(count + 1, dtype=np.int64)
    row, entry = np.empty((2, len(nodes)), dtype=np.int32)
    rows_of_nodes(indptr, nodes, begin, row, entry)
    count_neighbours(indptr, nodes, begin, row, np.full(count, -1, dtype=np.int32), end)
    refuse_too_many(int(end[-1]))
    neighbour, blocks = np.empty(end[-1], dtype=np.int32), np.zeros((end[-1], 2, 2))
    values = np.ascontiguousarray(pairs.data).reshape(-1, 2)
    slot = np.full(count, -1, dtype=np.int64)
    add_blocks(indptr, nodes, values, begin, row, entry, slot, end, neighbour, blocks)
    return sparse.bsr_array((blocks, neighbour, end.astype(np.int32)), shape=(2 * count, 2 * count))
