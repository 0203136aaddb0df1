"""Weights of value and derivatives at points, on their neighbours."""

from __future__ import annotations

import numpy as np

from mlsanm_cli.arrays import FloatArray, IntArray
from mlsanm_cli.kernels.stencils import apply_weights
from mlsanm_cli.records import dataclass


@dataclass(frozen=True)
class Stencils:
    """Stencils of ``e`` points in CSR form.

    ``indptr`` (e + 1,), node ``indices`` (nnz,), ``weights`` (nnz, 1 | 3 | 6) of value, d/dx, d/dy, d2/dx2,
    d2/dxdy, d2/dy2 unless stated otherwise. ``enlarged`` counts stencils with more neighbours than requested,
    ``worst_ratio`` is the smallest accepted ratio of diagonal entries of R.
    """

    indptr: IntArray
    indices: IntArray
    weights: FloatArray
    nodes: int
    enlarged: int
    worst_ratio: float

    def take(self, rows: IntArray) -> Stencils:
        """The stencils of the points ``rows``, in that order."""
        count = np.diff(self.indptr)[rows]
        indptr = np.concatenate([[0], np.cumsum(count)])
        entry = np.repeat(self.indptr[rows] - indptr[:-1], count) + np.arange(indptr[-1])
        return Stencils(
            indptr, self.indices[entry], self.weights[entry], self.nodes, self.enlarged, self.worst_ratio
        )

    def derivatives(self, field: FloatArray) -> FloatArray:
        """Value and derivatives (e, kinds, c), in the order of the weights, of a nodal ``field`` (n, c).
        Raises ValueError for a field of another number of nodes."""
        if len(field) != self.nodes:
            raise ValueError(f"a field of {len(field)} nodes for stencils of {self.nodes}")
        result = np.zeros((len(self.indptr) - 1, self.weights.shape[1], field.shape[1]))
        apply_weights(self.indptr, self.indices, self.weights, np.ascontiguousarray(field), result)
        return result
