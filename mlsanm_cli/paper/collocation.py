"""The strong form by collocation with as many equations as unknowns.

Equilibrium inside a body, one boundary condition per component on its boundary. At a corner a component held by
one of the surfaces stays held, otherwise both tractions are added: separately they would impose the shear stress
twice. Scales: equilibrium h^2/E, traction h/E, displacement 1.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sparse

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.mechanics.assembly import node_rows
from mlsanm_cli.mechanics.body import ElasticBody
from mlsanm_cli.mechanics.springs import FREE, NO_SPRING
from mlsanm_cli.operators.system import Equations


@dataclass(frozen=True, eq=False)
class Collocation:
    """Equations ``matrix`` (2N, 2N) u = ``choice`` (2N, r) times the right-hand sides of a body's rows."""

    matrix: sparse.csr_array
    choice: sparse.csr_array

    @classmethod
    def of(cls, body: ElasticBody) -> Collocation:
        """Choose among the rows of a body, in the order of its unknowns."""
        cloud, modulus = body.model.cloud, body.model.material.modulus
        count, rows = len(cloud.points), node_rows(body.model, body.held, body.held_nodes, body.springs)
        inside = np.setdiff1d(np.arange(count), cloud.boundary_nodes)
        parts = []
        for component in (0, 1):
            alone = np.array([node for node, along in body.held_nodes if along == component], dtype=np.int64)
            taken = np.isin(np.arange(count), alone)
            free = inside[~taken[inside]]
            parts.append((2 * free + component, component * count + free, cloud.spacing[free] ** 2 / modulus))
            # Held surfaces first: at a corner the held component replaces the other surface's traction.
            for name in sorted(cloud.surfaces, key=lambda one: not body.held.get(one, FREE)[component]):
                index, holds = cloud.surfaces[name].index, body.held.get(name, FREE)[component]
                own = np.flatnonzero(~taken[index])
                node = index[own]
                taken[node] |= holds
                spring = body.springs.get(name, NO_SPRING)[component] * cloud.spacing[node]
                scale = np.ones(len(node)) if holds else cloud.spacing[node] / (modulus + spring)
                parts.append((2 * node + component, body.condition_rows(name, component)[own], scale))
        single = np.array([2 * node + component for node, component in body.held_nodes], dtype=np.int64)
        parts.append((single, rows.shape[0] - len(single) + np.arange(len(single)), np.ones(len(single))))
        equation, row, factor = (np.concatenate(column) for column in zip(*parts, strict=True))
        choice = sparse.csr_array((factor, (equation, row)), shape=(2 * count, body.rows))
        return cls(sparse.csr_array(choice[:, : rows.shape[0]] @ rows), choice)

    def equations(self, sources: sparse.csc_array) -> Equations:
        """The equations for right-hand sides ``sources`` (r, c) of the rows."""
        return Equations(self.matrix, sparse.csr_array(self.choice @ sources), definite=False)

    def residual_vector(self, source: FloatArray, solution: FloatArray) -> FloatArray:
        """Left-hand side minus right-hand side (2N,)."""
        return np.asarray(self.matrix @ solution - self.choice @ source)
