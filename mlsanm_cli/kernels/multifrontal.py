"""Multifrontal factorisation over a given tree of fronts (Duff and Reid, doi:10.1145/356044.356047).

A symmetric matrix is quasi-definite: positive definite in most unknowns, negative definite in the others. It
then is L D L^T with D the signs of the unknowns, in any order and without pivoting (Vanderbei 1995,
doi:10.1137/0805005). A front's negative unknowns come last among its pivots. A general matrix with a
symmetric pattern is L U, with partial pivoting among the pivots of a front (Duff and Reid 1984,
doi:10.1137/0905045).

Front f eliminates the nodes ``start[f]`` to ``start[f + 1]``, in order of elimination, each with two
unknowns, and updates its border: later nodes, eliminated by its ancestors. A front's descendants come right
before it. Its panel of the factor (height, pivots), with height the pivots and the border, is column-major,
assembled and factorised in place. Of a symmetric matrix it is valid on and below the diagonal; of a general
one the rows (pivots, border) of U follow. The update passed to the parent ``parent[f]`` is stored by columns,
of a symmetric matrix from the diagonal down.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from mlsanm_cli.arrays import FloatArray, IntArray
from mlsanm_cli.kernels.aot.jit import inner, kernel
from mlsanm_cli.kernels.aot.signature import Float3, FloatOut1, Index1, IndexOut1, Int1
from mlsanm_cli.kernels.blas import dgetrf, dpotrf, dsyrk
from mlsanm_cli.kernels.dense import (
    LEFT,
    LOWER,
    PLAIN,
    RIGHT,
    TRANSPOSED,
    UNIT,
    UPPER,
    copy_to,
    letters,
    multiply,
    solve_triangle,
)

STRIP_COLUMNS = 64
"""Columns eliminated at once."""


@inner
def _triangle(rows: int) -> int:
    """Number of entries on and below the diagonal."""
    return rows * (rows + 1) // 2


@kernel
def borders(
    start: Int1, parent: Int1, indptr: Index1, indices: Index1, order: Int1, place: Int1
) -> tuple[Int1, Int1, int]:
    """Symbolic factorisation: border nodes of every front in order of elimination, as offsets (f + 1,) and
    nodes, and the peak size of pending updates. ``indptr`` and ``indices`` are the node graph, ``order`` (n,)
    the elimination order, ``place`` (n,) its inverse."""
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
            handed += _triangle(2 * (begin[below + 1] - begin[below]))
            below = sibling[below]
        # All nodes a front touches belong to its ancestors, taken in order: no sorting is needed.
        above = parent[f]
        while above >= 0:
            room = count + start[above + 1] - start[above]
            if room > len(nodes):
                longer = np.empty(2 * room, dtype=np.int64)
                copy_to(longer, nodes[:count])
                nodes = longer
            for position in range(start[above], start[above + 1]):
                if mark[position] == f:
                    nodes[count] = position
                    count += 1
            above = parent[above]
        begin[f + 1] = count
        waiting += _triangle(2 * (count - begin[f])) - handed
        most = max(most, waiting)
        if parent[f] >= 0:
            sibling[f] = child[parent[f]]
            child[parent[f]] = f
    return begin, nodes[:count].copy(), most


@inner
def locate(own: tuple[int, int], border: IntArray, local: IntArray) -> None:
    """Set ``local`` (n,) to the front-local rows of its ``own`` nodes and its ``border``."""
    for position in range(own[0], own[1]):
        local[position] = 2 * (position - own[0])
    for j in range(len(border)):
        local[border[j]] = 2 * (own[1] - own[0] + j)


@inner
def _extend_add(
    nodes: IntArray,
    handed: FloatArray,
    local: IntArray,
    sizes: tuple[int, int],
    front: FloatArray,
    update: FloatArray,
    general: bool,
) -> None:
    """Extend-add: add the update ``handed`` by a child with border ``nodes`` (b,) to its parent's panel
    ``front`` and ``update``; ``sizes``: pivots and border of the parent."""
    pivots, edge = sizes
    rows, runs = 2 * len(nodes), 0
    # Runs of consecutive nodes in both borders, either all pivots or none, are added together.
    ends, shifts = np.empty(len(nodes), dtype=np.int64), np.empty(len(nodes), dtype=np.int64)
    for j in range(len(nodes)):
        to = local[nodes[j]]
        if j == 0 or to != local[nodes[j - 1]] + 2 or to == pivots:
            shifts[runs] = to - 2 * j
            runs += 1
        ends[runs - 1] = 2 * (j + 1)
    begin, run = 0, 0
    for column in range(rows):
        if ends[run] == column:
            run += 1
        to, first = column + shifts[run], 0 if general else column
        for k in range(0 if general else run, runs):
            row = first + shifts[k]
            if to < pivots:
                target = front[(pivots + edge) * to + row :]
            elif row < pivots:
                target = front[(pivots + edge) * pivots + pivots * (to - pivots) + row :]
            else:
                target = update[edge * (to - pivots) + row - pivots :]
            added = handed[begin : begin + ends[k] - first]
            for i in range(len(added)):
                target[i] += added[i]
            begin += ends[k] - first
            first = ends[k]


@inner
def _eliminate(front: FloatArray, update: FloatArray, pivots: int, positive: int, edge: int) -> bool:
    """Factorise a panel in place and subtract its Schur complement from ``update``; false if one of the first
    ``positive`` pivots is not positive or one of the others not negative. STRIP_COLUMNS columns at a time:
    matrix products are several times as fast as triangular solves."""
    c: Any = letters()
    height, first = pivots + edge, 0
    while first < pivots:
        own = first < positive
        columns = min(STRIP_COLUMNS, (positive if own else pivots) - first)
        rows, rest = height - first - columns, pivots - first - columns
        i: Any = np.array([columns, height, 0], dtype=np.int32)
        strip: Any = front[first * (height + 1) :]
        for column in range(first, first if own else first + columns):
            part = front[column * height + first : (column + 1) * height]
            for row in range(len(part)):
                part[row] = -part[row]
        dpotrf(c[LOWER:].ctypes, i.ctypes, strip.ctypes, i[1:].ctypes, i[2:].ctypes)
        if i[2] != 0:
            return False
        if rows > 0:
            below = strip[columns:]
            solve_triangle(RIGHT, LOWER, TRANSPOSED, PLAIN, rows, columns, strip, height, below, height)
            if rest > 0:
                later = strip[columns * (height + 1) :]
                sizes = (rows, rest, columns)
                sign = -1.0 if own else 1.0
                multiply(TRANSPOSED, sizes, sign, below, height, below, height, 1.0, later, height)
        first += columns
    if edge > 0:
        _subtract_schur(front[pivots:], update, (edge, pivots, height), positive)
    return True


@inner
def _subtract_schur(
    border: FloatArray, update: FloatArray, sizes: tuple[int, int, int], positive: int
) -> None:
    """Subtract B D B^T from ``update`` (edge, edge), with B = ``border`` (edge, pivots) of leading dimension
    height and D = +1 for the first ``positive`` columns, -1 for the others; ``sizes``: edge, pivots,
    height."""
    edge, pivots, height = sizes
    if positive == pivots:
        c: Any = letters()
        k: Any = np.array([edge, pivots, height], dtype=np.int32)
        factor: Any = np.array([-1.0, 1.0])
        below: Any = border
        change: Any = update
        dsyrk(
            *(c[LOWER:].ctypes, c[PLAIN:].ctypes, k.ctypes, k[1:].ctypes, factor.ctypes, below.ctypes),
            *(k[2:].ctypes, factor[1:].ctypes, change.ctypes, k.ctypes),
        )
        return
    # In one pass: a second one for a few columns would be limited by memory bandwidth.
    turned = np.empty(STRIP_COLUMNS * pivots)
    for first in range(0, edge, STRIP_COLUMNS):
        columns = min(STRIP_COLUMNS, edge - first)
        for column in range(pivots):
            sign = 1.0 if column < positive else -1.0
            for i in range(columns):
                turned[columns * column + i] = sign * border[height * column + first + i]
        part = (edge - first, columns, pivots)
        later = update[first * (edge + 1) :]
        multiply(TRANSPOSED, part, -1.0, border[first:], height, turned, columns, 1.0, later, edge)


@inner
def swap_rows(x: FloatArray, swaps: Any, step: int, columns: int, width: int) -> None:
    """Exchange rows of x, ``step`` apart, by pivots ``swaps``, in ``columns`` entries ``width`` apart."""
    for row in range(len(swaps)):
        other = swaps[row] - 1
        if other != row:
            for column in range(columns):
                a, b = step * row + width * column, step * other + width * column
                x[a], x[b] = x[b], x[a]


@inner
def _eliminate_general(front: FloatArray, update: FloatArray, pivots: int, edge: int, swaps: Any) -> bool:
    """Factorise a panel in place and subtract its Schur complement from ``update``; false if singular."""
    height = pivots + edge
    i: Any = np.array([pivots, height, 0], dtype=np.int32)
    columns: Any = front
    dgetrf(i.ctypes, i.ctypes, columns.ctypes, i[1:].ctypes, swaps.ctypes, i[2:].ctypes)
    if i[2] != 0:
        return False
    if edge > 0:
        across, below = front[height * pivots :], front[pivots:]
        swap_rows(across, swaps, 1, edge, pivots)
        solve_triangle(LEFT, LOWER, PLAIN, UNIT, pivots, edge, front, height, across, pivots)
        solve_triangle(RIGHT, UPPER, PLAIN, PLAIN, edge, pivots, front, height, below, height)
        multiply(PLAIN, (edge, edge, pivots), -1.0, below, height, across, pivots, 1.0, update, edge)
    return True


@kernel
def factorise(
    start: Int1,
    negative: Int1,
    parent: Int1,
    begin: Int1,
    border: Int1,
    panel: Int1,
    most: int,
    indptr: Index1,
    indices: Index1,
    blocks: Float3,
    mirrored: Int1,
    order: Int1,
    place: Int1,
    swaps: IndexOut1,
    values: FloatOut1,
) -> int:
    """Compute the panels of the factor into ``values``, at offsets ``panel`` (f + 1,), and the exchanges of
    rows of a general matrix into ``swaps`` (2n,); returns the first front that is singular or has a pivot of
    the wrong sign, or -1.

    ``negative`` (f,) is the number of nodes of each front, its last ones, with negative pivots. ``begin``,
    ``border`` and ``most`` come from :func:`borders`. ``indptr``, ``indices``, ``blocks`` (e, 2, 2) are the
    matrix by nodes; of a general one ``mirrored`` (e,) are the numbers of the transposed blocks, of a
    symmetric one it is empty.
    """
    general = len(mirrored) > 0
    # Squares are less than twice their triangles.
    waiting = np.empty(2 * most if general else most)
    widest = 0
    for f in range(len(parent)):
        widest = max(widest, 2 * (begin[f + 1] - begin[f]))
    changed = np.empty(widest**2)
    local = np.zeros(len(order), dtype=np.int64)
    owner = np.empty(len(parent), dtype=np.int64)
    top, depth = 0, 0
    for f in range(len(parent)):
        first, end = start[f], start[f + 1]
        pivots, edge = 2 * (end - first), 2 * (begin[f + 1] - begin[f])
        height = pivots + edge
        locate((first, end), border[begin[f] : begin[f + 1]], local)
        front, update = values[panel[f] : panel[f + 1]], changed[: edge**2]
        front[:] = 0.0
        for column in range(edge):
            # The upper triangle of a symmetric update is never read.
            part = update[edge * column + (0 if general else column) : edge * (column + 1)]
            for i in range(len(part)):
                part[i] = 0.0
        for position in range(first, end):
            own = local[position]
            for entry in range(indptr[order[position]], indptr[order[position] + 1]):
                at = place[indices[entry]]
                if at < first:
                    continue
                to = local[at]
                for side in range(2):
                    for row in range(2):
                        below = blocks[mirrored[entry], row, side] if general else blocks[entry, side, row]
                        front[height * (own + side) + to + row] = below
                        if general and at >= end:
                            across = height * pivots + pivots * (to - pivots + side)
                            front[across + own + row] = blocks[entry, row, side]
        while depth > 0 and parent[owner[depth - 1]] == f:
            depth -= 1
            nodes = border[begin[owner[depth]] : begin[owner[depth] + 1]]
            top -= 4 * len(nodes) ** 2 if general else _triangle(2 * len(nodes))
            _extend_add(nodes, waiting[top:], local, (pivots, edge), front, update, general)
        if pivots > 0:
            if general:
                sound = _eliminate_general(front, update, pivots, edge, swaps[2 * first : 2 * end])
            else:
                sound = _eliminate(front, update, pivots, pivots - 2 * negative[f], edge)
            if not sound:
                return f
        for column in range(edge):
            part = update[edge * column + (0 if general else column) : edge * (column + 1)]
            copy_to(waiting[top:], part)
            top += len(part)
        owner[depth] = f
        depth += 1
    return -1
