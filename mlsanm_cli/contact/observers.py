"""Functionals of a body's displacements: gaps, slips, and forces of held surfaces."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sparse

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.cloud.cloud import Cloud
from mlsanm_cli.contact.pairing import Pairing
from mlsanm_cli.mechanics.body import ElasticBody
from mlsanm_cli.mechanics.elasticity import XY, stress_rows, traction_rows
from mlsanm_cli.operators.rows import nodal_pairs, nodal_rows

BAND = 0.75


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


def cut_off(body: ElasticBody, surface_name: str) -> FloatArray:
    """A nodal function phi (n,): 1 on the surface, 0 beyond BAND of the largest distance from it."""
    cloud = body.model.cloud
    curve = cloud.surfaces[surface_name].curve
    away = cloud.points - curve.points(curve.closest(cloud.points))
    distance = np.hypot(away[:, 0], away[:, 1])
    phi: FloatArray = np.maximum(0.0, 1.0 - distance / (BAND * distance.max()))
    return phi


def reaction_rows(body: ElasticBody, surface_name: str, center: tuple[float, float]) -> sparse.csr_array:
    """Force x, y and moment about ``center`` (3, 2n) of a held surface on its body.

    Over the components that the surface holds, and up to the prescribed tractions t where phi is not zero::

        int_surface sigma n = int_body sigma grad phi - int_others phi sigma n - int_others phi t

    The stress is thus taken where it flows through the body and not at the surface itself, whose corners make
    it useless. Triangles of the nodes serve for the integral, so that a uniform stress balances to round-off.
    """
    cloud = body.model.cloud
    phi = cut_off(body, surface_name)
    gradient = _integrated_gradient(cloud, phi)
    total = _weighted_stress(body, gradient, body.gripped[surface_name], center)
    if body.gripped[surface_name] in ((True, False), (False, True)):
        total = total + _shear_moment(body, phi, -1.0 if body.gripped[surface_name][0] else 1.0)
    for name, surface in cloud.surfaces.items():
        if name == surface_name or not any(body.gripped.get(name, (False, False))):
            continue
        held = [
            own and other for own, other in zip(body.gripped[surface_name], body.gripped[name], strict=True)
        ]
        for component in (0, 1):
            if held[component]:
                share = surface.weight * phi[surface.index]
                unit = np.zeros((len(share), 2))
                unit[:, component] = share
                weights = sparse.csr_array(resultant(unit, cloud.points[surface.index], center))
                total = total - weights @ body.model.surface_traction(surface, component)
    return sparse.csr_array(total)


def spring_rows(body: ElasticBody, surface_name: str) -> sparse.csr_array:
    """Forces (2b, 2n) of the soft springs on a surface's nodes, in x and then in y."""
    surface = body.model.cloud.surfaces[surface_name]
    blocks = [
        nodal_rows(surface.index, component, len(body.model.nodes)).multiply(
            -spring * surface.weight[:, None]
        )
        for component, spring in enumerate(body.soft_springs[surface_name])
    ]
    return sparse.csr_array(sparse.vstack(blocks, format="csr"))


def _integrated_gradient(cloud: Cloud, phi: FloatArray) -> FloatArray:
    """Integral of grad phi over the triangles, shared out to the nodes (n, 2): a third of each corner's."""
    triangles = cloud.triangles
    a, b, c = (cloud.points[triangles[:, corner]] for corner in range(3))
    # The area times the gradient of the linear function on a triangle.
    opposite = np.stack([c - b, a - c, b - a], axis=1)
    normals = 0.5 * np.stack([-opposite[:, :, 1], opposite[:, :, 0]], axis=2)
    flux = (phi[triangles][:, :, None] * normals).sum(axis=1) / 3.0
    # Every corner of a triangle gets the same third.
    return np.stack(
        [np.bincount(triangles.ravel(), np.repeat(flux[:, axis], 3), len(phi)) for axis in (0, 1)], axis=1
    )


def _shear_moment(body: ElasticBody, phi: FloatArray, sign: float) -> sparse.csr_array:
    """Moment (3, 2n) of the shear stress times phi, which one component alone does not balance by itself."""
    cloud = body.model.cloud
    weights = np.zeros((3, len(phi)))
    weights[2] = sign * cloud.areas * phi
    rows = stress_rows(body.model.stencils, body.model.material.stiffness, XY)
    return sparse.csr_array(sparse.csr_array(weights) @ rows)


def _weighted_stress(
    body: ElasticBody, weight: FloatArray, held: tuple[bool, bool], center: tuple[float, float]
) -> sparse.csr_array:
    """Force and moment (3, 2n) of nodal forces sigma w in the ``held`` components, ``weight`` w (n, 2)."""
    model = body.model
    used = np.flatnonzero(np.abs(weight).sum(axis=1))
    stencils = model.stencils.take(used)
    points, w = model.cloud.points[used], weight[used]
    total = sparse.csr_array((3, model.unknowns))
    for component in (0, 1):
        if held[component]:
            unit = np.zeros_like(w)
            unit[:, component] = 1.0
            rows = traction_rows(stencils, model.material.stiffness, w, component)
            total = total + sparse.csr_array(resultant(unit, points, center)) @ rows
    return sparse.csr_array(total)


def nodal_resultant(points: FloatArray, center: tuple[float, float], factor: FloatArray) -> FloatArray:
    """Resultant (3, 2b) of forces on ``points`` (b, 2) in x and then in y, scaled by ``factor`` (b, 2)."""
    unit = np.zeros((2, *points.shape))
    unit[0, :, 0], unit[1, :, 1] = factor.T
    return np.concatenate([resultant(one, points, center) for one in unit], axis=1)


def resultant(forces: FloatArray, points: FloatArray, center: tuple[float, float]) -> FloatArray:
    """Force x, y and moment (3, ...) per unit of each of ``forces`` (b, 2) acting at ``points`` (b, 2)."""
    arm = points - np.array(center)
    return np.stack([forces[:, 0], forces[:, 1], arm[:, 0] * forces[:, 1] - arm[:, 1] * forces[:, 0]])
