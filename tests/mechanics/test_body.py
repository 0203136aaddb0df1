"""Boundary value problems with known solutions: patches, manufactured fields, weights near corners."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.sparse as sparse

from benchmarks.formulas import LameRing
from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.cloud.curves import annulus, rectangle
from mlsanm_cli.cloud.spacing import Spacing, Zone, build_cloud
from mlsanm_cli.mechanics.body import ElasticBody
from mlsanm_cli.mechanics.energy import rigid_part
from mlsanm_cli.mechanics.material import PlaneMaterial, anisotropic, isotropic, orthotropic
from mlsanm_cli.operators.system import residual_of
from tests.mechanics.bodies import STEEL, boundary_values, build, jittered_square, solved, with_body_force
from tests.mechanics.waves import Exact, Wave

HELD = {"bottom": (True, True)}


class Polynomial(Exact):
    """u = sum of coefficients (2, k) times x^i y^j."""

    def __init__(self, degree: int, stiffness: FloatArray) -> None:
        self.powers = [(i, j) for i in range(degree + 1) for j in range(degree + 1 - i)]
        self.c = np.random.default_rng(degree).normal(size=(2, len(self.powers)))
        self.stiffness = stiffness

    def derivative(self, at: FloatArray, dx: int, dy: int) -> FloatArray:
        x, y = at.T
        columns = []
        for i, j in self.powers:
            factor = float(np.prod(np.arange(i, i - dx, -1)) * np.prod(np.arange(j, j - dy, -1)))
            columns.append(factor * x ** max(i - dx, 0) * y ** max(j - dy, 0))
        return np.stack(columns, axis=1) @ self.c.T


FULL = anisotropic(np.array([[5.0, 1.2, 0.7], [1.2, 3.0, -0.4], [0.7, -0.4, 2.0]]), "stress")
WOOD = orthotropic((13.0, 1.0, 1.0), (0.3, 0.3, 0.3), 0.6, np.radians(30.0), "stress")
HELDS = [HELD, {"left": (True, False), "bottom": (False, True)}]


def patch(degree: int, held: dict[str, tuple[bool, bool]]) -> tuple[ElasticBody, Polynomial]:
    """A body on a graded cloud, and a field of its degree."""
    spacing = Spacing(0.12, (Zone.around((0.2, 1.0), 0.03, 0.1, 0.12),))
    cloud = build_cloud(rectangle((0.0, 1.5), (0.0, 1.0)), spacing, 0)
    return build(cloud, held, degree, FULL), Polynomial(degree, FULL.stiffness)


def assert_solved(body: ElasticBody, source: FloatArray, exact: Polynomial) -> None:
    """The displacements are exact to 1e-10, the stresses to a hundred times that."""
    points = body.model.cloud.points
    u, expected, stress = solved(body, source), exact.displacement(points), exact.stress(points)
    assert np.abs(u[: len(points)] - expected).max() <= 1e-10 * np.abs(expected).max()
    assert np.abs(body.model.stress(u) - stress).max() <= 1e-8 * np.abs(stress).max()


@pytest.mark.parametrize("degree", [1, 2, 3, 4, 5, 6])
@pytest.mark.parametrize("held", HELDS)
def test_polynomial_patch(degree: int, held: dict[str, tuple[bool, bool]]) -> None:
    body, exact = patch(degree, held)
    source = boundary_values(body, exact.displacement, exact.stress)
    assert_solved(body, with_body_force(body, source, exact.force), exact)
    if degree <= 3:
        # Body forces of degree 1 are what is between their nodal values.
        assert_solved(body, source + body.force_source(exact.force(body.model.cloud.points)), exact)


def wave_solution(
    side: int, degree: int, seed: int = 0, material: PlaneMaterial = STEEL
) -> tuple[ElasticBody, FloatArray, FloatArray]:
    """Body, computed and exact displacements (n, 2); traction on three sides."""
    cloud = jittered_square(side, 0.25, seed)
    body = build(cloud, HELD, degree, material)
    wave = Wave(material.stiffness)
    source = with_body_force(body, boundary_values(body, wave.displacement, wave.stress), wave.force)
    return body, solved(body, source)[: len(cloud.points)], wave.displacement(cloud.points)


def wave_error(side: int, degree: int, seed: int = 0, material: PlaneMaterial = STEEL) -> float:
    """Root mean square error of the displacement, relative."""
    _, u, exact = wave_solution(side, degree, seed, material)
    return float(np.sqrt(((u - exact) ** 2).sum() / (exact**2).sum()))


@pytest.mark.parametrize(
    ("material", "degree", "sides", "order", "bar"),
    [
        (STEEL, 2, (13, 25), 1.8, 4e-3),
        (STEEL, 4, (17, 33), 3.7, 3e-6),
        (STEEL, 6, (15, 25), 5.5, 2e-7),
        (WOOD, 2, (17, 33), 1.8, 2.5e-3),
        (WOOD, 4, (17, 33), 3.3, 6e-6),
    ],
)
def test_manufactured_solution_converges(
    material: PlaneMaterial, degree: int, sides: tuple[int, ...], order: float, bar: float
) -> None:
    # Errors scatter from cloud to cloud; the median of three gives the order.
    errors = [np.median([wave_error(n, degree, s, material) for s in range(3)]) for n in sides]
    assert -np.polyfit(np.log(np.array(sides) - 1.0), np.log(errors), 1)[0] >= order
    assert errors[-1] <= bar


@pytest.mark.parametrize(("degree", "side", "bar"), [(2, 25, 1e-2), (4, 25, 6e-5)])
def test_nearly_incompressible_materials_do_not_lock(degree: int, side: int, bar: float) -> None:
    # Locked, displacements would be next to nothing.
    material = isotropic(210.0, 0.4999, "strain")
    body, u, exact = wave_solution(side, degree, 1, material)
    assert np.linalg.norm(u - exact) <= bar * np.linalg.norm(exact)
    assert body.system.note == ""
    wave = Wave(material.stiffness)
    source = with_body_force(body, boundary_values(body, wave.displacement, wave.stress), wave.force)
    assert residual_of(body.system, sparse.csc_array(source[:, None]), u.reshape(-1, 1)) <= 1e-9


@pytest.mark.parametrize(("degree", "bar"), [(2, 0.06), (4, 0.015)])
def test_pressures_in_nearly_incompressible_materials_are_smooth(degree: int, bar: float) -> None:
    # Lamé's ring of radii 10 and 25: the mean stress in the plane is even.
    inner, outer, pressure = 10.0, 25.0, 10.0
    cloud = build_cloud(annulus((0.0, 0.0), (inner, outer)), Spacing(2.0), 0)
    body = build(cloud, {}, degree, isotropic(1000.0, 0.499, "strain"))
    source = body.source("inner", -pressure * cloud.surfaces["inner"].normal, held=False)
    found = solved(body, source)
    stress, even = body.model.stress(found), pressure * inner**2 / (outer**2 - inner**2)
    error = stress[:, :2].mean(axis=1) - even
    assert np.sqrt(np.mean(error**2)) <= bar * pressure
    at = np.array([0, 100, 399])
    probed = (body.model.probe_rows(cloud.points[at]) @ found.ravel()).reshape(5, -1)[2:].T
    assert np.allclose(probed, stress[at], rtol=0.0, atol=1e-9 * pressure)


def test_a_ring_under_pressure_is_exact_to_a_hundred_thousandth_on_a_bad_cloud() -> None:
    ring = LameRing(20.0, 32.0, 1.0, 1.0, 0.3)
    cloud = build_cloud(annulus((0.0, 0.0), (20.0, 32.0)), Spacing(1.0), 4)
    points, r = cloud.points, np.hypot(*cloud.points.T)

    def stress(at: FloatArray) -> FloatArray:
        c, s = at.T / np.hypot(*at.T)
        radial, hoop = ring.stress(np.hypot(*at.T))
        both = [radial * c**2 + hoop * s**2, radial * s**2 + hoop * c**2, (radial - hoop) * c * s]
        return np.stack(both, axis=1)

    body = build(cloud, {}, 4, isotropic(1.0, 0.3, "stress"))
    found = solved(body, boundary_values(body, lambda at: 0.0 * at, stress))
    exact = points * (ring.displacement(r) / r)[:, None]
    # Apart from rigid motions, which nothing holds.
    off = found - exact - rigid_part(cloud, found - exact, [])
    error = cloud.areas @ (off**2).sum(axis=1) / (cloud.areas @ (exact**2).sum(axis=1))
    assert np.sqrt(error) < 1.0e-5


def test_equal_rows_are_known_by_their_content() -> None:
    cloud, held = jittered_square(8), {"bottom": (True, True)}
    usual = build(cloud, held).equations.content
    assert build(jittered_square(8), dict(held)).equations.content == usual
    warm = isotropic(210.0, 0.3, "strain", expansion=1e-5)
    assert build(cloud, held, material=warm).equations.content == usual
    others = [
        build(jittered_square(8, seed=1), held),
        build(cloud, {"bottom": (False, True)}),
        build(cloud, {"bottom": (True, True), "top": (True, False)}),
        build(cloud, held, material=isotropic(210.0, 0.2, "strain")),
        build(cloud, held, degree=4),
        # Of the same mean modulus, and so with the same weights.
        build(cloud, held, material=anisotropic(np.diag([300.0, 200.0, 80.0]), "strain")),
        build(cloud, held, material=anisotropic(np.diag([200.0, 300.0, 80.0]), "strain")),
        build(cloud, held, held_nodes=((3, 0),)),
    ]
    contents = {usual, *(body.equations.content for body in others)}
    assert len(contents) == 1 + len(others)
