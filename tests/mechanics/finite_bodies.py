"""Bodies at finite strain made by hand for the tests."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.cloud.cells import FINE, Halves
from mlsanm_cli.cloud.cloud import Cloud
from mlsanm_cli.mechanics.body import ElasticBody
from mlsanm_cli.mechanics.finite.body import FiniteBody
from mlsanm_cli.mechanics.finite.body_series import BodySeries
from mlsanm_cli.mechanics.finite.loads import Loads
from mlsanm_cli.mechanics.finite.projector import FiniteProblem, Projector, weights_of
from mlsanm_cli.mechanics.laws.law import Law, SaintVenantKirchhoff, law_class
from mlsanm_cli.mechanics.material import isotropic
from tests.mechanics.bodies import build

E, NU = 2.6, 0.3
KINDS = ("saint-venant-kirchhoff", "neo-hookean")


def law_of(kind: str, plane: str, poisson: float = NU) -> Law:
    """A law of E = 2.6, nu = 0.3, or of another Poisson's ratio."""
    if kind == "saint-venant-kirchhoff":
        return SaintVenantKirchhoff(isotropic(E, poisson, plane), plane)
    law: Law = law_class(kind)(E=E, nu=poisson, plane=plane)
    return law


def finite_body(
    cloud: Cloud,
    kind: str,
    held: Mapping[str, tuple[bool, bool]],
    loads: Callable[[ElasticBody], Loads],
    degree: int = 2,
    plane: str = "strain",
    poisson: float = NU,
) -> FiniteBody:
    """A body of E = 2.6."""
    law = law_of(kind, plane, poisson)
    elastic = build(cloud, held, degree, law.linear)
    return FiniteBody(elastic, law, loads(elastic))


def boundary_loads(
    body: ElasticBody, law: Law, exact: Callable[[FloatArray], tuple[FloatArray, FloatArray]]
) -> Loads:
    """One load: on every side what belongs to an ``exact`` displacement (n, 2) and gradient (4, n) at places
    (n, 2)."""
    cloud = body.model.cloud
    sources, tractions = np.zeros((body.rows, 1)), {}

    def traction(points: FloatArray, normal: FloatArray) -> FloatArray:
        p = law.stress(exact(points)[1])
        return np.stack(
            [p[0] * normal[:, 0] + p[1] * normal[:, 1], p[2] * normal[:, 0] + p[3] * normal[:, 1]], 1
        )

    for name, surface in cloud.surfaces.items():
        at, arc = cloud.points[surface.index], Halves.of(surface, FINE).arc
        sources[:, 0] += body.source(name, traction(at, surface.normal), held=False)
        sources[:, 0] += body.source(name, exact(at)[0], held=True)
        between = traction(surface.curve.points(arc), surface.curve.normals(arc))
        tractions[name] = between[:, :, None]
    return Loads(1, sources, tractions)


def problem_of(body: FiniteBody) -> FiniteProblem:
    """One stage, from nothing to all loads, with the equations of the reference."""
    start, end = np.zeros(body.loads.count), np.ones(body.loads.count)
    projector = Projector(body, weights_of(body), np.zeros(body.unknowns), start, "auto")
    return FiniteProblem(projector, start, end, 1.0)


def newton(problem: FiniteProblem, x: FloatArray, lam: float) -> FloatArray:
    """Newton's method at one load factor."""
    for _ in range(8):
        residual = problem.residual(x, lam)
        if np.abs(residual).max() < 1e-12:
            break
        x = x - problem.tangent(x, lam).solve(residual)
    return x


def left_of(body: FiniteBody, displacement: FloatArray, factors: FloatArray) -> FloatArray:
    """What is left of all rows in a state."""
    return BodySeries.at(body, displacement, factors).rows(0)
