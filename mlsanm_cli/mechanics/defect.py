"""How well a body's displacements meet equations one degree better than those they were found from.

Defect correction (Stetter 1978, doi:10.1007/BF01432879): local fits of degree p + 1 to the nodal
displacements u see what those of degree p leave out. With M the rows of degree p and M+ those of degree
p + 1, solving the factorised system for the right-hand side (M - M+) u gives about minus the error of u.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import scipy.sparse as sparse

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.errors import NumericalError
from mlsanm_cli.mechanics.body import BodyModel, ElasticBody
from mlsanm_cli.mechanics.elasticity import stress_of, traction_of
from mlsanm_cli.operators.refinement import QUICK
from mlsanm_cli.operators.stencils import build_stencils
from mlsanm_cli.parts import cKDTree
from mlsanm_cli.values import dataclass

DEGREES = (2, 3, 4)
"""Degrees whose errors were measured to be told. At degree 1 the estimate was up to 300 times too large, from
5 on up to 10 times."""

ROUGH = 1e-3
"""Relative error of a correction that is left alone: an estimate has a digit or two."""
TOGETHER = 4096
"""Points whose fits are in memory together."""


@dataclass(frozen=True)
class Defect:
    """``source`` (r,) in the units of the body's rows, ``stress`` (n, 3) of the better fits less its own."""

    source: FloatArray
    stress: FloatArray

    def corrections(self, body: ElasticBody) -> FloatArray:
        """What is to be added to the displacements, (2N, 2): by the rows alone, and with their sums too.

        The sums look at long waves only and may let the rest pass, the rows alone think of long waves as the
        body without sums would: of the true error, one was down to 0.13, the other up to 4 times.
        """
        system, source = body.system, sparse.csc_array(self.source[:, None])
        found = system.both(source)
        if system.residual(source, found[:, 1:]) > ROUGH:
            found[:, 1:] = system.solve(source, QUICK)
        return found


def response(body: ElasticBody, sources: sparse.csc_array) -> FloatArray:
    """Displacements (2N, c) under ``sources`` (r, c), to ROUGH or better."""
    found = body.system.roughly(sources)
    columns = range(found.shape[1])
    if any(body.system.residual(sources[:, [c]], found[:, [c]]) > ROUGH for c in columns):
        return body.system.solve(sources, QUICK)
    return found


def defect_of(body: ElasticBody, displacement: FloatArray) -> Defect:
    """The defect of nodal ``displacement`` (N, 2).

    Raises NumericalError for a degree outside DEGREES, and where the cloud cannot carry the next degree.
    """
    model = body.model
    if model.settings.degree not in DEGREES:
        raise NumericalError(f"no error estimate is known for degree {model.settings.degree}")
    better = _NextDegree(model)
    derivatives = better.derivatives(model.nodes, displacement)
    stress = stress_of(derivatives, model.material.stiffness) - model.stress(displacement)
    source = np.zeros(body.rows)
    divergence = model.divergence_by(derivatives, better.of_stress)
    source[: 2 * len(stress)] = (model.divergence(displacement) - divergence).T.ravel()
    for name, surface in model.cloud.surfaces.items():
        traction = traction_of(stress[surface.index], surface.normal)
        source += body.source(name, -traction, held=False)
    return Defect(source, stress)


@dataclass(frozen=True)
class _NextDegree:
    """Fits one degree higher than a body's, with that degree's own number of neighbours; none is kept."""

    model: BodyModel

    def of_stress(self, stress: FloatArray) -> FloatArray:
        """Derivatives (n, 6, 3) of the ``stress`` (n, 3) at the cloud's points, ghosts left out."""
        return self.derivatives(self.model.cloud.points, stress)

    def derivatives(self, nodes: FloatArray, field: FloatArray) -> FloatArray:
        """Value and derivatives (n, 6, c) at the cloud's points of a ``field`` (N, c) at ``nodes`` (N, 2)."""
        model, cloud = self.model, self.model.cloud
        settings = replace(model.settings, degree=model.settings.degree + 1, neighbors=None)
        tree = model.tree if len(nodes) == len(model.nodes) else cKDTree(nodes)
        parts = [
            build_stencils(nodes, tree, some, 2, settings, cloud.sight).derivatives(field)
            for some in np.array_split(cloud.points, len(cloud.points) // TOGETHER + 1)
        ]
        return np.concatenate(parts)
