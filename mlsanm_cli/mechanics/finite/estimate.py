"""Residual-based error estimate of a body's energy at finite strain: residuals of equilibrium inside and of
tractions on free sides, weighted with the spacing and the uniaxial-strain modulus (Babuska and Rheinboldt
1978, doi:10.1002/nme.1620121010; Ainsworth and Oden 2000, section 2.2), relative to the integral of P :
(F - F^-T) / 2, which is twice the strain energy at small strain for any rotation. Fits of the next degree
do not reveal the error at a crushed corner: least squares makes the state smooth there. Equation (27) of
docs/method.md."""

from __future__ import annotations

import numpy as np

from mlsanm_cli.arrays import BoolArray, FloatArray
from mlsanm_cli.mechanics.energy import extended, least_thermal_energy, over_body
from mlsanm_cli.mechanics.finite.body import FiniteBody
from mlsanm_cli.mechanics.finite.body_series import BodySeries
from mlsanm_cli.mechanics.laws.law import determinant
from mlsanm_cli.roundoff import ROUND_OFF


def unaccounted(body: FiniteBody, displacement: FloatArray, factors: FloatArray) -> FloatArray:
    """Contribution of the nodes to the estimate eta (n,), per thickness, at ``displacement`` (2N,) and load
    ``factors`` (L,)."""
    elastic, model = body.elastic, body.elastic.model
    cloud, count = model.cloud, len(model.cloud.points)
    left = BodySeries.at(body, displacement, factors).rows(0)
    found = cloud.areas * cloud.spacing**2 * (left[:count] ** 2 + left[count : 2 * count] ** 2)
    for name, index, _, held in body.conditions:
        weight = cloud.surfaces[name].weight * cloud.spacing[index]
        for component in (0, 1):
            if not held[component]:
                np.add.at(found, index, weight * left[elastic.condition_rows(name, component)] ** 2)
    return np.asarray(found / model.material.modulus)


def energy(body: FiniteBody, displacement: FloatArray, factors: FloatArray) -> float:
    """Reference energy of the estimate, per thickness, in the same state."""
    gradient, degrees = body.gradient(displacement), body.degrees(factors)
    stress = body.stress(displacement, factors)
    xx, xy, yx, yy = gradient + np.array([1.0, 0.0, 0.0, 1.0])[:, None]
    turned = np.stack([yy, -yx, -xy, xx]) / (1.0 + determinant(gradient))
    least = ROUND_OFF**2 * body.elastic.model.material.modulus * body.elastic.model.cloud.areas.sum()
    if degrees is not None:
        turned = body.law.squared_free_stretch(turned, degrees)
        least = max(least, least_thermal_energy(body.elastic.model, degrees))
    strain = 0.5 * (np.stack([xx, xy, yx, yy]) - turned)
    areas = body.elastic.model.cloud.areas
    return float(areas @ (stress * strain).sum(axis=0) + least)


def missing_work(
    body: FiniteBody, displacement: FloatArray, factors: FloatArray, way: FloatArray, near: BoolArray
) -> float:
    """Virtual work of the stress at ``displacement`` (2N,) and load ``factors`` (L,) on a small displacement
    ``way`` (2N,), minus that of all forces, per thickness.

    Next to forces that the cloud does not resolve, at nodes ``near`` (n,), the displacement continues
    smoothly from elsewhere. Reactions are known as stresses next to singular corners, or not at all: a smooth
    field with the ``way`` of held parts is subtracted, so that they do no work. Equation (28) of
    docs/method.md.
    """
    elastic, moved = body.elastic, way.reshape(-1, 2)
    cloud = elastic.model.cloud
    if near.any():
        moved = extended(cloud, moved, np.repeat(~near[:, None], 2, axis=1))
    held = np.zeros(moved.shape, dtype=bool)
    for name, components in elastic.held.items():
        held[cloud.surfaces[name].index] |= np.array(components)
    for node, component in elastic.held_nodes[: len(elastic.held_nodes) - body.pins]:
        held[node, component] = True
    if moved[held].any():
        moved = moved - extended(cloud, moved, held)
    stress = body.stress(displacement, factors)
    found = over_body(cloud, stress.T, body.gradient(moved.ravel()).T)
    force = BodySeries.at(body, displacement, factors).outline_forces()[1]
    found -= float((force.T * body.applied.points.seen(moved)[:, 0]).sum())
    if body.loads.force is not None:
        found -= over_body(cloud, body.loads.force @ factors, moved)
    return found
