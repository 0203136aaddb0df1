"""Sparse rows acting on nodal displacements, which are ordered u_x, u_y node by node."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sparse

from mlsanm_cli.arrays import FloatArray, IntArray
from mlsanm_cli.operators.stencils import Stencils


def vector_rows(stencils: Stencils, on_x: FloatArray | None, on_y: FloatArray | None) -> sparse.csr_array:
    """One row per stencil (e, 2n): sum over neighbours j of on_x[j] u_x[j] + on_y[j] u_y[j].

    ``on_x`` and ``on_y`` (nnz,) follow the stencil's entries; None leaves that component out.
    """
    shape = (len(stencils.indptr) - 1, 2 * stencils.nodes)
    if on_x is None or on_y is None:
        component, alone = (1, on_y) if on_x is None else (0, on_x)
        if alone is None:
            raise ValueError("a row acts on one component at least")
        return sparse.csr_array((alone, 2 * stencils.indices + component, stencils.indptr), shape=shape)
    columns = np.empty(2 * len(stencils.indices), dtype=np.int64)
    columns[0::2] = 2 * stencils.indices
    columns[1::2] = 2 * stencils.indices + 1
    values = np.empty(len(columns))
    values[0::2] = on_x
    values[1::2] = on_y
    return sparse.csr_array((values, columns, 2 * stencils.indptr), shape=shape)


def scalar_rows(stencils: Stencils, weights: FloatArray) -> sparse.csr_array:
    """One row per stencil (e, n) acting on a scalar nodal field; ``weights`` (nnz,) follow its entries."""
    shape = (len(stencils.indptr) - 1, stencils.nodes)
    return sparse.csr_array((weights, stencils.indices, stencils.indptr), shape=shape)


def nodal_rows(indices: IntArray, component: int, nodes: int) -> sparse.csr_array:
    """Rows (e, 2n) that pick the nodal displacement u_x (0) or u_y (1) of nodes ``indices`` (e,)."""
    count = len(indices)
    return sparse.csr_array(
        (np.ones(count), (np.arange(count), 2 * indices + component)), shape=(count, 2 * nodes)
    )
