"""Functionals of a body's displacements: gaps, slips, and forces of held surfaces."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sparse

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.contact.pairing import Pairing
from mlsanm_cli.mechanics.body import ElasticBody
from mlsanm_cli.operators.rows import nodal_pairs, nodal_rows


def gap_rows(body: ElasticBody, name: str, pairings: tuple[Pairing, ...]) -> sparse.csr_array:
    """A body's share (w, 2n) in the change of every paired node's gap, contact after contact."""
    return _relative_rows(body, name, pairings, [pairing.normal for pairing in pairings])


def slip_rows(body: ElasticBody, name: str, pairings: tuple[Pairing, ...]) -> sparse.csr_array:
    """A body's share (w, 2n) in every paired node's slip, contact after contact."""
    return _relative_rows(body, name, pairings, [pairing.tangent for pairing in pairings])


def _relative_rows(
    body: ElasticBody, name: str, pairings: tuple[Pairing, ...], directions: list[FloatArray]
) -> sparse.csr_array:
    """Motion of the slave relative to the master along the ``directions`` (w, 2) of every contact.

    The slave moves with its node, the master with its moving least-squares value at the virtual node.
    """
    nodes = len(body.model.nodes)
    blocks = [sparse.csr_array((0, 2 * nodes))]
    for pairing, direction in zip(pairings, directions, strict=True):
        block = sparse.csr_array((len(pairing.position), 2 * nodes))
        if pairing.slave_body == name:
            block = block + nodal_pairs(pairing.node, direction, nodes)
        if pairing.master_body == name:
            block = block - body.model.values_along(pairing.partner, direction)
        blocks.append(sparse.csr_array(block))
    return sparse.csr_array(sparse.vstack(blocks, format="csr"))


def reaction_rows(body: ElasticBody, surface_name: str, center: tuple[float, float]) -> sparse.csr_array:
    """Force x, y and moment about ``center`` (3, 2n) of a held surface on its body, over the components that
    it holds: the stress along the surface, which the equilibrium of the body's pieces keeps."""
    return body.reaction_rows(surface_name, center)


def spring_rows(body: ElasticBody, surface_name: str) -> sparse.csr_array:
    """Force x, y and moment about the origin (3, 2n) of the soft springs along a surface on their body."""
    index, nodes = body.model.cloud.surfaces[surface_name].index, len(body.model.nodes)
    total = sparse.csr_array((3, 2 * nodes))
    for component, spring in enumerate(body.soft_springs[surface_name]):
        along = body.resultants()[:, body.condition_rows(surface_name, component)]
        total = total - spring * (along @ nodal_rows(index, component, nodes))
    return sparse.csr_array(total)


def resultant(forces: FloatArray, points: FloatArray, center: tuple[float, float]) -> FloatArray:
    """Force x, y and moment (3, ...) per unit of each of ``forces`` (b, 2) acting at ``points`` (b, 2)."""
    arm = points - np.array(center)
    return np.stack([forces[:, 0], forces[:, 1], arm[:, 0] * forces[:, 1] - arm[:, 1] * forces[:, 0]])
