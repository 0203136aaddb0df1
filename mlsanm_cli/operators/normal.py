"""Normal equations of sparse rows, in 2 x 2 blocks per node."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sparse

from mlsanm_cli.arrays import FloatArray, IndexArray, IntArray
from mlsanm_cli.kernels.normal import add_blocks, count_neighbours, group_rows, rows_of_nodes
from mlsanm_cli.operators.structure import refuse_too_many, structure


def normal_equations(rows: sparse.csr_array) -> sparse.bsr_array:
    """M^T M of ``rows`` M (r, 2n), in 2 x 2 blocks of a node's two unknowns; columns of a row are not sorted.
    Raises NumericalError for more blocks than 32-bit indices can count."""
    begin, neighbour, blocks = _squares(rows, np.zeros(rows.shape[1] // 2, dtype=np.int64), 0)
    return sparse.bsr_array((blocks, neighbour, begin.astype(np.int32)), shape=(rows.shape[1],) * 2)


def bordered(
    rows: sparse.csr_array, strong: sparse.csr_array, owner: IntArray, vertices: int
) -> sparse.bsr_array:
    """The matrix [M^T M, B^T; B, -1] of ``rows`` M (r, 2n) and ``strong`` rows B (g, 2n), in 2 x 2 blocks.
    The multiplier of strong row i belongs to vertex 2 ``owner[i]`` (g,) or the next one, of ``vertices`` in
    all; unused multipliers are zero. Raises NumericalError for more blocks than 32-bit indices can count."""
    order = np.argsort(owner, kind="stable")
    place = np.empty(len(owner), dtype=np.int64)
    place[order] = np.arange(len(owner)) - np.searchsorted(owner[order], owner[order])
    line = 4 * owner + place
    entries = strong.tocoo()
    of_row, column = entries.coords
    turned = sparse.csr_array((entries.data, (line[of_row], column)), shape=(2 * vertices, rows.shape[1]))
    down = sparse.bsr_array(turned, blocksize=(2, 2))
    up = sparse.bsr_array(sparse.csr_array(turned.T), blocksize=(2, 2))
    count, room, below = rows.shape[1] // 2, np.diff(up.indptr), np.diff(down.indptr)
    # Allocated with room for the border: M^T M is by far the largest part and must not be copied.
    begin, neighbour, blocks = _squares(rows, room, int(below.sum()) + vertices)
    indptr = np.concatenate([begin, begin[-1] + np.cumsum(below + 1)])

    def put(part: sparse.bsr_array, first: IntArray, shift: int) -> None:
        """Set the blocks of a ``part`` whose rows start at ``first``."""
        at = np.repeat(first - part.indptr[:-1], np.diff(part.indptr)) + np.arange(part.indptr[-1])
        neighbour[at], blocks[at] = part.indices + shift, part.data

    put(up, begin[1:] - room, count)
    put(down, indptr[count:-1], 0)
    neighbour[indptr[count + 1 :] - 1] = count + np.arange(vertices)
    blocks[indptr[count + 1 :] - 1] = -np.eye(2)
    size = 2 * (count + vertices)
    return sparse.bsr_array((blocks, neighbour, indptr), shape=(size, size))


def _squares(rows: sparse.csr_array, room: IntArray, after: int) -> tuple[IntArray, IndexArray, FloatArray]:
    """Offsets (n + 1,) of the block rows of M^T M, columns and blocks (m, 2, 2), with ``room`` (n,) for
    further blocks in each row, and for ``after`` blocks at the end."""
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
    end[1:] += np.cumsum(room)
    total = int(end[-1]) + after
    refuse_too_many(total)
    neighbour, blocks = np.empty(total, dtype=np.int32), np.zeros((total, 2, 2))
    row = np.argsort(group, kind="stable")
    grouped = (row, np.searchsorted(group[row], np.arange(groups + 1)), begin, members)
    values, slot = pairs.data.reshape(-1, 2), np.full(count, -1, dtype=np.int64)
    add_blocks(indptr, values, *grouped, start, of_node, entry, slot, end, neighbour, blocks)
    return end, neighbour, blocks


def _pairs(rows: sparse.csr_array) -> sparse.bsr_array:
    """The rows in 1 x 2 blocks of a node's two unknowns, without a copy if all entries come in pairs."""
    first, second = rows.indices[::2], rows.indices[1::2]
    if (rows.indptr % 2).any() or (first % 2).any() or not np.array_equal(second, first + 1):
        return sparse.bsr_array(rows, blocksize=(1, 2))
    return sparse.bsr_array((rows.data.reshape(-1, 1, 2), first // 2, rows.indptr // 2), shape=rows.shape)
