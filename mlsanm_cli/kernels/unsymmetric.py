"""Multifrontal LU factorisation of matrices with a symmetric pattern, over the tree of fronts of
:mod:`mlsanm_cli.kernels.multifrontal`, with partial pivoting among the pivots of a front (Duff and Reid 1984,
doi:10.1137/0905045).

The panel of a front with p pivots and e unknowns in its border has the columns (p + e, p), whose first rows
hold both triangles of the pivots' factor, followed by the rows (p, e) of the border; both are column-major.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from mlsanm_cli.arrays import FloatArray, IntArray
from mlsanm_cli.kernels.aot.jit import inner, kernel
from mlsanm_cli.kernels.aot.signature import Float1, Float3, FloatOut1, Index1, IndexOut1, Int1
from mlsanm_cli.kernels.blas import dgetrf
from mlsanm_cli.kernels.copies import copy_to
from mlsanm_cli.kernels.dense import (
    LEFT,
    LOWER,
    PLAIN,
    RIGHT,
    TRANSPOSED,
    UNIT,
    UPPER,
    apply,
    multiply,
    solve_triangle,
    solve_vector,
)
from mlsanm_cli.kernels.multifrontal import locate


@inner
def _extend_add(
    nodes: IntArray,
    handed: FloatArray,
    local: IntArray,
    sizes: tuple[int, int],
    front: FloatArray,
    update: FloatArray,
) -> None:
    """Extend-add: add the update ``handed`` (2b, 2b) by a child with border ``nodes`` (b,) to its parent's
    panel ``front`` and ``update``; ``sizes``: pivots and border of the parent."""
    pivots, edge = sizes
    rows, above = 2 * len(nodes), 0
    while above < len(nodes) and local[nodes[above]] < pivots:
        above += 1
    for column in range(rows):
        to = local[nodes[column // 2]] + column % 2
        source = handed[rows * column : rows * (column + 1)]
        if to < pivots:
            upper = front[(pivots + edge) * to :]
            lower = upper[pivots:]
        else:
            upper = front[(pivots + edge) * pivots + pivots * (to - pivots) :]
            lower = update[edge * (to - pivots) :]
        for j in range(above):
            upper[local[nodes[j]]] += source[2 * j]
            upper[local[nodes[j]] + 1] += source[2 * j + 1]
        for j in range(above, len(nodes)):
            lower[local[nodes[j]] - pivots] += source[2 * j]
            lower[local[nodes[j]] - pivots + 1] += source[2 * j + 1]


@inner
def _swap_rows(x: FloatArray, swaps: Any, step: int, columns: int, width: int) -> None:
    """Exchange the rows of x, entries ``step`` apart, in the order of pivots ``swaps``, in ``columns``
    entries ``width`` apart."""
    for row in range(len(swaps)):
        other = swaps[row] - 1
        if other != row:
            for column in range(columns):
                a, b = step * row + width * column, step * other + width * column
                x[a], x[b] = x[b], x[a]


@inner
def _eliminate(front: FloatArray, update: FloatArray, pivots: int, edge: int, swaps: Any) -> bool:
    """Factorise a panel in place and subtract its Schur complement from ``update``; false if singular."""
    height = pivots + edge
    i: Any = np.array([pivots, height, 0], dtype=np.int32)
    columns: Any = front
    dgetrf(i.ctypes, i.ctypes, columns.ctypes, i[1:].ctypes, swaps.ctypes, i[2:].ctypes)
    if i[2] != 0:
        return False
    if edge > 0:
        across, below = front[height * pivots :], front[pivots:]
        _swap_rows(across, swaps, 1, edge, pivots)
        solve_triangle(LEFT, LOWER, PLAIN, UNIT, pivots, edge, front, height, across, pivots)
        solve_triangle(RIGHT, UPPER, PLAIN, PLAIN, edge, pivots, front, height, below, height)
        multiply(PLAIN, (edge, edge, pivots), -1.0, below, height, across, pivots, 1.0, update, edge)
    return True


@kernel
def factorise_general(
    start: Int1,
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
    values: FloatOut1,
    swaps: IndexOut1,
) -> int:
    """Compute the panels of the factor into ``values``, at offsets ``panel`` (f + 1,), and the exchanges of
    rows ``swaps`` (2n,); returns the first singular front, or -1.

    ``begin``, ``border`` and ``most`` come from :func:`.multifrontal.borders`. ``indptr``, ``indices`` and
    ``blocks`` (e, 2, 2) are the matrix by nodes; ``mirrored`` (e,) are the numbers of the transposed blocks.
    """
    # Pending updates are squares, which are less than twice their triangles.
    waiting = np.empty(2 * most)
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
        update[:] = 0.0
        for position in range(first, end):
            own = local[position]
            for entry in range(indptr[order[position]], indptr[order[position] + 1]):
                at = place[indices[entry]]
                if at < first:
                    continue
                block, turned, to = blocks[entry], blocks[mirrored[entry]], local[at]
                for side in range(2):
                    for row in range(2):
                        if at < end:
                            front[height * (to + side) + own + row] = block[row, side]
                        else:
                            across = height * pivots + pivots * (to - pivots + side)
                            front[across + own + row] = block[row, side]
                            front[height * (own + side) + to + row] = turned[row, side]
        while depth > 0 and parent[owner[depth - 1]] == f:
            depth -= 1
            nodes = border[begin[owner[depth]] : begin[owner[depth] + 1]]
            top -= 4 * len(nodes) ** 2
            _extend_add(nodes, waiting[top:], local, (pivots, edge), front, update)
        if pivots > 0 and not _eliminate(front, update, pivots, edge, swaps[2 * first : 2 * end]):
            return f
        copy_to(waiting[top:], update)
        top += edge**2
        owner[depth] = f
        depth += 1
    return -1


@inner
def _forward(front: FloatArray, sizes: tuple[int, int], x: FloatArray, c: int) -> None:
    """Forward substitution with one panel: solve for the pivots' rows of ``x`` (height, c) and update the
    others."""
    pivots, edge = sizes
    height, below = pivots + edge, front[pivots:]
    if c == 1:
        solve_vector(LOWER, PLAIN, UNIT, pivots, front, height, x)
        if edge > 0:
            apply(PLAIN, (edge, pivots), below, height, x, x[pivots:])
        return
    solve_triangle(RIGHT, LOWER, TRANSPOSED, UNIT, c, pivots, front, height, x, c)
    if edge > 0:
        multiply(TRANSPOSED, (c, edge, pivots), -1.0, x, c, below, height, 1.0, x[pivots * c :], c)


@inner
def _backward(front: FloatArray, sizes: tuple[int, int], x: FloatArray, c: int) -> None:
    """Backward substitution for the pivots' rows of ``x`` (height, c)."""
    pivots, edge = sizes
    height, across = pivots + edge, front[(pivots + edge) * pivots :]
    if c == 1:
        if edge > 0:
            apply(PLAIN, (pivots, edge), across, pivots, x[pivots:], x)
        solve_vector(UPPER, PLAIN, PLAIN, pivots, front, height, x)
        return
    if edge > 0:
        multiply(TRANSPOSED, (c, pivots, edge), -1.0, x[pivots * c :], c, across, pivots, 1.0, x, c)
    solve_triangle(RIGHT, UPPER, TRANSPOSED, PLAIN, c, pivots, front, height, x, c)


@kernel
def solve_general(
    start: Int1, begin: Int1, border: Int1, panel: Int1, values: Float1, swaps: Index1, x: FloatOut1, c: int
) -> None:
    """Solve in place for c right-hand sides ``x`` (2n, c), flat, in order of elimination."""
    fronts, tallest = len(start) - 1, 0
    for f in range(fronts):
        tallest = max(tallest, 2 * (start[f + 1] - start[f] + begin[f + 1] - begin[f]))
    local = np.empty(tallest * c)
    for step in range(2 * fronts):
        forward = step < fronts
        f = step if forward else 2 * fronts - 1 - step
        pivots = 2 * (start[f + 1] - start[f])
        if pivots == 0:
            continue
        own, nodes = x[2 * start[f] * c :], border[begin[f] : begin[f + 1]]
        below, edge = local[pivots * c :], 2 * len(nodes)
        front = values[panel[f] : panel[f + 1]]
        copy_to(local, own[: pivots * c])
        for j in range(len(nodes)):
            for i in range(2 * c):
                # Forward, the border collects the updates of other fronts too.
                below[2 * j * c + i] = 0.0 if forward else x[2 * nodes[j] * c + i]
        if forward:
            _swap_rows(local, swaps[2 * start[f] : 2 * start[f + 1]], c, c, 1)
            _forward(front, (pivots, edge), local, c)
            for j in range(len(nodes)):
                for i in range(2 * c):
                    x[2 * nodes[j] * c + i] += below[2 * j * c + i]
        else:
            _backward(front, (pivots, edge), local, c)
        copy_to(own, local[: pivots * c])
