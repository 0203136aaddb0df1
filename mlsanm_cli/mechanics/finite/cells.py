"""Moments that body forces gain on the pieces of a body by displacements."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sparse

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.cloud.cells import cell_quadrature
from mlsanm_cli.mechanics.body import ElasticBody
from mlsanm_cli.operators.rows import pair_rows


def moments_of_force(body: ElasticBody, centers: sparse.csr_array, force: FloatArray) -> sparse.csr_array:
    """Rows (k, 2N) of int (u - u_P) x b over every piece, over its size.

    The ``force`` b per volume, with nodal values (n, 2), and u are quadratic in the cell of every node; u_P
    is the mean of the piece's nodes, with rows ``centers`` (k, N).
    """
    model, pieces = body.model, body.pieces
    cloud, labels, count = model.cloud, pieces.labels, len(model.cloud.points)
    node, points, area, _ = cell_quadrature(cloud.points, cloud.triangles)
    own = node[:, 0]
    x, y = (points - cloud.points[own]).T
    monomials = np.stack([np.ones(len(x)), x, y, 0.5 * x**2, x * y, 0.5 * y**2])
    fitted = model.stencils.derivatives(force)
    pull = area[:, None] * np.einsum("kg,gkc->gc", monomials, fitted[own])
    moments = np.array([[np.bincount(own, one * b, count) for one in monomials] for b in pull.T])
    entry = np.repeat(np.arange(count), np.diff(model.stencils.indptr))
    weights = model.stencils.weights
    on_x, on_y = ((weights * moments[axis].T[entry]).sum(axis=1) for axis in (1, 0))
    rows = pair_rows(model.stencils, np.stack([on_x, -on_y], axis=1))
    added = sparse.csr_array((np.ones(count), (labels, np.arange(count))), shape=(pieces.count, count))
    whole = np.stack([np.bincount(labels, moments[axis, 0], pieces.count) for axis in (0, 1)])
    means = centers.tocoo()
    piece, nodal = means.coords
    columns = np.concatenate([2 * nodal, 2 * nodal + 1])
    values = np.concatenate([whole[1, piece] * means.data, -whole[0, piece] * means.data])
    mean = sparse.csr_array((values, (np.tile(piece, 2), columns)), shape=(pieces.count, model.unknowns))
    return sparse.csr_array(sparse.diags_array(1.0 / pieces.size) @ (added @ rows - mean))
