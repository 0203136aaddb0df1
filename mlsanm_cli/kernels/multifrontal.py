"""Multifrontal Cholesky factorisation over a given tree of fronts (Duff and Reid, doi:10.1145/356044.356047).

Front f eliminates the nodes ``start[f]`` to ``start[f + 1]``, counted in order of elimination, each with two
unknowns, and changes its border: later nodes, which its ancestors eliminate. A front's descendants come right
before it. Its panel of the factor, (pivots + border, pivots), is column-major, and so is the update of the
border that it hands to its parent ``parent[f]``.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from mlsanm_cli.arrays import FloatArray, IntArray
from mlsanm_cli.kernels.blas import dgemm, dpotrf, dsyrk, dtrsm
from mlsanm_cli.kernels.jit import inner, kernel
from mlsanm_cli.kernels.signature import Float1, Float2, Float3, FloatOut1, Int1

LOWER, RIGHT, PLAIN, TRANSPOSED = 0, 1, 2, 3
"""Places of BLAS' letters among those of :func:`_letters`."""


@inner
def _letters() -> Any:
    """L, R, N, T."""
    return np.array([76, 82, 78, 84], dtype=np.uint8)


@inner
def _solve_right(
    trans: int, rows: int, columns: int, triangle: FloatArray, height: int, x: FloatArray, width: int
) -> None:
    """Solve x L = b or x L^T = b in place, x (rows, columns), L lower; leading dimensions last."""
    c: Any = _letters()
    i: Any = np.array([rows, columns, height, width], dtype=np.int32)
    one: Any = np.ones(1)
    dtrsm(
        *(c[RIGHT:].ctypes, c[LOWER:].ctypes, c[trans:].ctypes, c[PLAIN:].ctypes, i.ctypes, i[1:].ctypes),
        *(one.ctypes, triangle.ctypes, i[2:].ctypes, x.ctypes, i[3:].ctypes),
    )


@inner
def _multiply(
    trans: int,
    sizes: tuple[int, int, int],
    alpha: float,
    a: FloatArray,
    lda: int,
    b: FloatArray,
    ldb: int,
    beta: float,
    product: FloatArray,
    ldc: int,
) -> None:
    """product = alpha a b + beta product, a (m, k), b (k, n) or its transpose; ``sizes`` m, n, k."""
    c: Any = _letters()
    i: Any = np.array([sizes[0], sizes[1], sizes[2], lda, ldb, ldc], dtype=np.int32)
    factor: Any = np.array([alpha, beta])
    dgemm(
        *(c[PLAIN:].ctypes, c[trans:].ctypes, i.ctypes, i[1:].ctypes, i[2:].ctypes, factor.ctypes),
        *(a.ctypes, i[3:].ctypes, b.ctypes, i[4:].ctypes, factor[1:].ctypes, product.ctypes, i[5:].ctypes),
    )


@kernel
def borders(
    start: Int1, parent: Int1, indptr: Int1, indices: Int1, order: Int1, place: Int1
) -> tuple[Int1, Int1, int]:
    """Border nodes of every front, in order of elimination: where they begin (f + 1,) and which they are; and
    the most numbers that updates waiting for their fronts take.

    ``indptr`` and ``indices`` are the graph of the nodes, ``order`` (n,) tells which is eliminated when and
    ``place`` (n,) when each one is.
    """
    fronts = len(parent)
    begin = np.zeros(fronts + 1, dtype=np.int64)
    nodes = np.empty(64 * fronts, dtype=np.int64)
    mark = np.full(len(order), -1, dtype=np.int64)
    child = np.full(fronts, -1, dtype=np.int64)
    sibling = np.full(fronts, -1, dtype=np.int64)
    count, waiting, most = 0, 0, 0
    for f in range(fronts):
        end = start[f + 1]
        for position in range(start[f], end):
            node = order[position]
            for entry in range(indptr[node], indptr[node + 1]):
                mark[place[indices[entry]]] = f
        below, handed = child[f], 0
        while below >= 0:
            for entry in range(begin[below], begin[below + 1]):
                mark[nodes[entry]] = f
            handed += 4 * (begin[below + 1] - begin[below]) ** 2
            below = sibling[below]
        # The ancestors eliminate all that a front touches, so that their nodes need no sorting.
        above = parent[f]
        while above >= 0:
            room = count + start[above + 1] - start[above]
            if room > len(nodes):
                longer = np.empty(2 * room, dtype=np.int64)
                longer[:count] = nodes[:count]
                nodes = longer
            for position in range(start[above], start[above + 1]):
                if mark[position] == f:
                    nodes[count] = position
                    count += 1
            above = parent[above]
        begin[f + 1] = count
        area = 4 * (count - begin[f]) ** 2
        most = max(most, waiting + area)
        waiting += area - handed
        if parent[f] >= 0:
            sibling[f] = child[parent[f]]
            child[parent[f]] = f
    return begin, nodes[:count].copy(), most


@inner
def _locate(f: int, start: IntArray, begin: IntArray, border: IntArray, local: IntArray) -> None:
    """Set ``local`` (n,) to the row of every node of a front in its panel."""
    for position in range(start[f], start[f + 1]):
        local[position] = 2 * (position - start[f])
    for j in range(begin[f], begin[f + 1]):
        local[border[j]] = 2 * (start[f + 1] - start[f] + j - begin[f])


@inner
def _extend_add(
    nodes: IntArray,
    handed: FloatArray,
    local: IntArray,
    pivots: int,
    front: FloatArray,
    update: FloatArray,
    edge: int,
) -> None:
    """Add what a child with border ``nodes`` (b,) has ``handed`` up to its parent's panel and update."""
    width = 2 * len(nodes)
    for j in range(len(nodes)):
        for column in range(2 * j, 2 * j + 2):
            source = handed[width * column : width * (column + 1)]
            to = local[nodes[j]] + column - 2 * j
            if to < pivots:
                target, shift = front[(pivots + edge) * to : (pivots + edge) * (to + 1)], 0
            else:
                target, shift = update[edge * (to - pivots) : edge * (to - pivots + 1)], pivots
            for i in range(j, len(nodes)):
                row = local[nodes[i]] - shift
                target[row] += source[2 * i]
                target[row + 1] += source[2 * i + 1]


@inner
def _eliminate(front: FloatArray, update: FloatArray, pivots: int, edge: int) -> bool:
    """Factorise a panel in place and take its product from ``update``; whether all pivots are positive."""
    c: Any = _letters()
    i: Any = np.array([pivots, pivots + edge, edge, 0], dtype=np.int32)
    factor: Any = np.array([-1.0, 1.0])
    whole: Any = front
    dpotrf(c[LOWER:].ctypes, i.ctypes, whole.ctypes, i[1:].ctypes, i[3:].ctypes)
    if i[3] != 0:
        return False
    if edge > 0:
        below: Any = front[pivots:]
        change: Any = update
        _solve_right(TRANSPOSED, edge, pivots, front, pivots + edge, below, pivots + edge)
        dsyrk(
            *(c[LOWER:].ctypes, c[PLAIN:].ctypes, i[2:].ctypes, i.ctypes, factor.ctypes, below.ctypes),
            *(i[1:].ctypes, factor[1:].ctypes, change.ctypes, i[2:].ctypes),
        )
    return True


@kernel
def factorise(
    start: Int1,
    parent: Int1,
    begin: Int1,
    border: Int1,
    panel: Int1,
    most: int,
    indptr: Int1,
    indices: Int1,
    blocks: Float3,
    order: Int1,
    place: Int1,
) -> tuple[Float1, int]:
    """Panels of the factor one after the other, from ``panel`` (f + 1,) on, and the first front with a pivot
    that is not positive, or -1.

    ``begin``, ``border`` and ``most`` are from :func:`borders`; ``indptr``, ``indices``, ``blocks`` (e, 2, 2)
    the symmetric matrix, node by node.
    """
    values, waiting = np.zeros(panel[-1]), np.empty(most)
    local = np.zeros(len(order), dtype=np.int64)
    owner = np.empty(len(parent), dtype=np.int64)
    top, depth = 0, 0
    for f in range(len(parent)):
        pivots, edge = 2 * (start[f + 1] - start[f]), 2 * (begin[f + 1] - begin[f])
        _locate(f, start, begin, border, local)
        front = values[panel[f] : panel[f + 1]]
        for position in range(start[f], start[f + 1]):
            for entry in range(indptr[order[position]], indptr[order[position] + 1]):
                at = place[indices[entry]]
                if at >= position:
                    for side in range(2):
                        column = (pivots + edge) * (local[position] + side) + local[at]
                        front[column] = blocks[entry, side, 0]
                        front[column + 1] = blocks[entry, side, 1]
        update = waiting[top : top + edge**2]
        update[:] = 0.0
        low = top
        while depth > 0 and parent[owner[depth - 1]] == f:
            depth -= 1
            nodes = border[begin[owner[depth]] : begin[owner[depth] + 1]]
            low -= 4 * len(nodes) ** 2
            _extend_add(nodes, waiting[low:top], local, pivots, front, update, edge)
        if pivots > 0 and not _eliminate(front, update, pivots, edge):
            return values, f
        for i in range(edge**2):
            waiting[low + i] = update[i]
        top = low + edge**2
        owner[depth] = f
        depth += 1
    return values, -1


@kernel
def solve(
    start: Int1,
    begin: Int1,
    border: Int1,
    panel: Int1,
    values: Float1,
    x: FloatOut1,
    c: int,
) -> None:
    """Solve in place for c right-hand sides ``x`` (2n, c), flat, in order of elimination."""
    fronts = len(begin) - 1
    widest = 0
    for f in range(fronts):
        widest = max(widest, begin[f + 1] - begin[f])
    carried = np.empty(2 * widest * c)
    for step in range(2 * fronts):
        forward = step < fronts
        f = step if forward else 2 * fronts - 1 - step
        pivots, edge = 2 * (start[f + 1] - start[f]), 2 * (begin[f + 1] - begin[f])
        if pivots == 0:
            continue
        front, own = values[panel[f] : panel[f + 1]], x[2 * start[f] * c : 2 * start[f + 1] * c]
        if forward:
            _solve_right(TRANSPOSED, c, pivots, front, pivots + edge, own, c)
            if edge > 0:
                sizes = (c, edge, pivots)
                _multiply(TRANSPOSED, sizes, 1.0, own, c, front[pivots:], pivots + edge, 0.0, carried, c)
                for j in range(begin[f], begin[f + 1]):
                    for i in range(2 * c):
                        x[2 * border[j] * c + i] -= carried[2 * (j - begin[f]) * c + i]
        else:
            if edge > 0:
                for j in range(begin[f], begin[f + 1]):
                    for i in range(2 * c):
                        carried[2 * (j - begin[f]) * c + i] = x[2 * border[j] * c + i]
                sizes = (c, pivots, edge)
                _multiply(PLAIN, sizes, -1.0, carried, c, front[pivots:], pivots + edge, 1.0, own, c)
            _solve_right(PLAIN, c, pivots, front, pivots + edge, own, c)


@inner
def _marked(mark: IntArray, f: int, at: IntArray) -> IntArray:
    """The columns marked with f; ``at`` gets the place of each among them."""
    active = np.empty(len(mark), dtype=np.int64)
    c = 0
    for column in range(len(mark)):
        if mark[column] == f:
            active[c] = column
            at[column] = c
            c += 1
    return active[:c].copy()


@inner
def _add_product(x: FloatArray, pivots: int, columns: IntArray, left: int, result: FloatArray) -> None:
    """Add the products of the ``columns`` (c,) of a front's x (pivots, c) to the ``result``."""
    c, split = len(columns), 0
    while split < c and columns[split] < left:
        split += 1
    rest = c - split
    if split > 0 and rest > 0:
        part = np.empty(split * rest)
        _multiply(TRANSPOSED, (rest, split, pivots), 1.0, x[split:], c, x, c, 0.0, part, rest)
        for i in range(split):
            for j in range(rest):
                result[columns[i], columns[split + j] - left] += part[i * rest + j]


@kernel
def products(
    start: Int1,
    parent: Int1,
    begin: Int1,
    border: Int1,
    panel: Int1,
    values: Float1,
    indptr: Int1,
    indices: Int1,
    data: Float1,
    left: int,
    total: int,
) -> Float2:
    """With b sparse columns and L the factor: (L^-1 b_i)^T (L^-1 b_j) for i < ``left`` <= j < ``total``.

    ``indptr``, ``indices``, ``data`` are the columns by rows (2n,), in order of elimination. A front solves
    only for columns that have an entry in it or below.
    """
    result = np.zeros((left, total - left))
    handed, active = [np.empty(0)], [np.empty(0, dtype=np.int64)]
    owner = np.empty(len(parent), dtype=np.int64)
    local = np.zeros(start[-1], dtype=np.int64)
    mark, at = np.full(total, -1, dtype=np.int64), np.zeros(total, dtype=np.int64)
    depth = 0
    for f in range(len(parent)):
        pivots, edge = 2 * (start[f + 1] - start[f]), 2 * (begin[f + 1] - begin[f])
        bottom = depth
        while bottom > 0 and parent[owner[bottom - 1]] == f:
            mark[active[bottom]] = f
            bottom -= 1
        mark[indices[indptr[2 * start[f]] : indptr[2 * start[f + 1]]]] = f
        columns = _marked(mark, f, at)
        c = len(columns)
        x = np.zeros((pivots + edge) * c)
        for row in range(2 * start[f], 2 * start[f + 1]):
            for entry in range(indptr[row], indptr[row + 1]):
                x[(row - 2 * start[f]) * c + at[indices[entry]]] = data[entry]
        _locate(f, start, begin, border, local)
        while depth > bottom:
            child, width = owner[depth - 1], len(active[depth])
            for j in range(2 * (begin[child + 1] - begin[child])):
                to = local[border[begin[child] + j // 2]] + j % 2
                for i in range(width):
                    x[to * c + at[active[depth][i]]] += handed[depth][j * width + i]
            depth -= 1
        if c > 0 and pivots > 0:
            front = values[panel[f] : panel[f + 1]]
            _solve_right(TRANSPOSED, c, pivots, front, pivots + edge, x, c)
            if edge > 0:
                sizes = (c, edge, pivots)
                _multiply(
                    TRANSPOSED, sizes, -1.0, x, c, front[pivots:], pivots + edge, 1.0, x[pivots * c :], c
                )
            _add_product(x, pivots, columns, left, result)
        if depth + 1 == len(handed):
            handed.append(x[:0])
            active.append(columns[:0])
        depth += 1
        handed[depth], active[depth], owner[depth - 1] = x[pivots * c :].copy(), columns, f
    return result
