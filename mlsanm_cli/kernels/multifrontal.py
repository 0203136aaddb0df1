"""Multifrontal Cholesky factorisation over a given tree of fronts (Duff and Reid 1983, doi:10.1145/356044.356047).

A front eliminates the unknowns ``2 start[f]`` to ``2 start[f + 1]``, two to a node, and reaches up to its
border, nodes that its ancestors eliminate. Fronts are numbered so that all of a front's descendants are right
before it. Its panel of the factor (pivots and border, by pivots) is column-major.
"""

from __future__ import annotations

import numpy as np

from mlsanm_cli.arrays import FloatArray, IntArray
from mlsanm_cli.kernels.blas import dgemm, dpotrf, dsyrk, dtrsm
from mlsanm_cli.kernels.jit import kernel


@kernel
def characters() -> object:
    return np.array([76, 82, 78, 84], dtype=np.uint8)


@kernel
def _trsm(side: int, trans: int, m: int, n: int, a: FloatArray, lda: int, b: FloatArray, ldb: int) -> None:
    """Solve with the lower triangle a, from the left (0) or right (1), as it is (2) or transposed (3)."""
    c = characters()
    i = np.array([m, n, lda, ldb], dtype=np.int32)
    one = np.ones(1)
    dtrsm(
        c[side:].ctypes, c[0:].ctypes, c[trans:].ctypes, c[2:].ctypes,
        i[0:].ctypes, i[1:].ctypes, one.ctypes, a.ctypes, i[2:].ctypes, b.ctypes, i[3:].ctypes,
    )


@kernel
def _gemm(
    trans_a: int, trans_b: int, m: int, n: int, k: int, alpha: float,
    a: FloatArray, lda: int, b: FloatArray, ldb: int, beta: float, c: FloatArray, ldc: int,
) -> None:
    """c = alpha a b + beta c, a (m, k) and b (k, n) as they are (2) or transposed (3)."""
    t = characters()
    i = np.array([m, n, k, lda, ldb, ldc], dtype=np.int32)
    factor = np.array([alpha, beta])
    dgemm(
        t[trans_a:].ctypes, t[trans_b:].ctypes, i[0:].ctypes, i[1:].ctypes, i[2:].ctypes,
        factor[0:].ctypes, a.ctypes, i[3:].ctypes, b.ctypes, i[4:].ctypes,
        factor[1:].ctypes, c.ctypes, i[5:].ctypes,
    )


@kernel
def borders(start: IntArray, parent: IntArray, indptr: IntArray, indices: IntArray, order: IntArray, place: IntArray):
    """Border nodes of every front, in order of elimination: where they begin (f + 1,) and which they are; and the
    most numbers that updates waiting for their fronts take.

    ``indptr`` and ``indices`` are the graph of the nodes, ``order`` (n,) tells which is eliminated when and
    ``place`` (n,) when each one is.
    """
    fronts = len(parent)
    begin = np.zeros(fronts + 1, dtype=np.int64)
    nodes = np.empty(max(64 * fronts, 1), dtype=np.int64)
    mark = np.full(len(order), -1, dtype=np.int64)
    last_child = np.full(fronts, -1, dtype=np.int64)
    sibling = np.full(fronts, -1, dtype=np.int64)
    count, top, most = 0, 0, 0
    for f in range(fronts):
        end = start[f + 1]
        for position in range(start[f], end):
            node = order[position]
            for entry in range(indptr[node], indptr[node + 1]):
                other = place[indices[entry]]
                if other >= end:
                    mark[other] = f
        child = last_child[f]
        while child >= 0:
            for entry in range(begin[child], begin[child + 1]):
                if nodes[entry] >= end:
                    mark[nodes[entry]] = f
            child = sibling[child]
        above = parent[f]
        while above >= 0:
            room = start[above + 1] - start[above]
            if count + room > len(nodes):
                longer = np.empty(2 * (count + room), dtype=np.int64)
                longer[:count] = nodes[:count]
                nodes = longer
            for position in range(start[above], start[above + 1]):
                if mark[position] == f:
                    nodes[count] = position
                    count += 1
            above = parent[above]
        begin[f + 1] = count
        area = 4 * (count - begin[f]) ** 2
        most = max(most, top + area)
        child = last_child[f]
        while child >= 0:
            top -= 4 * (begin[child + 1] - begin[child]) ** 2
            child = sibling[child]
        top += area
        if parent[f] >= 0:
            sibling[f] = last_child[parent[f]]
            last_child[parent[f]] = f
    return begin, nodes[:count].copy(), most


@kernel
def factorise(
    start: IntArray, parent: IntArray, begin: IntArray, border: IntArray, panel: IntArray, stack: int,
    indptr: IntArray, indices: IntArray, data: FloatArray, order: IntArray, place: IntArray,
):
    """Panels of the Cholesky factor, one after the other from ``panel`` (f + 1,), and the first front with a pivot
    that is not positive, or -1.

    ``indptr``, ``indices``, ``data`` (e, 2, 2) are the matrix in blocks, node by node; ``stack`` is the most that the updates
    which wait for their fronts can take.
    """
    fronts = len(parent)
    values = np.zeros(panel[fronts])
    waiting = np.empty(stack)
    top = 0
    owner = np.empty(fronts, dtype=np.int64)
    depth = 0
    local = np.zeros(len(order), dtype=np.int64)
    c = characters()
    one = np.array([-1.0, 1.0])
    info = np.zeros(1, dtype=np.int32)
    for f in range(fronts):
        first, pivots = start[f], 2 * (start[f + 1] - start[f])
        edge = 2 * (begin[f + 1] - begin[f])
        size = pivots + edge
        for position in range(start[f], start[f + 1]):
            local[position] = 2 * (position - first)
        for j in range(begin[f + 1] - begin[f]):
            local[border[begin[f] + j]] = pivots + 2 * j
        front = values[panel[f] : panel[f + 1]]
        for position in range(start[f], start[f + 1]):
            base = size * 2 * (position - first)
            for entry in range(indptr[order[position]], indptr[order[position] + 1]):
                at = place[indices[entry]]
                if at >= position:
                    for side in range(2):
                        for other in range(2):
                            front[base + side * size + local[at] + other] = data[entry, side, other]
        update = waiting[top : top + edge * edge]
        update[:] = 0.0
        low = top
        while depth > 0 and parent[owner[depth - 1]] == f:
            depth -= 1
            child = owner[depth]
            count = begin[child + 1] - begin[child]
            width = 2 * count
            low -= width * width
            for j in range(count):
                to = local[border[begin[child] + j]]
                for side in range(2):
                    source = waiting[low + width * (2 * j + side) : low + width * (2 * j + side + 1)]
                    if to < pivots:
                        target = front[size * (to + side) : size * (to + side + 1)]
                        shift = 0
                    else:
                        target = update[edge * (to + side - pivots) : edge * (to + side - pivots + 1)]
                        shift = pivots
                    for i in range(j, count):
                        row = local[border[begin[child] + i]] - shift
                        target[row] += source[2 * i]
                        target[row + 1] += source[2 * i + 1]
        if pivots > 0:
            i32 = np.array([pivots, size, edge], dtype=np.int32)
            dpotrf(c[0:].ctypes, i32[0:].ctypes, front.ctypes, i32[1:].ctypes, info.ctypes)
            if info[0] != 0:
                return values, f
            if edge > 0:
                _trsm(1, 3, edge, pivots, front, size, front[pivots:], size)
                dsyrk(
                    c[0:].ctypes, c[2:].ctypes, i32[2:].ctypes, i32[0:].ctypes, one[0:].ctypes,
                    front[pivots:].ctypes, i32[1:].ctypes, one[1:].ctypes, update.ctypes, i32[2:].ctypes,
                )
        for i in range(edge * edge):
            waiting[low + i] = update[i]
        top = low + edge * edge
        owner[depth] = f
        depth += 1
    return values, -1


@kernel
def solve_forward(
    start: IntArray, begin: IntArray, border: IntArray, panel: IntArray, values: FloatArray, x: FloatArray, c: int
) -> None:
    """Solve with the factor, in place; ``x`` holds c right-hand sides (2n, c) in order of elimination, flat."""
    widest = 0
    for f in range(len(begin) - 1):
        widest = max(widest, begin[f + 1] - begin[f])
    carried = np.empty(2 * widest * c)
    for f in range(len(begin) - 1):
        pivots = 2 * (start[f + 1] - start[f])
        count = begin[f + 1] - begin[f]
        size = pivots + 2 * count
        if pivots == 0:
            continue
        front = values[panel[f] : panel[f + 1]]
        own = x[2 * start[f] * c : 2 * start[f + 1] * c]
        _trsm(1, 3, c, pivots, front, size, own, c)
        if count > 0:
            _gemm(2, 3, c, 2 * count, pivots, 1.0, own, c, front[pivots:], size, 0.0, carried, c)
            for j in range(count):
                at = 2 * border[begin[f] + j] * c
                for i in range(2 * c):
                    x[at + i] -= carried[2 * j * c + i]


@kernel
def solve_backward(
    start: IntArray, begin: IntArray, border: IntArray, panel: IntArray, values: FloatArray, x: FloatArray, c: int
) -> None:
    """Solve with the transposed factor, in place; ``x`` as for the other half."""
    widest = 0
    for f in range(len(begin) - 1):
        widest = max(widest, begin[f + 1] - begin[f])
    carried = np.empty(2 * widest * c)
    for back in range(1, len(begin)):
        f = len(begin) - 1 - back
        pivots = 2 * (start[f + 1] - start[f])
        count = begin[f + 1] - begin[f]
        size = pivots + 2 * count
        if pivots == 0:
            continue
        front = values[panel[f] : panel[f + 1]]
        own = x[2 * start[f] * c : 2 * start[f + 1] * c]
        if count > 0:
            for j in range(count):
                at = 2 * border[begin[f] + j] * c
                for i in range(2 * c):
                    carried[2 * j * c + i] = x[at + i]
            _gemm(2, 2, c, pivots, 2 * count, -1.0, carried, c, front[pivots:], size, 1.0, own, c)
        _trsm(1, 2, c, pivots, front, size, own, c)


@kernel
def products(
    start: IntArray, parent: IntArray, begin: IntArray, border: IntArray, panel: IntArray, values: FloatArray,
    indptr: IntArray, indices: IntArray, data: FloatArray, left: int, total: int,
) -> FloatArray:
    """Products (left, total - left) of the forward solutions of the first ``left`` sparse columns with the others.

    ``indptr``, ``indices``, ``data`` are the columns by rows (2n,), in order of elimination. A front solves for the
    columns that have an entry in it or below it only.
    """
    fronts = len(parent)
    result = np.zeros((left, total - left))
    kept = [np.empty(0)]
    lists = [np.empty(0, dtype=np.int64)]
    owner = np.empty(fronts, dtype=np.int64)
    depth = 0
    local = np.zeros(start[fronts], dtype=np.int64)
    mark = np.full(total, -1, dtype=np.int64)
    at = np.zeros(total, dtype=np.int64)
    for f in range(fronts):
        first, pivots = start[f], 2 * (start[f + 1] - start[f])
        count = begin[f + 1] - begin[f]
        size = pivots + 2 * count
        bottom = depth
        while bottom > 0 and parent[owner[bottom - 1]] == f:
            bottom -= 1
            for column in lists[bottom + 1]:
                mark[column] = f
        for entry in range(indptr[2 * first], indptr[2 * start[f + 1]]):
            mark[indices[entry]] = f
        c = 0
        active = np.empty(total, dtype=np.int64)
        for column in range(total):
            if mark[column] == f:
                active[c] = column
                at[column] = c
                c += 1
        active = active[:c].copy()
        x = np.zeros(size * c)
        for row in range(2 * first, 2 * start[f + 1]):
            for entry in range(indptr[row], indptr[row + 1]):
                x[(row - 2 * first) * c + at[indices[entry]]] += data[entry]
        for position in range(start[f], start[f + 1]):
            local[position] = 2 * (position - first)
        for j in range(count):
            local[border[begin[f] + j]] = pivots + 2 * j
        while depth > bottom:
            child = owner[depth - 1]
            columns = lists[depth]
            update = kept[depth]
            width = len(columns)
            for j in range(begin[child + 1] - begin[child]):
                to = local[border[begin[child] + j]]
                for side in range(2):
                    for i in range(width):
                        x[(to + side) * c + at[columns[i]]] += update[(2 * j + side) * width + i]
            depth -= 1
        split = 0
        while split < c and active[split] < left:
            split += 1
        if c > 0 and pivots > 0:
            front = values[panel[f] : panel[f + 1]]
            _trsm(1, 3, c, pivots, front, size, x, c)
            if count > 0:
                _gemm(2, 3, c, 2 * count, pivots, -1.0, x, c, front[pivots:], size, 1.0, x[pivots * c :], c)
            if 0 < split < c:
                # Column-major (right, left), which is (left, right) by rows.
                part = np.empty(split * (c - split))
                _gemm(2, 3, c - split, split, pivots, 1.0, x[split:], c, x, c, 0.0, part, c - split)
                for i in range(split):
                    for j in range(c - split):
                        result[active[i], active[split + j] - left] += part[i * (c - split) + j]
        if depth + 1 == len(kept):
            kept.append(x[pivots * c :].copy())
            lists.append(active)
        else:
            kept[depth + 1] = x[pivots * c :].copy()
            lists[depth + 1] = active
        owner[depth] = f
        depth += 1
    return result
