"""Weights of value and derivatives at points, on their neighbours, and sparse rows made of them, which act on
nodal displacements, ordered u_x, u_y node by node."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import scipy.sparse as sparse

from mlsanm_cli.arrays import BoolArray, FloatArray, IndexArray, IntArray
from mlsanm_cli.kernels.stencils import apply_weights
from mlsanm_cli.operators.factors import MAX_ENTRIES
from mlsanm_cli.records import dataclass

PARITY = {1: (1.0,), 2: (-1.0, 1.0), 3: (1.0, 1.0, -1.0), 4: (1.0, 1.0, -1.0, 1.0)}
"""Signs of a field at the image of a node behind an axis of revolution over those at the node, by its number
of components: scalars, displacements x and y, stresses xx, yy and xy, and these with the hoop stress."""


@dataclass(frozen=True)
class Stencils:
    """Stencils of ``e`` points in CSR form.

    ``indptr`` (e + 1,), node ``indices`` (nnz,), ``weights`` (nnz, 1 | 3 | 6) of value, d/dx, d/dy, d2/dx2,
    d2/dxdy, d2/dy2 unless stated otherwise. ``enlarged`` counts stencils with more neighbours than requested,
    ``worst_ratio`` is the smallest accepted ratio of diagonal entries of R.

    In bodies of revolution ``radius`` (e t,) are the distances of the t targets of each point from the axis,
    and entries that are an ``image`` (nnz,) belong to the image of their node behind it.
    """

    indptr: IntArray
    indices: IntArray
    weights: FloatArray
    nodes: int
    enlarged: int
    worst_ratio: float
    radius: FloatArray | None = None
    image: BoolArray | None = None

    def take(self, rows: IntArray) -> Stencils:
        """The stencils of the points ``rows``, in that order."""
        count = np.diff(self.indptr)[rows]
        indptr = np.concatenate([[0], np.cumsum(count)])
        entry = np.repeat(self.indptr[rows] - indptr[:-1], count) + np.arange(indptr[-1])
        found = replace(self, indptr=indptr, indices=self.indices[entry], weights=self.weights[entry])
        if self.image is None or self.radius is None:
            return found
        return replace(found, radius=self.radius[rows], image=self.image[entry])

    def of_revolution(self, own: IntArray, radius: FloatArray) -> Stencils:
        """The stencils in a body of revolution, whose last nodes are images of nodes ``own`` (g,)."""
        count = self.nodes - len(own)
        image = self.indices >= count
        numbers = np.concatenate([np.arange(count), own])
        return replace(self, indices=numbers[self.indices], nodes=count, radius=radius, image=image)

    def of_each(self, times: int) -> Stencils:
        """The stencils (e t,) of each of the ``times`` targets of every point (e,)."""
        length = np.repeat(np.diff(self.indptr), times)
        indptr = np.concatenate([[0], np.cumsum(length)])
        first = np.repeat(self.indptr[:-1], times) - indptr[:-1]
        entry = np.repeat(first, length) + np.arange(indptr[-1])
        target = np.repeat(np.arange(len(length)) % times, length)
        kinds = self.weights.shape[1] // times
        weights = self.weights.reshape(len(self.weights), times, kinds)[entry, target]
        image = None if self.image is None else self.image[entry]
        return replace(self, indptr=indptr, indices=self.indices[entry], weights=weights, image=image)

    def signed(self, values: FloatArray) -> FloatArray:
        """``values`` (..., nnz, 2) of entries, on u_x and u_y, with the signs of images."""
        if self.image is None:
            return values
        return np.where(self.image[:, None], np.array(PARITY[2]), 1.0) * values

    def derivatives(self, field: FloatArray) -> FloatArray:
        """Value and derivatives (e, kinds, c) of a nodal ``field`` (n, c). Raises ValueError for another
        n."""
        if len(field) != self.nodes:
            raise ValueError(f"a field of {len(field)} nodes for stencils of {self.nodes}")
        result = np.zeros((len(self.indptr) - 1, self.weights.shape[1], field.shape[1]))
        indices = self.indices
        if self.image is not None:
            indices = indices + len(field) * self.image
            field = np.concatenate([field, field * np.array(PARITY[field.shape[1]])])
        apply_weights(self.indptr, indices, self.weights, np.ascontiguousarray(field), result)
        return result


def component_rows(stencils: Stencils, weights: FloatArray, component: int) -> sparse.csr_array:
    """One row (e, 2n) per stencil with ``weights`` (nnz,) on u_x (0) or u_y (1) of its nodes."""
    rows = scalar_rows(stencils, weights, odd=component == 0)
    shape = (rows.shape[0], 2 * stencils.nodes)
    return sparse.csr_array((rows.data, 2 * rows.indices + component, rows.indptr), shape=shape)


def pair_rows(stencils: Stencils, values: FloatArray) -> sparse.csr_array:
    """One row (e, 2n) per stencil with ``values`` (nnz, 2) on u_x and u_y of its nodes."""
    shape = (len(stencils.indptr) - 1, 2 * stencils.nodes)
    indptr, indices = _entries(stencils)
    columns = np.stack([2 * indices, 2 * indices + 1], axis=1).ravel()
    return sparse.csr_array((stencils.signed(values).ravel(), columns, 2 * indptr), shape=shape)


def _entries(stencils: Stencils) -> tuple[IndexArray | IntArray, IndexArray | IntArray]:
    """Offsets and nodes of the stencils, with 32-bit indices if these suffice: less memory traffic."""
    if 2 * len(stencils.indices) > MAX_ENTRIES:
        return stencils.indptr, stencils.indices
    return stencils.indptr.astype(np.int32), stencils.indices.astype(np.int32)


def scalar_rows(stencils: Stencils, weights: FloatArray, odd: bool = False) -> sparse.csr_array:
    """One row (e, n) per stencil with ``weights`` (nnz,); ``odd`` fields change sign behind an axis."""
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
