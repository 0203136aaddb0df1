"""One elastic body: its least-squares system, and the right-hand sides and functionals others work with.

Rows, in this order: equilibrium in x and y at every node, boundary nodes included; then, surface by surface,
the x and y conditions at each of its nodes, a displacement where the component is held and a traction where
it is not; then single held nodes. A corner node has the rows of both its surfaces. Weights: equilibrium h/E,
traction 1/E, displacement ``HOLD``/h, which makes all rows strains; they are lowered towards singular
corners, notches and holes.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sparse
from scipy.spatial import cKDTree

from mlsanm_cli.arrays import FloatArray, IntArray
from mlsanm_cli.cloud.cloud import Cloud, Surface
from mlsanm_cli.cloud.quality import closest_node
from mlsanm_cli.errors import NumericalError
from mlsanm_cli.mechanics.corners import corner_weight, inward_weight
from mlsanm_cli.mechanics.elasticity import (
    XX,
    XY,
    YY,
    equilibrium_rows,
    stress_rows,
    traction_rows,
    value_rows,
    von_mises,
)
from mlsanm_cli.mechanics.material import PlaneMaterial
from mlsanm_cli.operators.least_squares import LeastSquares, factorise
from mlsanm_cli.operators.linear.interface import DirectSolver
from mlsanm_cli.operators.rows import nodal_rows
from mlsanm_cli.operators.settings import MlsSettings
from mlsanm_cli.operators.stencils import Stencils, build_stencils

COINCIDENT = 0.02
"""Nodes closer than this part of the spacing are refused: only their difference tells them apart.

Measured with an extra node beside another one, degrees 2, 4 and 6: at 0.03 the error is the same as without
it, at 0.01 fourteen times larger for degree 6, at 0.003 ten times for degree 2, then soon beyond all bounds.
"""

HOLD = 5.0
"""Weight of held displacements, measured: between 3 and 10 the bulk error no longer depends on it."""


@dataclass(frozen=True)
class BodyModel:
    """Cloud, material and operators of one body, before any boundary condition is chosen."""

    name: str
    cloud: Cloud
    material: PlaneMaterial
    settings: MlsSettings
    tree: cKDTree
    stencils: Stencils

    @classmethod
    def build(cls, name: str, cloud: Cloud, material: PlaneMaterial, settings: MlsSettings) -> BodyModel:
        """Stencils with second derivatives at every node.

        Raises NumericalError where two nodes are too close, or a part too thin for the degree.
        """
        _refuse_coincident(name, cloud)
        tree = cKDTree(cloud.points)
        return cls(
            name,
            cloud,
            material,
            settings,
            tree,
            build_stencils(cloud.points, tree, cloud.points, 2, settings, cloud.sight),
        )

    def values_at(self, points: FloatArray) -> tuple[sparse.csr_array, sparse.csr_array]:
        """Rows (e, 2n) of u_x and u_y at any ``points`` (e, 2) of the body."""
        stencils = build_stencils(self.cloud.points, self.tree, points, 0, self.settings, self.cloud.sight)
        return value_rows(stencils, 0), value_rows(stencils, 1)

    def surface_traction(self, surface: Surface, component: int) -> sparse.csr_array:
        """Rows (b, 2n) of sigma n in x (0) or y (1) at a surface's nodes."""
        stencils = self.stencils.take(surface.index)
        return traction_rows(stencils, self.material.stiffness, surface.normal, component)

    def stress(self, displacement: FloatArray) -> FloatArray:
        """Stress (n, 3) in the order xx, yy, xy for nodal ``displacement`` (n, 2)."""
        flat = displacement.ravel()
        c = self.material.stiffness
        return np.stack([stress_rows(self.stencils, c, a) @ flat for a in (XX, YY, XY)], axis=1)

    def von_mises(self, stress: FloatArray) -> FloatArray:
        """Von Mises stress (n,)."""
        return von_mises(stress, self.material.out_of_plane)


def _refuse_coincident(name: str, cloud: Cloud) -> None:
    node, distance = closest_node(cloud)
    if distance < COINCIDENT:
        x, y = cloud.points[node]
        raise NumericalError(
            f"body {name}: two nodes near ({x:.6g}, {y:.6g}) are only {distance:.2g} of the spacing apart",
            "make the spacing smaller there, or leave out the short side, small arc or sharp tip",
        )


@dataclass(frozen=True)
class ElasticBody:
    """A body with its conditions chosen and its system factorised.

    ``first_row[surface]`` is where the surface's rows begin: x for its b nodes, then y for its b nodes.
    ``held[surface]`` says for x and y whether these rows hold a displacement.
    """

    model: BodyModel
    held: Mapping[str, tuple[bool, bool]]
    first_row: Mapping[str, int]
    system: LeastSquares

    @property
    def rows(self) -> int:
        """Number of rows of the least-squares system."""
        return len(self.system.weight)

    def condition_rows(self, surface: str, component: int) -> IntArray:
        """Row numbers (b,) of a surface's conditions in x (0) or y (1)."""
        count = len(self.model.cloud.surfaces[surface].index)
        first = self.first_row[surface] + component * count
        return np.arange(first, first + count, dtype=np.int64)

    def source(self, surface: str, values: FloatArray, held: bool) -> FloatArray:
        """Right-hand side (r,) that prescribes ``values`` (b, 2) on a surface.

        They go into the components that hold a displacement if ``held``, else into those that take a
        traction.
        """
        source = np.zeros(self.rows)
        for component in (0, 1):
            if self.held.get(surface, (False, False))[component] == held:
                source[self.condition_rows(surface, component)] = values[:, component]
        return source


def assemble(
    model: BodyModel,
    held: Mapping[str, tuple[bool, bool]],
    held_nodes: Sequence[tuple[int, int]],
    solver: DirectSolver,
) -> ElasticBody:
    """Choose the conditions of every surface, set up the rows and factorise.

    ``held`` names the surfaces with held components, ``held_nodes`` are (node, component) pairs held at zero.
    """
    cloud, c = model.cloud, model.material.stiffness
    scale = float(c[XX, XX])
    nested = model.settings.degree == 1
    blocks = [equilibrium_rows(model.stencils, c, component, nested) for component in (0, 1)]
    factor = corner_weight(cloud, held) * inward_weight(cloud)
    weights = [factor * cloud.spacing / scale] * 2
    first_row = {}
    count = 2 * len(cloud.points)
    for name, surface in cloud.surfaces.items():
        first_row[name] = count
        stencils = model.stencils.take(surface.index)
        for component in (0, 1):
            if held.get(name, (False, False))[component]:
                blocks.append(nodal_rows(surface.index, component, len(cloud.points)))
                weights.append(HOLD / cloud.spacing[surface.index])
            else:
                blocks.append(traction_rows(stencils, c, surface.normal, component))
                # A node at the end of a surface stands for half a spacing of it.
                share = np.sqrt(surface.weight / cloud.spacing[surface.index])
                weights.append(factor[surface.index] * share / scale)
        count += 2 * len(surface.index)
    for node, component in held_nodes:
        at = np.array([node], dtype=np.int64)
        blocks.append(nodal_rows(at, component, len(cloud.points)))
        weights.append(HOLD / cloud.spacing[at])
    rows = sparse.csr_array(sparse.vstack(blocks, format="csr"))
    system = factorise(rows, np.concatenate(weights), cloud.points, solver)
    return ElasticBody(model, held, first_row, system)
