"""Sparse rows acting on nodal displacements, ordered u_x, u_y node by node."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sparse

from mlsanm_cli.arrays import FloatArray, IndexArray, IntArray
from mlsanm_cli.operators.linear.interface import MAX_ENTRIES
from mlsanm_cli.operators.stencil_weights import Stencils


def vector_rows(stencils: Stencils, on_x: FloatArray | None, on_y: FloatArray | None) -> sparse.csr_array:
    """One row per stencil (e, 2n): sum over neighbours j of on_x[j] u_x[j] + on_y[j] u_y[j]. ``on_x`` and
    ``on_y`` (nnz,) follow the stencils' entries; None omits one component."""
    if on_x is not None and on_y is not None:
        return pair_rows(stencils, np.stack([on_x, on_y], axis=1))
    component, alone = (1, on_y) if on_x is None else (0, on_x)
    assert alone is not None
    if component == 0:
        alone = stencils.signed(np.stack([alone, alone], axis=1))[:, 0]
    shape = (len(stencils.indptr) - 1, 2 * stencils.nodes)
    indptr, indices = _entries(stencils)
    return sparse.csr_array((alone, 2 * indices + component, indptr), shape=shape)


def pair_rows(stencils: Stencils, values: FloatArray) -> sparse.csr_array:
    """The same with the coefficients of u_x and u_y side by side: ``values`` (nnz, 2)."""
    shape = (len(stencils.indptr) - 1, 2 * stencils.nodes)
    indptr, indices = _entries(stencils)
    columns = np.stack([2 * indices, 2 * indices + 1], axis=1).ravel()
    return sparse.csr_array((stencils.signed(values).ravel(), columns, 2 * indptr), shape=shape)


def _entries(stencils: Stencils) -> tuple[IndexArray | IntArray, IndexArray | IntArray]:
    """Offsets and nodes of the stencils, with 32-bit indices if these suffice for rows: sparse products are
    limited by memory bandwidth."""
    if 2 * len(stencils.indices) > MAX_ENTRIES:
        return stencils.indptr, stencils.indices
    return stencils.indptr.astype(np.int32), stencils.indices.astype(np.int32)


def scalar_rows(stencils: Stencils, weights: FloatArray, odd: bool = False) -> sparse.csr_array:
    """One row per stencil (e, n) for a scalar nodal field; ``weights`` (nnz,) follow the stencils' entries.
    An ``odd`` field changes its sign behind an axis of revolution."""
    if odd:
        weights = stencils.signed(np.stack([weights, weights], axis=1))[:, 0]
    shape = (len(stencils.indptr) - 1, stencils.nodes)
    indptr, indices = _entries(stencils)
    return sparse.csr_array((weights, indices, indptr), shape=shape)


def nodal_rows(indices: IntArray, component: int, nodes: int) -> sparse.csr_array:
    """Rows (e, 2n) that pick u_x (0) or u_y (1) of nodes ``indices`` (e,)."""
    factors = np.zeros((len(indices), 2))
    factors[:, component] = 1.0
    return nodal_pairs(indices, factors, nodes)


def nodal_pairs(indices: IntArray, factors: FloatArray, nodes: int) -> sparse.csr_array:
    """Rows (e, 2n) of factors_x u_x + factors_y u_y at nodes ``indices`` (e,), for ``factors`` (e, 2)."""
    columns = np.stack([2 * indices, 2 * indices + 1], axis=1).ravel().astype(np.int32)
    indptr = 2 * np.arange(len(indices) + 1, dtype=np.int32)
    return sparse.csr_array((factors.ravel(), columns, indptr), shape=(len(indices), 2 * nodes))
