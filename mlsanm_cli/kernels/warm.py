"""Loads, or compiles where needed, every kernel the package uses."""

from __future__ import annotations

import numpy as np

from mlsanm_cli.kernels.dissection import dissect
from mlsanm_cli.kernels.fill import advance_front, spacing_at
from mlsanm_cli.kernels.hyperbola import hyperbola_orders
from mlsanm_cli.kernels.multifrontal import borders, factorise, products, solve
from mlsanm_cli.kernels.normal import add_blocks, count_neighbours, rows_of_nodes
from mlsanm_cli.kernels.sight import cut_lines
from mlsanm_cli.kernels.stencils import apply_weights, mls_weights


def load_all() -> None:
    """Call every kernel once on a tiny input of the types used everywhere."""
    square = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
    edges = np.hstack([square, np.roll(square, -1, axis=0)])
    zones = np.array([[0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.5, 0.1, 0.1]])
    spacing_at(1.0, zones, square)
    start, numbers = np.array([0, 2], dtype=np.int64), np.array([1, 3], dtype=np.int64)
    advance_front(square, edges, start, numbers, 0.0, 1.1, 1.0, zones, 15, 0, 1000)
    indptr, indices = np.array([0, 4], dtype=np.int64), np.arange(4, dtype=np.int64)
    center, radius = square[:1].copy(), np.array([1.5])
    mls_weights(square, indptr, indices, center, center, radius, 1, 4.0, 1, np.empty((4, 3)), np.empty(1))
    apply_weights(indptr, indices, np.ones((4, 3)), square, np.zeros((1, 3, 2)))
    along = np.array([[0.0, 1.0], [1.0, 2.0], [2.0, 3.0], [3.0, 4.0]])
    cut_lines(center, square, indices[None], indptr, indices, edges, along, np.full(4, 4.0), square, 3.0)
    one, first, none = np.ones((1, 1)), np.zeros(1, dtype=np.int64), np.zeros(0, dtype=np.int64)
    slope, series, factors = np.ones(2), np.ones((3, 2)), np.ones(3)
    shape = (slope, slope, 1.0, one, first, one, 1, 1.0, 1.0, none, slope[:0], none)
    hyperbola_orders(series, factors, *shape)
    _load_factor()


def _load_factor() -> None:
    """Those of the normal equations of two rows on one node."""
    narrow = np.int32
    indptr, nodes = np.array([0, 1, 2], dtype=narrow), np.zeros(2, dtype=narrow)
    begin, end, row, entry = (np.zeros(2, dtype=narrow) for _ in range(4))
    rows_of_nodes(indptr, nodes, begin, row, entry)
    count_neighbours(indptr, nodes, begin, row, np.full(1, -1, dtype=narrow), end)
    neighbour, blocks = np.empty(1, dtype=narrow), np.zeros((1, 2, 2))
    add_blocks(
        indptr, nodes, np.eye(2), begin, row, entry, np.full(1, -1, dtype=narrow), end, neighbour, blocks
    )
    order, begins, alone = (
        np.zeros(1, dtype=np.int64),
        np.zeros(3, dtype=np.int64),
        np.zeros(3, dtype=np.int64),
    )
    dissect(end, neighbour, np.zeros((2, 1), dtype=narrow), 1, order, begins, alone)
    start, parent = np.array([0, 1], dtype=np.int64), alone[:1].copy()
    edges, border, most = borders(start, parent, end, neighbour, order, order)
    tree = (start, parent, edges, border, np.array([0, 4], dtype=np.int64))
    values, _ = factorise(*tree, most, end, neighbour, blocks, order, order)
    solve(start, edges, border, tree[4], values, np.ones(2), 1)
    both, columns = np.array([0, 1, 2], dtype=np.int64), np.arange(2, dtype=np.int64)
    products(*tree, values, both, columns, np.ones(2), 1, 2)
