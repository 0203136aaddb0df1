"""Stability certificate of one body's discrete equations, for scenes without contact to certify them."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sparse

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.mechanics.body import ElasticBody
from mlsanm_cli.mechanics.body_model import BodyModel

ITERATIONS = 8
MIN_RESIDUAL = 1e-6
"""Loads whose residual in the equations is smaller than this part of the largest are ignored."""


def bulk_stability(body: ElasticBody) -> float:
    """Smallest singular value of the equations, made free of units by the response to smooth loads.

    With S the scaled equations and displacements measured by |u|^2 = sum h^2 u_i^2 over the cloud's points::

        sigma = min |S u| / |u|        stability = sigma max_b |u_b| / |S b|        0 < stability

    b are the body forces that vary linearly over the body, and u_b their displacements. A sound
    discretisation answers to nothing much more than to such loads; one that answers to some rough residual a
    hundred times as strongly amplifies its own discretisation error in the same way. The rows of pieces,
    thousands of times as strong, count in S u but not in S b. sigma comes from a few steps of subspace
    iteration with the factor at hand (Golub and Van Loan, Matrix Computations, section 8.2); their start is
    fixed.
    """
    model, system = body.model, body.system
    count = len(model.cloud.points)
    # Ghosts carry no displacement of the body.
    measure = np.zeros((model.unknowns, 1))
    measure[: 2 * count, 0] = np.repeat(model.cloud.spacing, 2)
    forces = [body.force_source(force) for force in _linear_forces(model)]
    loads = sparse.csc_array(np.stack(forces, axis=1))
    response = measure * system.solve(loads)
    scaled = system.scaled(loads, strong=False)
    # Loads that leave no trace in the equations, or the same as others on a few nodes, bring no response.
    _, sizes, turned = np.linalg.svd(scaled, full_matrices=False)
    kept = sizes > MIN_RESIDUAL * sizes[0]
    smooth = np.linalg.norm(response @ turned[kept].T / sizes[kept], 2) ** 2
    rough = np.random.default_rng(0).normal(size=(len(measure), 2))
    space: FloatArray = np.concatenate([response, rough], axis=1)
    for _ in range(ITERATIONS):
        space = np.linalg.qr(space)[0]
        image = measure * system.inverse_normal(measure * space)
        largest = np.linalg.eigvalsh(0.5 * (space.T @ image + image.T @ space))[-1]
        space = image
    return float(np.sqrt(smooth / largest))


def _linear_forces(model: BodyModel) -> list[FloatArray]:
    """Body forces (n, 2): in x and in y, each uniform, linear in x and linear in y."""
    points = model.cloud.points
    middle, extent = points.mean(axis=0), np.ptp(points, axis=0).max()
    shapes = np.column_stack([np.ones(len(points)), (points - middle) / extent])
    return [np.outer(shape, axis) for axis in np.eye(2) for shape in shapes.T]
