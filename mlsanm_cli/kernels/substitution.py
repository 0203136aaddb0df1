"""Forward and backward substitution with the factor of :mod:`mlsanm_cli.kernels.multifrontal`, unit by unit.
``begin``, ``border``, ``kept``, ``panel``, ``unit`` and the links come from :mod:`mlsanm_cli.kernels.domains`
and the factorisation."""

from __future__ import annotations

from typing import TypeAlias

import numpy as np

from mlsanm_cli.arrays import FloatArray, IntArray
from mlsanm_cli.kernels.aot.jit import inner, kernel
from mlsanm_cli.kernels.aot.signature import Float1, Float2, Float3, FloatOut1, Int1
from mlsanm_cli.kernels.copies import copy_to
from mlsanm_cli.kernels.dense import PLAIN, TRANSPOSED, apply, multiply, solve_right, solve_vector
from mlsanm_cli.kernels.multifrontal import BLOCK_COLUMNS, locate

Tree: TypeAlias = tuple[IntArray, IntArray, IntArray, IntArray, IntArray, IntArray, FloatArray]
"""``start``, ``negative``, ``begin``, ``border``, ``kept``, ``panel`` and ``values``."""
Links: TypeAlias = tuple[IntArray, IntArray, FloatArray]
"""``link``, ``other`` and ``between``."""


@inner
def _forward(panel: FloatArray, pivots: int, height: int, x: FloatArray, c: int) -> None:
    """Forward substitution with one panel: solve for the first ``pivots`` rows of ``x`` (height, c) and
    update the others."""
    begin = 0
    for first in range(0, pivots, BLOCK_COLUMNS):
        columns, rows = min(BLOCK_COLUMNS, pivots - first), height - first
        block, own, rest = panel[begin:], x[first * c :], x[(first + columns) * c :]
        # Matrix products copy the panel first: for a single vector BLAS level 2 is faster.
        if c == 1:
            solve_vector(PLAIN, columns, block, rows, own)
            if rows > columns:
                apply(PLAIN, (rows - columns, columns), block[columns:], rows, own, rest)
        else:
            solve_right(TRANSPOSED, c, columns, block, rows, own, c)
            if rows > columns:
                sizes = (c, rows - columns, columns)
                multiply(TRANSPOSED, sizes, -1.0, own, c, block[columns:], rows, 1.0, rest, c)
        begin += columns * rows


@inner
def _backward(panel: FloatArray, pivots: int, height: int, x: FloatArray, c: int) -> None:
    """Solve with the transposed panel for the first ``pivots`` rows of ``x`` (height, c)."""
    begin = len(panel)
    for first in range((pivots - 1) // BLOCK_COLUMNS * BLOCK_COLUMNS, -1, -BLOCK_COLUMNS):
        columns, rows = min(BLOCK_COLUMNS, pivots - first), height - first
        begin -= columns * rows
        block, own, rest = panel[begin:], x[first * c :], x[(first + columns) * c :]
        if c == 1:
            if rows > columns:
                apply(TRANSPOSED, (rows - columns, columns), block[columns:], rows, rest, own)
            solve_vector(TRANSPOSED, columns, block, rows, own)
        else:
            if rows > columns:
                sizes = (c, columns, rows - columns)
                multiply(PLAIN, sizes, -1.0, rest, c, block[columns:], rows, 1.0, own, c)
            solve_right(PLAIN, c, columns, block, rows, own, c)


@inner
def _sweep(
    fronts: tuple[int, int],
    forward: bool,
    tree: Tree,
    rows: IntArray,
    x: FloatArray,
    c: int,
    local: FloatArray,
) -> None:
    """Forward or backward substitution with consecutive fronts for flat ``x``. ``rows`` (n,) are the
    positions of the nodes' rows in ``x``; ``local`` is workspace for one front."""
    start, negative, begin, border, kept, panel, values = tree
    for step in range(fronts[1] - fronts[0]):
        f = fronts[0] + step if forward else fronts[1] - 1 - step
        pivots = 2 * (start[f + 1] - start[f])
        if pivots == 0:
            continue
        own, nodes = x[rows[start[f]] * c :], border[begin[f] : begin[f] + kept[f]]
        below, height = local[pivots * c :], pivots + 2 * len(nodes)
        copy_to(local, own[: pivots * c])
        for j in range(len(nodes)):
            for i in range(2 * c):
                # Forward, the border collects the updates of other fronts too.
                below[2 * j * c + i] = 0.0 if forward else x[rows[nodes[j]] * c + i]
        if forward:
            _forward(values[panel[f] : panel[f + 1]], pivots, height, local, c)
            for j in range(len(nodes)):
                for i in range(2 * c):
                    x[rows[nodes[j]] * c + i] += below[2 * j * c + i]
        else:
            # D between both triangles: signs of the pivots.
            for i in range((pivots - 2 * negative[f]) * c, pivots * c):
                local[i] = -local[i]
            _backward(values[panel[f] : panel[f + 1]], pivots, height, local, c)
        copy_to(own, local[: pivots * c])


@inner
def _update_border(nodes: tuple[int, int], links: Links, rows: IntArray, x: FloatArray, c: int) -> None:
    """Subtract the contribution of the solution at a domain's ``nodes`` from the rows of its border in
    ``x``."""
    begin, other, between = links
    for node in range(nodes[0], nodes[1]):
        for entry in range(begin[node], begin[node + 1]):
            for side in range(2):
                source = (rows[node] + side) * c
                for k in range(2):
                    row, factor = (rows[other[entry]] + k) * c, between[entry, side, k]
                    for i in range(c):
                        x[row + i] -= factor * x[source + i]


@inner
def _border_contribution(nodes: tuple[int, int], links: Links, x: FloatArray, c: int, to: FloatArray) -> None:
    """Set ``to``, the rows of a domain's ``nodes``, to the contribution of the solution ``x`` at its
    border."""
    begin, other, between = links
    to[: 2 * (nodes[1] - nodes[0]) * c] = 0.0
    for node in range(nodes[0], nodes[1]):
        for entry in range(begin[node], begin[node + 1]):
            for side in range(2):
                row, source = (2 * (node - nodes[0]) + side) * c, 2 * other[entry] * c
                for k in range(2):
                    for i in range(c):
                        to[row + i] += between[entry, side, k] * x[source + k * c + i]


@inner
def _tallest(unit: IntArray, tree: Tree) -> tuple[int, int]:
    """Largest number of rows of a front, and of a unit's own nodes."""
    start, _, _, _, kept, _, _ = tree
    front, own = 0, 0
    for f in range(len(kept)):
        front = max(front, 2 * (start[f + 1] - start[f] + kept[f]))
    for u in range(len(unit) - 1):
        own = max(own, 2 * (start[unit[u + 1]] - start[unit[u]]))
    return front, own


@kernel
def solve(
    start: Int1,
    negative: Int1,
    begin: Int1,
    border: Int1,
    kept: Int1,
    panel: Int1,
    values: Float1,
    unit: Int1,
    link: Int1,
    other: Int1,
    between: Float3,
    x: FloatOut1,
    c: int,
) -> None:
    """Solve in place for c right-hand sides ``x`` (2n, c), flat, in order of elimination."""
    tree, links = (start, negative, begin, border, kept, panel, values), (link, other, between)
    tallest, widest = _tallest(unit, tree)
    local, brought = np.empty(tallest * c), np.empty(widest * c)
    rows, within = 2 * np.arange(start[-1]), np.empty(start[-1], dtype=np.int64)
    for u in range(len(unit) - 1):
        for node in range(start[unit[u]], start[unit[u + 1]]):
            within[node] = rows[node] - rows[start[unit[u]]]
    for step in range(2 * (len(unit) - 1)):
        forward = step < len(unit) - 1
        u = step if forward else 2 * (len(unit) - 1) - 1 - step
        fronts = (unit[u], unit[u + 1])
        nodes = (start[fronts[0]], start[fronts[1]])
        domain = link[nodes[1]] > link[nodes[0]]
        if domain and not forward:
            # The contribution of the border is solved for separately and subtracted from the domain's
            # solution.
            _border_contribution(nodes, links, x, c, brought)
        part, where = (brought, within) if domain and not forward else (x, rows)
        for way in (True, False):
            if domain or way == forward:
                _sweep(fronts, way, tree, where, part, c, local)
        if domain and forward:
            _update_border(nodes, links, rows, x, c)
        elif domain:
            own = x[2 * nodes[0] * c :]
            for i in range(2 * (nodes[1] - nodes[0]) * c):
                own[i] -= brought[i]


@inner
def _mark(mark: IntArray, columns: IntArray, f: int) -> None:
    for i in range(len(columns)):
        mark[columns[i]] = f


@inner
def _marked(mark: IntArray, f: int, at: IntArray) -> IntArray:
    """Columns marked with f; ``at`` receives the position of each among them."""
    active = np.empty(len(mark), dtype=np.int64)
    c = 0
    for column in range(len(mark)):
        if mark[column] == f:
            active[c] = column
            at[column] = c
            c += 1
    return active[:c].copy()


@inner
def _flip_signs(
    x: FloatArray, c: int, split: int, fronts: tuple[int, int], start: IntArray, negative: IntArray
) -> None:
    """Flip the signs of the first ``split`` columns of x (pivots, c) in the fronts' negative rows."""
    for f in range(fronts[0], fronts[1]):
        last = start[f + 1] - start[fronts[0]]
        for row in range(2 * (last - negative[f]), 2 * last):
            for i in range(split):
                x[row * c + i] = -x[row * c + i]


@inner
def _add_product(
    x: FloatArray,
    columns: IntArray,
    left: int,
    fronts: tuple[int, int],
    signs: tuple[IntArray, IntArray],
    result: FloatArray,
) -> None:
    """Add x_i^T D x_j of the ``columns`` (c,) of x (pivots, c), the rows of some ``fronts``, to ``result``;
    ``signs`` are ``start`` and ``negative`` of all fronts."""
    c, split = len(columns), 0
    start, negative = signs
    pivots = 2 * (start[fronts[1]] - start[fronts[0]])
    while split < c and columns[split] < left:
        split += 1
    rest = c - split
    if split > 0 and rest > 0:
        part = np.empty(split * rest)
        _flip_signs(x, c, split, fronts, start, negative)
        multiply(TRANSPOSED, (rest, split, pivots), 1.0, x[split:], c, x, c, 0.0, part, rest)
        for i in range(split):
            for j in range(rest):
                result[columns[i], columns[split + j] - left] += part[i * rest + j]
        _flip_signs(x, c, split, fronts, start, negative)


@kernel
def products(
    start: Int1,
    negative: Int1,
    begin: Int1,
    border: Int1,
    kept: Int1,
    panel: Int1,
    values: Float1,
    unit: Int1,
    link: Int1,
    other: Int1,
    between: Float3,
    parent: Int1,
    indptr: Int1,
    indices: Int1,
    data: Float1,
    left: int,
    total: int,
) -> Float2:
    """Condensation products (L^-1 b_i)^T D (L^-1 b_j) for i < ``left`` <= j < ``total``, b sparse columns. L
    is the factor and D the pivots' signs. ``indptr``, ``indices``, ``data`` hold b by rows (2n,), in order of
    elimination. A unit solves only for columns with entries in it or in its subtree."""
    result = np.zeros((left, total - left))
    tree, links = (start, negative, begin, border, kept, panel, values), (link, other, between)
    handed, active = [np.empty(0)], [np.empty(0, dtype=np.int64)]
    owner = np.empty(len(parent), dtype=np.int64)
    local = np.zeros(start[-1], dtype=np.int64)
    mark, at = np.full(total, -1, dtype=np.int64), np.zeros(total, dtype=np.int64)
    tallest = _tallest(unit, tree)[0]
    depth = 0
    for u in range(len(unit) - 1):
        f, first, end = unit[u + 1] - 1, start[unit[u]], start[unit[u + 1]]
        pivots, edge = 2 * (end - first), 2 * (begin[f + 1] - begin[f])
        bottom = depth
        while bottom > 0 and parent[owner[bottom - 1]] == f:
            _mark(mark, active[bottom], f)
            bottom -= 1
        _mark(mark, indices[indptr[2 * first] : indptr[2 * end]], f)
        columns = _marked(mark, f, at)
        c = len(columns)
        x = np.zeros((pivots + edge) * c)
        for row in range(2 * first, 2 * end):
            for entry in range(indptr[row], indptr[row + 1]):
                x[(row - 2 * first) * c + at[indices[entry]]] += data[entry]
        locate((first, end), border[begin[f] : begin[f + 1]], local)
        while depth > bottom:
            child, width = owner[depth - 1], len(active[depth])
            for j in range(2 * (begin[child + 1] - begin[child])):
                to = local[border[begin[child] + j // 2]] + j % 2
                for i in range(width):
                    x[to * c + at[active[depth][i]]] += handed[depth][j * width + i]
            depth -= 1
        if c > 0 and pivots > 0:
            domain, room = link[end] > link[first], np.empty(tallest * c)
            for forward in (True, False):
                if forward or domain:
                    _sweep((unit[u], f + 1), forward, tree, local, x, c, room)
                if forward:
                    _add_product(x, columns, left, (unit[u], f + 1), (start, negative), result)
            if domain:
                _update_border((first, end), links, local, x, c)
        if depth + 1 == len(handed):
            handed.append(x[:0])
            active.append(columns[:0])
        depth += 1
        handed[depth], active[depth], owner[depth - 1] = x[pivots * c :].copy(), columns, f
    return result
