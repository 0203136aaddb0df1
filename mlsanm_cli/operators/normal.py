"""Normal equations of sparse rows, in 2 x 2 blocks per node."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sparse

from mlsanm_cli.arrays import IntArray
from mlsanm_cli.kernels.normal import add_blocks, count_neighbours, group_rows, rows_of_nodes
from mlsanm_cli.operators.factors import refuse_too_many, structure


class NormalPattern:
    """Pattern of matrices [M^T N, B^T; C, -1] in 2 x 2 blocks, for rows M and N (r, 2n) with the same
    pattern, and strong rows B and C (g, 2n) with another one. The multiplier of strong row i belongs to
    vertex 2 ``owner[i]`` (g,) or the next one; unused ones are zero. Raises NumericalError for too many
    blocks."""

    def __init__(
        self, rows: sparse.csr_array, strong: sparse.csr_array, owner: IntArray, vertices: int
    ) -> None:
        count = rows.shape[1] // 2
        own_indptr, nodes = structure(_pairs(rows))
        group, begin = np.empty(rows.shape[0], dtype=np.int32), np.zeros(rows.shape[0] + 1, dtype=np.int32)
        members = np.empty_like(nodes)
        number = group_rows(own_indptr, nodes, np.full(count, -1, dtype=np.int32), group, begin, members)
        begin, members = begin[: number + 1], members[: begin[number]].copy()
        start, end = np.zeros(count + 1, dtype=np.int32), np.zeros(count + 1, dtype=np.int64)
        of_node, entry = np.empty((2, len(members)), dtype=np.int32)
        rows_of_nodes(begin, members, start, of_node, entry)
        count_neighbours(begin, members, start, of_node, np.full(count, -1, dtype=np.int32), end)
        in_groups = np.argsort(group, kind="stable")
        first_row = np.searchsorted(group[in_groups], np.arange(number + 1))
        # Arguments of the kernel that adds up the blocks.
        self.groups = (own_indptr, in_groups, first_row, begin, members, start, of_node, entry)
        order = np.argsort(owner, kind="stable")
        place = np.empty(len(owner), dtype=np.int64)
        place[order] = np.arange(len(owner)) - np.searchsorted(owner[order], owner[order])
        line = np.repeat(4 * owner + place, np.diff(strong.indptr))
        column = strong.indices.astype(np.int64)
        pairs, block = np.unique(line // 2 * count + column // 2, return_inverse=True)
        vertex, node = np.divmod(pairs, count)
        room, below = np.bincount(node, minlength=count), np.bincount(vertex, minlength=vertices)
        # Offsets of the block rows, of which the first begin with the blocks of M^T N, and the columns of all
        # other blocks.
        indptr = np.concatenate([[0], np.cumsum(np.concatenate([np.diff(end) + room, below + 1]))])
        refuse_too_many(int(indptr[-1]))
        border = np.zeros(indptr[-1], dtype=np.int32)
        down = indptr[count + vertex] + np.arange(len(vertex)) - np.searchsorted(vertex, vertex)
        border[down] = node
        border[indptr[count + 1 :] - 1] = count + np.arange(vertices)
        by_node = np.argsort(node, kind="stable")
        up = np.empty_like(node)
        first = indptr[node[by_node] + 1] - room[node[by_node]]
        up[by_node] = first + np.arange(len(node)) - np.searchsorted(node[by_node], node[by_node])
        border[up] = count + vertex
        row, own = line % 2, column % 2
        self.indptr, self.border = indptr, border
        # Places of the coefficients of strong rows among those of the blocks.
        self.up, self.down = 4 * up[block] + 2 * own + row, 4 * down[block] + 2 * row + own

    def matrix(
        self,
        left: sparse.csr_array,
        left_strong: sparse.csr_array,
        right: sparse.csr_array,
        right_strong: sparse.csr_array,
    ) -> sparse.bsr_array:
        """The matrix of rows M = ``left`` and N = ``right``, B = ``left_strong`` and C = ``right_strong``."""
        neighbour, blocks = self.border.copy(), np.zeros((self.indptr[-1], 2, 2))
        own, other = (_pairs(one).data.reshape(-1, 2) for one in (left, right))
        count, size = left.shape[1] // 2, 2 * (len(self.indptr) - 1)
        slot = np.full(count, -1, dtype=np.int64)
        add_blocks(own, other, *self.groups, slot, self.indptr, neighbour, blocks)
        flat = blocks.reshape(-1)
        flat[self.up], flat[self.down] = left_strong.data, right_strong.data
        blocks[self.indptr[count + 1 :] - 1] = -np.eye(2)
        return sparse.bsr_array((blocks, neighbour, self.indptr.astype(np.int32)), shape=(size, size))


def _pairs(rows: sparse.csr_array) -> sparse.bsr_array:
    """The rows in 1 x 2 blocks of a node's two unknowns, without a copy if all entries come in pairs."""
    first, second = rows.indices[::2], rows.indices[1::2]
    if (rows.indptr % 2).any() or (first % 2).any() or not np.array_equal(second, first + 1):
        return sparse.bsr_array(rows, blocksize=(1, 2))
    return sparse.bsr_array((rows.data.reshape(-1, 1, 2), first // 2, rows.indptr // 2), shape=rows.shape)
