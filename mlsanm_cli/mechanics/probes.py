"""Points of bodies at which displacement and stress are observed."""

from __future__ import annotations

from dataclasses import dataclass

import scipy.sparse as sparse

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.mechanics.body import BodyModel
from mlsanm_cli.mechanics.elasticity import XX, XY, YY, stress_rows, value_rows
from mlsanm_cli.mechanics.material import PlaneMaterial
from mlsanm_cli.operators.stencils import Stencils, build_stencils

ROWS = 5
"""Two displacements and three stresses."""


@dataclass(frozen=True)
class Probe:
    """A named point (1, 2) of a body, in the reference configuration."""

    name: str
    body: str
    point: FloatArray


def probe_rows(model: BodyModel, points: FloatArray) -> sparse.csr_array:
    """Rows (5e, 2N) of u_x, u_y, sigma_xx, sigma_yy, sigma_xy at ``points`` (e, 2), quantity by quantity.

    Values and derivatives of the local polynomial at the point itself, as at nodes.
    """
    stencils = build_stencils(
        model.nodes, model.tree, points, 1, model.settings, model.cloud.sight, tips=model.tips
    )
    return point_rows(stencils, model.material.stiffness)


def point_rows(stencils: Stencils, stiffness: FloatArray) -> sparse.csr_array:
    """The same rows at the points of ``stencils``."""
    blocks = [value_rows(stencils, component) for component in (0, 1)]
    blocks += [stress_rows(stencils, stiffness, part) for part in (XX, YY, XY)]
    return sparse.csr_array(sparse.vstack(blocks, format="csr"))


def stress_of_expansion(material: PlaneMaterial) -> FloatArray:
    """What of the stress (3,) that displacements give is free expansion by one degree, and so none."""
    result: FloatArray = material.stiffness @ material.expansion
    return result
