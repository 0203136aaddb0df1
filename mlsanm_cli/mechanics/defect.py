"""How well a body's displacements meet equations one degree better than those they were found from.

Defect correction (Stetter 1978, doi:10.1007/BF01432879): local fits of degree p + 1 to the nodal
displacements u see what those of degree p leave out. With M the rows of degree p and M+ those of degree
p + 1, solving the factorised system for the right-hand side (M - M+) u gives about minus the error of u.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import scipy.sparse as sparse

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.errors import NumericalError
from mlsanm_cli.mechanics.body import ElasticBody
from mlsanm_cli.mechanics.elasticity import XX, XY, YY
from mlsanm_cli.operators.rows import scalar_rows
from mlsanm_cli.operators.stencils import Stencils, build_stencils

DEGREES = (2, 3, 4)
"""Degrees whose errors were measured to be told. At degree 1 the estimate was up to 300 times too large, from
5 on up to 10 times."""


@dataclass(frozen=True)
class Defect:
    """``source`` (r,) in the units of the body's rows, ``stress`` (n, 3) of the better fits less its own."""

    source: FloatArray
    stress: FloatArray

    def correction(self, body: ElasticBody) -> FloatArray:
        """What is to be added to the displacements (2n,); two digits matter, so no correction step."""
        return body.system.solve(sparse.csc_array(self.source[:, None]), corrections=0)[:, 0]


def defect_of(body: ElasticBody, displacement: FloatArray) -> Defect:
    """The defect of nodal ``displacement`` (n, 2).

    Raises NumericalError for a degree outside DEGREES, and where the cloud cannot carry the next degree.
    """
    model = body.model
    if model.settings.degree not in DEGREES:
        raise NumericalError(f"no error estimate is known for degree {model.settings.degree}")
    points = model.cloud.points
    # The next degree's own number of neighbours, whatever was chosen for this one.
    better = replace(model.settings, degree=model.settings.degree + 1, neighbors=None)
    stencils = build_stencils(points, model.tree, points, 2, better)
    c = model.material.stiffness
    old_stress, old_force = _fields(model.stencils, c, displacement)
    new_stress, new_force = _fields(stencils, c, displacement)
    stress, force = new_stress - old_stress, new_force - old_force
    source = np.zeros(body.rows)
    source[: 2 * len(points)] = -force.T.ravel()
    for name, surface in model.cloud.surfaces.items():
        xx, yy, xy = stress[surface.index].T
        x, y = surface.normal.T
        traction = np.stack([xx * x + xy * y, xy * x + yy * y], axis=1)
        source += body.source(name, -traction, held=False)
    return Defect(source, stress)


def _fields(stencils: Stencils, c: FloatArray, displacement: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Stress (n, 3) and its divergence (n, 2)."""
    x, y, xx, xy, yy = (scalar_rows(stencils, stencils.weights[:, k]) @ displacement for k in range(1, 6))
    stress = _stress(c, x, y)
    along_x, along_y = _stress(c, xx, xy), _stress(c, xy, yy)
    force = np.stack([along_x[:, XX] + along_y[:, XY], along_x[:, XY] + along_y[:, YY]], axis=1)
    return stress, force


def _stress(c: FloatArray, d_x: FloatArray, d_y: FloatArray) -> FloatArray:
    """Stress (n, 3) from the derivatives (n, 2) of the displacements, or its derivative from theirs."""
    strain = np.stack([d_x[:, 0], d_y[:, 1], d_y[:, 0] + d_x[:, 1]], axis=1)
    result: FloatArray = strain @ c.T
    return result
