"""Functionals of a body's displacements: gaps, slips, and reactions of held surfaces."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sparse

from mlsanm_cli.arrays import FloatArray, IntArray
from mlsanm_cli.cloud.membership import cross
from mlsanm_cli.contact.geometry.contact_grid import ContactGrid
from mlsanm_cli.contact.geometry.pairing import Pairing
from mlsanm_cli.contact.response.smoothing import folded_smoothing, smoothing
from mlsanm_cli.mechanics.body import ElasticBody
from mlsanm_cli.mechanics.near_field import Isotropic, as_real
from mlsanm_cli.operators.rows import nodal_pairs, nodal_rows


def candidate_rows(body: ElasticBody, name: str, pairing: Pairing) -> list[sparse.csr_array]:
    """Contribution of body ``name`` to the changes of gaps, and to slips (m, 2N), at a contact's candidates
    by its displacements."""
    if pairing.grid is None:
        at = np.flatnonzero(pairing.candidate)
        return [relative_rows(body, name, pairing, one, at) for one in (pairing.normal, pairing.tangent)]
    samples = sampled_rows(body, name, pairing)
    return [sparse.csr_array(mean @ samples) for mean in pairing.grid.means]


def sampled_rows(body: ElasticBody, name: str, pairing: Pairing, lost: bool = False) -> sparse.csr_array:
    """Contribution (2k, 2N) of body ``name`` to the motions x, then y, of the slave relative to the master at
    a contact grid's samples, or what is ``lost`` of it by smoothing."""
    assert pairing.grid is not None
    total = sparse.csr_array((2 * pairing.grid.count, body.model.unknowns))
    for own, slave, sign in pairing.sides:
        if own == name:
            total = sparse.csr_array(total + sign * _moved(body, pairing.grid, slave, lost))
    return total


def changes(
    body: ElasticBody, name: str, pairing: Pairing, displacement: FloatArray, lost: bool = False
) -> tuple[FloatArray, FloatArray]:
    """Changes of a contact's gaps and slips (m,) at its candidates by the ``displacement`` (N, 2) of body
    ``name``, or what is ``lost`` of them by smoothing."""
    moved = displacement.ravel()
    if pairing.grid is not None:
        normal, tangent = pairing.grid.means
        samples = sampled_rows(body, name, pairing, lost) @ moved
        return normal @ samples, tangent @ samples
    gap, slip = candidate_rows(body, name, pairing)
    return (0.0 if lost else 1.0) * (gap @ moved), (0.0 if lost else 1.0) * (slip @ moved)


def _moved(body: ElasticBody, grid: ContactGrid, slave: bool, lost: bool) -> sparse.csr_array:
    """Displacements x and y (2k, 2N) of a body at the samples of a contact grid, or what is ``lost`` of them
    by smoothing: in isotropic bodies away from corners. Remainders are less smooth at corners, and in
    orthotropic bodies."""
    points, cloud, fitted = as_real(grid.facing.side(grid.samples, slave)[0]), body.model.cloud, None
    if isinstance(body.model.kernel, Isotropic) and not grid.corners_of(slave):
        finest = float(cloud.spacing[cloud.tree.query(points)[1]].min())
        if grid.mirrored:
            fitted = folded_smoothing(grid, finest)
        else:
            both = smoothing(points, grid.last - grid.first, finest, grid.hats.period is not None)
            fitted = None if both is None else (both, both)
    if lost and fitted is None:
        return sparse.csr_array((2 * grid.count, 2 * len(body.model.cloud.points)))
    along = [body.model.values_along(points, axis) for axis in grid.axes]
    if fitted is not None:
        taken = [np.eye(grid.count) - one if lost else one for one in fitted]
        along = [sparse.csr_array(one @ rows) for one, rows in zip(taken, along, strict=True)]
    if grid.mirrored:
        back = [[sparse.diags_array(axis[:, c]) for axis in grid.axes] for c in (0, 1)]
        along = [sparse.csr_array(a @ along[0] + b @ along[1]) for a, b in back]
    return sparse.csr_array(sparse.vstack(along, format="csr"))


def relative_rows(
    body: ElasticBody, name: str, pairing: Pairing, direction: FloatArray, at: IntArray | None = None
) -> sparse.csr_array:
    """Motion (w, 2N) of the slave relative to the master along ``direction`` (w, 2), at all points or those
    of indices ``at``. The slave moves with its node, the master by its moving least-squares value at the
    closest point."""
    at = np.arange(len(pairing.position)) if at is None else at
    nodes = len(body.model.cloud.points)
    block = sparse.csr_array((len(at), 2 * nodes))
    if not len(at):
        return block
    if pairing.slave_body == name:
        block = block + nodal_pairs(pairing.node[at], direction[at], nodes)
    if pairing.master_body == name:
        block = block - body.model.values_along(pairing.partner[at], direction[at])
    return sparse.csr_array(block)


def spring_rows(body: ElasticBody, surface_name: str) -> sparse.csr_array:
    """Force x, y and moment about the origin (3, 2N) of the soft springs along a surface on their body."""
    index, nodes = body.model.cloud.surfaces[surface_name].index, len(body.model.cloud.points)
    total = sparse.csr_array((3, 2 * nodes))
    for component, spring in enumerate(body.soft_springs[surface_name]):
        along = body.resultants()[:, body.condition_rows(surface_name, component)]
        total = total - spring * (along @ nodal_rows(index, component, nodes))
    return sparse.csr_array(total)


def resultant(forces: FloatArray, points: FloatArray, center: tuple[float, float]) -> FloatArray:
    """Force x, y and moment about ``center`` (3, ...) of ``forces`` (b, 2) at ``points`` (b, 2)."""
    arm = points - np.array(center)
    return np.stack([forces[:, 0], forces[:, 1], cross(arm, forces)])
