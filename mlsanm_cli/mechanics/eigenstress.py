"""Eigenstresses of a body, C e of eigenstrains e, and their right-hand sides.

Stresses are sigma = C e(u) - s. C e(u), which the rows represent, therefore balances div s inside and s n on
free surfaces, and faces of pieces transmit s n. Plastic strains are nodal: s (3n,), xx of all nodes, yy, xy.
Thermal strains a T are those of a temperature field. Equation (32) of docs/method.md."""

from __future__ import annotations

from functools import partial
from typing import Protocol

import numpy as np
import scipy.sparse as sparse

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.mechanics.body import ElasticBody
from mlsanm_cli.mechanics.body_model import BodyModel
from mlsanm_cli.mechanics.elasticity import divergence_rows
from mlsanm_cli.mechanics.pieces import StressAround, rule_of
from mlsanm_cli.mechanics.supports import FREE
from mlsanm_cli.operators.stencil_weights import scalar_rows
from mlsanm_cli.operators.stencils import build_stencils
from mlsanm_cli.records import dataclass


def eigenstress_loads(body: ElasticBody) -> sparse.csr_array:
    """Right-hand sides (r, 3n) of a body per nodal eigenstress."""
    model, nodes = body.model, len(body.model.cloud.points)
    blocks = [divergence_rows(model.stencils, axis) for axis in (0, 1)]
    for name, surface in model.cloud.surfaces.items():
        count = len(surface.index)
        for axis in (0, 1):
            own = np.zeros(count) if body.held.get(name, FREE)[axis] else np.ones(count)
            x, y = (
                sparse.csr_array((own * part, (np.arange(count), surface.index)), shape=(count, nodes))
                for part in surface.normal.T
            )
            empty = sparse.csr_array((count, nodes))
            blocks.append(sparse.hstack([empty, y, x] if axis else [x, empty, y], format="csr"))
    rest = 3 * body.pieces.count
    found = sparse.csr_array(sparse.vstack(blocks, format="csr"))
    single = sparse.csr_array((body.rows - rest - found.shape[0], 3 * nodes))
    nodal = sparse.csr_array(sparse.vstack([found, single], format="csr"))
    fluxes = body.pieces.fluxes(partial(fitted_around, model), body.restrained, rule_of(model))
    fluxes = fluxes - body.loads[:, : body.rows - rest] @ nodal
    return sparse.csr_array(sparse.vstack([nodal, fluxes], format="csr"))


def fitted_around(model: BodyModel, centers: FloatArray, points: FloatArray) -> sparse.csr_array:
    """Rows (3 e t, 3n) of a nodal stress at points, like :meth:`BodyModel.stress_around`."""
    cloud = model.cloud
    whole = build_stencils(
        cloud.points, cloud.tree, points, 0, model.settings, cloud.sight, tips=model.tips, centers=centers
    )
    stencils = whole.of_each(points.shape[1])
    fitted = scalar_rows(stencils, np.ascontiguousarray(stencils.weights[:, 0]))
    return sparse.csr_array(sparse.block_diag([fitted] * 3, format="csr"))


class Field(Protocol):
    """A scalar field over a body."""

    def at(self, points: FloatArray) -> FloatArray:
        """Values (e,) at ``points`` (e, 2) of the body."""


@dataclass(frozen=True)
class Heating:
    """Temperature change of a body at factor 1: a ``field``, and its ``values`` (n,) at the nodes."""

    number: int
    body: str
    field: Field
    values: FloatArray

    def source(self, body: ElasticBody) -> FloatArray:
        """Right-hand side (r,) of its ``body``."""
        stress = self.values[:, None] * body.model.material.stress_of_expansion
        return body.stress_source(stress, body.model.stress_divergence(stress), self._blocked(body))

    def reaction(self, body: ElasticBody, surface: str, center: tuple[float, float]) -> FloatArray:
        """Force and moment about ``center`` (3,) of a held surface due to thermal expansion, to subtract."""
        return np.asarray(body.reaction(surface, center, self._blocked(body)))

    def _blocked(self, body: ElasticBody) -> StressAround:
        """Minus the stress of a body prevented from expanding."""
        even = body.model.material.stress_of_expansion
        return lambda _, points: np.outer(even, self.field.at(points.reshape(-1, 2))).ravel()
