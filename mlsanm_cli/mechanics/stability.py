"""Coercivity estimate of one body's discrete equations, for scenes without contact."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sparse

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.mechanics.body import ElasticBody
from mlsanm_cli.roundoff import COARSE_ROUND_OFF

ITERATIONS = 8


def bulk_stability(body: ElasticBody) -> float:
    """Smallest singular value of the equations, normalised by the response to smooth loads.

    With S the scaled equations and displacements measured by |u|^2 = sum h^2 u_i^2 over the cloud's points::

        sigma = min |S u| / |u|        stability = sigma max_b |u_b| / |S b|        0 < stability

    b are linearly varying body forces and u_b their displacements without free rigid parts. In a sound
    discretisation hardly any residual causes more displacement than these. The rows of pieces count in S u
    but not in S b. sigma is computed by a few steps of subspace iteration with the available factor (Golub
    and Van Loan, Matrix Computations, section 8.2) from a fixed start.
    """
    model, system = body.model, body.system
    measure = np.repeat(model.cloud.spacing, 2)[:, None]
    rigid = np.linalg.qr(measure * body.free.patterns(model.cloud.points))[0]

    def deforming(displacements: FloatArray) -> FloatArray:
        """Displacements, one column each, in the measure and without their free rigid part."""
        measured = measure * displacements
        return measured - rigid @ (rigid.T @ measured)

    # Body forces in x and in y: uniform, linear in x, and linear in y.
    points = model.cloud.points
    middle, extent = points.mean(axis=0), np.ptp(points, axis=0).max()
    shapes = np.column_stack([np.ones(len(points)), (points - middle) / extent])
    forces = [body.force_source(np.outer(shape, axis)) for axis in np.eye(2) for shape in shapes.T]
    loads = sparse.csc_array(np.stack(forces, axis=1))
    response = deforming(system.solve(loads))
    scaled = system.scaled(loads, strong=False)
    # Discard loads that vanish or coincide on a few nodes.
    _, sizes, turned = np.linalg.svd(scaled, full_matrices=False)
    kept = sizes > COARSE_ROUND_OFF * sizes[0]
    smooth = np.linalg.norm(response @ turned[kept].T / sizes[kept], 2) ** 2
    rough = np.random.default_rng(0).normal(size=(len(measure), 2))
    space: FloatArray = np.concatenate([response, rough], axis=1)
    for _ in range(ITERATIONS):
        space = np.linalg.qr(space)[0]
        image = deforming(system.inverse_normal(measure * space))
        largest = np.linalg.eigvalsh(0.5 * (space.T @ image + image.T @ space))[-1]
        space = image
    return float(np.sqrt(smooth / largest))
