"""Forward and backward substitution with the factor of :mod:`mlsanm_cli.kernels.multifrontal`."""

from __future__ import annotations

import numpy as np

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.kernels.aot.jit import inner, kernel
from mlsanm_cli.kernels.aot.signature import Float1, Float2, FloatOut1, Index1, Int1
from mlsanm_cli.kernels.dense import (
    LOWER,
    PLAIN,
    RIGHT,
    TRANSPOSED,
    UNIT,
    UPPER,
    apply,
    copy_to,
    multiply,
    solve_triangle,
    solve_vector,
)
from mlsanm_cli.kernels.multifrontal import locate, swap_rows


@inner
def _forward(panel: FloatArray, diagonal: int, pivots: int, height: int, x: FloatArray, c: int) -> None:
    """Forward substitution with one panel, whose ``diagonal`` is PLAIN or UNIT: solve for the first
    ``pivots`` rows of ``x`` (height, c) and update the others."""
    edge = height - pivots
    # Matrix products copy the panel first: for a single vector BLAS level 2 is faster.
    if c == 1:
        solve_vector(LOWER, PLAIN, diagonal, pivots, panel, height, x)
        if edge > 0:
            apply(PLAIN, (edge, pivots), panel[pivots:], height, x, x[pivots:])
    else:
        solve_triangle(RIGHT, LOWER, TRANSPOSED, diagonal, c, pivots, panel, height, x, c)
        if edge > 0:
            sizes = (c, edge, pivots)
            multiply(TRANSPOSED, sizes, -1.0, x, c, panel[pivots:], height, 1.0, x[pivots * c :], c)


@inner
def _backward(panel: FloatArray, general: bool, pivots: int, height: int, x: FloatArray, c: int) -> None:
    """Solve with the transposed panel, or U if ``general``, for the first rows of ``x`` (height, c)."""
    edge = height - pivots
    part, plain, turned, sizes, width = LOWER, TRANSPOSED, PLAIN, (edge, pivots), height
    rest = panel[pivots:]
    if general:
        part, plain, turned, sizes, width = UPPER, PLAIN, TRANSPOSED, (pivots, edge), pivots
        rest = panel[height * pivots :]
    if c == 1:
        if edge > 0:
            apply(plain, sizes, rest, width, x[pivots:], x)
        solve_vector(part, plain, PLAIN, pivots, panel, height, x)
    else:
        if edge > 0:
            multiply(turned, (c, pivots, edge), -1.0, x[pivots * c :], c, rest, width, 1.0, x, c)
        solve_triangle(RIGHT, part, turned, PLAIN, c, pivots, panel, height, x, c)


@kernel
def solve(
    start: Int1,
    negative: Int1,
    begin: Int1,
    border: Int1,
    panel: Int1,
    values: Float1,
    swaps: Index1,
    x: FloatOut1,
    c: int,
) -> None:
    """Solve in place for c right-hand sides ``x`` (2n, c), flat, in order of elimination, with the factor of
    a general matrix if there are ``swaps`` (2n,), else of a symmetric one."""
    general = len(swaps) > 0
    diagonal = UNIT if general else PLAIN
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
        below, height = local[pivots * c :], pivots + 2 * len(nodes)
        front = values[panel[f] : panel[f + 1]]
        copy_to(local, own[: pivots * c])
        for j in range(len(nodes)):
            for i in range(2 * c):
                # Forward, the border collects the updates of other fronts too.
                below[2 * j * c + i] = 0.0 if forward else x[2 * nodes[j] * c + i]
        if forward:
            swap_rows(local, swaps[2 * start[f] : 2 * start[f + 1]], c, c, 1)
            _forward(front, diagonal, pivots, height, local, c)
            for j in range(len(nodes)):
                for i in range(2 * c):
                    x[2 * nodes[j] * c + i] += below[2 * j * c + i]
        else:
            # D between both triangles: signs of the pivots.
            _flip_signs(local, c, c, pivots, 0 if general else 2 * negative[f])
            _backward(front, general, pivots, height, local, c)
        copy_to(own, local[: pivots * c])


@inner
def _flip_signs(x: FloatArray, c: int, columns: int, pivots: int, negative: int) -> None:
    """Flip the signs of the first ``columns`` of the last ``negative`` rows of x (pivots, c)."""
    for row in range(pivots - negative, pivots):
        for i in range(columns):
            x[row * c + i] = -x[row * c + i]


@kernel
def products(
    start: Int1,
    negative: Int1,
    begin: Int1,
    border: Int1,
    panel: Int1,
    values: Float1,
    parent: Int1,
    indptr: Int1,
    indices: Int1,
    data: Float1,
    left: int,
    total: int,
) -> Float2:
    """Condensation products (L^-1 b_i)^T D (L^-1 b_j) for i < ``left`` <= j < ``total``, b sparse columns. L
    is the factor and D the pivots' signs. ``indptr``, ``indices``, ``data`` hold b by rows (2n,), in order of
    elimination. A front solves only for columns with entries in it or in its subtree."""
    result = np.zeros((left, total - left))
    handed, active = [np.empty(0)], [np.empty(0, dtype=np.int64)]
    owner = np.empty(len(parent), dtype=np.int64)
    local = np.zeros(start[-1], dtype=np.int64)
    mark, at = np.full(total, -1, dtype=np.int64), np.zeros(total, dtype=np.int64)
    depth = 0
    for f in range(len(parent)):
        first, end, nodes = start[f], start[f + 1], border[begin[f] : begin[f + 1]]
        pivots, height = 2 * (end - first), 2 * (end - first + len(nodes))
        # Columns with entries in the front or its children, and the position of each among them.
        bottom = depth
        while bottom > 0 and parent[owner[bottom - 1]] == f:
            for other in active[bottom]:
                mark[other] = f
            bottom -= 1
        for entry in range(indptr[2 * first], indptr[2 * end]):
            mark[indices[entry]] = f
        columns, c = np.empty(total, dtype=np.int64), 0
        for column in range(total):
            if mark[column] == f:
                columns[c], at[column] = column, c
                c += 1
        columns = columns[:c].copy()
        x = np.zeros(height * c)
        for row in range(2 * first, 2 * end):
            for entry in range(indptr[row], indptr[row + 1]):
                x[(row - 2 * first) * c + at[indices[entry]]] += data[entry]
        locate((first, end), nodes, local)
        while depth > bottom:
            child, width = owner[depth - 1], len(active[depth])
            for j in range(2 * (begin[child + 1] - begin[child])):
                to = local[border[begin[child] + j // 2]] + j % 2
                for i in range(width):
                    x[to * c + at[active[depth][i]]] += handed[depth][j * width + i]
            depth -= 1
        if c > 0 and pivots > 0:
            _forward(values[panel[f] : panel[f + 1]], PLAIN, pivots, height, x, c)
            # x_i^T D x_j of the columns i < left <= j.
            split = 0
            while split < c and columns[split] < left:
                split += 1
            rest = c - split
            if split > 0 and rest > 0:
                part = np.empty(split * rest)
                _flip_signs(x, c, split, pivots, 2 * negative[f])
                multiply(TRANSPOSED, (rest, split, pivots), 1.0, x[split:], c, x, c, 0.0, part, rest)
                for i in range(split):
                    for j in range(rest):
                        result[columns[i], columns[split + j] - left] += part[i * rest + j]
        if depth + 1 == len(handed):
            handed.append(x[:0])
            active.append(columns[:0])
        depth += 1
        handed[depth], active[depth], owner[depth - 1] = x[pivots * c :].copy(), columns, f
    return result
