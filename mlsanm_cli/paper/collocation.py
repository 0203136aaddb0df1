"""The strong form by collocation with as many equations as unknowns."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sparse

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.mechanics.assembly import node_rows
from mlsanm_cli.mechanics.body import ElasticBody
from mlsanm_cli.mechanics.springs import FREE, NO_SPRING
from mlsanm_cli.operators.system import Equations
from mlsanm_cli.records import dataclass

SINGLE, HELD, TRACTION, EQUILIBRIUM = range(4)


@dataclass(frozen=True, eq=False)
class Collocation:
    """Equations ``matrix`` (2N, 2N) u = ``choice`` (2N, r) times the right-hand sides of a body's rows."""

    matrix: sparse.csr_array
    choice: sparse.csr_array

    @classmethod
    def of(cls, body: ElasticBody) -> Collocation:
        """For every unknown the row with the highest rank at its node: a displacement, else a traction, else
        equilibrium. At free corners both tractions are added: separately they would impose the shear stress
        twice. Scales: displacement 1, traction h/E, equilibrium h^2/E."""
        rows, h, modulus = node_rows(body), body.model.cloud.spacing, body.model.material.modulus
        nodes, inside = np.arange(len(h)), np.full(len(h), EQUILIBRIUM)
        parts = [(2 * nodes + axis, inside, h**2 / modulus) for axis in (0, 1)]
        for name, surface in body.model.cloud.surfaces.items():
            for axis in (0, 1):
                index, held = surface.index, body.held.get(name, FREE)[axis]
                stiffness = modulus + body.springs.get(name, NO_SPRING)[axis] * h[index]
                scale = np.ones(len(index)) if held else h[index] / stiffness
                parts.append((2 * index + axis, np.full(len(index), HELD if held else TRACTION), scale))
        single = np.array([2 * node + axis for node, axis in body.held_nodes], dtype=np.int64)
        parts.append((single, np.full(len(single), SINGLE), np.ones(len(single))))
        unknown, rank, scale = (np.concatenate(column) for column in zip(*parts, strict=True))
        highest = np.full(2 * len(h), EQUILIBRIUM)
        np.minimum.at(highest, unknown, rank)
        row = np.flatnonzero(rank == highest[unknown])
        choice = sparse.csr_array((scale[row], (unknown[row], row)), shape=(2 * len(h), body.rows))
        return cls(sparse.csr_array(choice[:, : rows.shape[0]] @ rows), choice)

    def equations(self, sources: sparse.csc_array) -> Equations:
        """The equations for right-hand sides ``sources`` (r, c) of the rows."""
        return Equations(self.matrix, sparse.csr_array(self.choice @ sources), definite=False)

    def residual_vector(self, source: FloatArray, solution: FloatArray) -> FloatArray:
        """Left-hand side minus right-hand side (2N,)."""
        return np.asarray(self.matrix @ solution - self.choice @ source)
