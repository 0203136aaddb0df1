"""Functionals of a body's displacements: gaps, and forces of held surfaces."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sparse

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.contact.pairing import Pairing
from mlsanm_cli.mechanics.body import ElasticBody
from mlsanm_cli.operators.rows import nodal_rows


def gap_rows(body: ElasticBody, name: str, pairings: tuple[Pairing, ...]) -> sparse.csr_array:
    """A body's share (w, 2n) in the change of every paired node's gap, contact after contact.

    The slave moves with its node, the master with its moving least-squares value at the virtual node.
    """
    nodes = len(body.model.cloud.points)
    blocks = [sparse.csr_array((0, 2 * nodes))]
    for pairing in pairings:
        block = sparse.csr_array((len(pairing.position), 2 * nodes))
        n_x, n_y = pairing.normal[:, :1], pairing.normal[:, 1:]
        if pairing.slave_body == name:
            on_x, on_y = (nodal_rows(pairing.node, component, nodes) for component in (0, 1))
            block = block + on_x.multiply(n_x) + on_y.multiply(n_y)
        if pairing.master_body == name:
            on_x, on_y = body.model.values_at(pairing.partner)
            block = block - on_x.multiply(n_x) - on_y.multiply(n_y)
        blocks.append(sparse.csr_array(block))
    return sparse.csr_array(sparse.vstack(blocks, format="csr"))


def reaction_rows(body: ElasticBody, surface_name: str, center: tuple[float, float]) -> sparse.csr_array:
    """Force x, y and moment about ``center`` (3, 2n) of a held surface on its body.

    The integral of sigma n by the trapezoid rule, over the components that the surface holds.
    """
    cloud = body.model.cloud
    surface = cloud.surfaces[surface_name]
    arm = cloud.points[surface.index] - np.array(center)
    total = sparse.csr_array((3, 2 * len(cloud.points)))
    for component in (0, 1):
        if body.held[surface_name][component]:
            lever = -arm[:, 1] if component == 0 else arm[:, 0]
            weights = np.zeros((3, len(surface.index)))
            weights[component] = surface.weight
            weights[2] = surface.weight * lever
            total = total + sparse.csr_array(weights) @ body.model.surface_traction(surface, component)
    return sparse.csr_array(total)


def resultant(forces: FloatArray, points: FloatArray, center: tuple[float, float]) -> FloatArray:
    """Force x, y and moment (3, ...) per unit of each of ``forces`` (b, 2) acting at ``points`` (b, 2)."""
    arm = points - np.array(center)
    return np.stack([forces[:, 0], forces[:, 1], arm[:, 0] * forces[:, 1] - arm[:, 1] * forces[:, 0]])
