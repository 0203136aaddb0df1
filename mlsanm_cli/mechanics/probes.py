"""Probes: points of bodies at which displacement and stress are recorded."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import scipy.sparse as sparse

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.mechanics.body_model import BodyModel
from mlsanm_cli.mechanics.elasticity import XX, stress_rows
from mlsanm_cli.mechanics.material import PlaneMaterial
from mlsanm_cli.operators.rows import scalar_rows, vector_rows
from mlsanm_cli.operators.stencil_weights import Stencils
from mlsanm_cli.records import dataclass


@dataclass(frozen=True)
class Probe:
    """A named point (1, 2) of a body, in the reference configuration."""

    name: str
    body: str
    point: FloatArray


def probe_rows(model: BodyModel, points: FloatArray) -> sparse.csr_array:
    """Rows (5e | 6e, 2N) of u_x, u_y, sigma_xx, sigma_yy, sigma_xy and, in bodies of revolution, the hoop
    stress at ``points`` (e, 2), quantity by quantity. Value and derivatives of the local polynomial at the
    point itself, as at nodes."""
    return point_rows(model.stencils_at(points, 1), model.material, lambda: model.stencils)


def point_rows(
    stencils: Stencils, material: PlaneMaterial, nodal: Callable[[], Stencils]
) -> sparse.csr_array:
    """The same rows at the points of ``stencils``. Nearly incompressible materials interpolate a nodal field
    of mean pressure, see :meth:`BodyModel.stress`: ``nodal`` gives its stencils."""
    hidden = material.nearly_incompressible
    even = material.bulk_part if hidden else np.zeros_like(material.stiffness)
    value = stencils.weights[:, 0]
    blocks = [vector_rows(stencils, value, None), vector_rows(stencils, None, value)]
    blocks += [stress_rows(stencils, material.stiffness - even, part) for part in range(len(even))]
    if hidden:
        mean = scalar_rows(stencils, value) @ stress_rows(nodal(), even, XX)
        for part in np.flatnonzero(even.any(axis=0)):
            blocks[2 + part] = sparse.csr_array(blocks[2 + part] + mean)
    return sparse.csr_array(sparse.vstack(blocks, format="csr"))


def stress_of_expansion(material: PlaneMaterial) -> FloatArray:
    """Stress (3 | 4,) that corresponds to free thermal expansion by one degree, to be subtracted."""
    return np.asarray(material.stiffness @ material.expansion)
