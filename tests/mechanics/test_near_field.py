"""Fields of forces on surfaces against differences, quadrature and a half-plane's surface compliance."""

from __future__ import annotations

import numpy as np
import pytest

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.mechanics.material import PlaneMaterial, isotropic, orthotropic
from mlsanm_cli.mechanics.near_field import (
    Anisotropic,
    ComplexArray,
    Isotropic,
    SurfaceForces,
    kernel_of,
    traction,
)

WOOD = orthotropic((5.0, 1.0, 1.0), (0.3, 0.3, 0.06), 0.5, 0.5, "strain")
MATERIALS = [
    pytest.param(isotropic(2.0, 0.3, "strain"), id="strain"),
    pytest.param(isotropic(2.0, 0.3, "stress"), id="stress"),
    pytest.param(WOOD, id="wood"),
]
DOWN: ComplexArray = np.array([-1j])


def at(*places: complex) -> ComplexArray:
    """Places as an array."""
    return np.array(places, dtype=np.complex128)


@pytest.mark.parametrize("material", MATERIALS)
@pytest.mark.parametrize("place", [0.3 - 0.7j, -1.2 - 0.1j, 0.9 + 0.2j])
def test_stress_is_that_of_the_displacement(material: PlaneMaterial, place: complex) -> None:
    kernel, step = kernel_of(material), 1e-5

    def slope(way: complex) -> FloatArray:
        ahead, behind = (kernel.displacement(at(place + sign * step * way), DOWN)[0] for sign in (1.0, -1.0))
        return np.asarray(ahead - behind) / (2.0 * step)

    x, y = slope(1.0), slope(1j)
    strain = np.stack([x[0], y[1], x[1] + y[0]])
    assert material.stiffness @ strain == pytest.approx(kernel.stress(at(place))[0], abs=1e-8)


@pytest.mark.parametrize("material", MATERIALS)
def test_rays_from_the_force_are_free_of_traction(material: PlaneMaterial) -> None:
    ray = np.exp(1j * np.linspace(-3.0, 3.0, 7))
    assert traction(kernel_of(material).stress(ray), 1j * ray) == pytest.approx(
        np.zeros((7, 2, 2)), abs=1e-12
    )


@pytest.mark.parametrize("material", MATERIALS)
def test_logarithm_is_that_of_the_half_plane(material: PlaneMaterial) -> None:
    kernel = kernel_of(material)
    far, near = kernel.displacement(at(2.0, 1.0), np.broadcast_to(DOWN, 2))
    expected = -material.surface_compliance / np.pi
    assert (far - near) / np.log(2.0) == pytest.approx(expected, rel=1e-9, abs=1e-12)


@pytest.mark.parametrize("material", MATERIALS)
@pytest.mark.parametrize("side", [1.0, -1.0], ids=["disk", "hole"])
def test_traction_beside_a_force_on_a_circle(material: PlaneMaterial, side: float) -> None:
    # The limit from both sides along the circle; what is odd in the distance falls out.
    kernel, angle = kernel_of(material), 0.8
    force, normal = np.exp(1j * angle), side * np.exp(1j * angle)
    forces = SurfaceForces(kernel, at(force), at(-normal))
    step = 1e-4 * np.array([1.0, -1.0])
    adjacent = np.exp(1j * (angle + step))
    limit = traction(kernel.stress(adjacent - force), side * adjacent).mean(axis=0)
    found = forces.traction(at(force), at(normal), np.array([side]))
    # Without the curvature this would be zero.
    assert np.abs(limit).max() >= 0.05
    assert found[0, 0] == pytest.approx(limit, abs=1e-7)
    assert found[0, 0] == pytest.approx(side * kernel.along(at(1j * normal))[0], abs=1e-14)


@pytest.mark.parametrize("material", MATERIALS)
def test_what_a_circle_sends_out(material: PlaneMaterial) -> None:
    # The whole outline but for the force itself answers with minus it.
    forces = SurfaceForces(kernel_of(material), at(1.0), at(-1.0))
    z = np.exp(2j * np.pi * np.arange(400) / 400)
    total = 2.0 * np.pi * forces.traction(z, z, np.ones(400)).mean(axis=0)[0]
    assert total == pytest.approx(-np.eye(2), abs=1e-12)


@pytest.mark.parametrize("material", MATERIALS)
def test_fields_end_in_hollows(material: PlaneMaterial) -> None:
    # In a hole the field ends at its center: displacements of the body around it are those of no net force,
    # and do not jump anywhere but between the two.
    place = np.exp(1j * np.array([0.4, 2.0]))
    forces = SurfaceForces(kernel_of(material), place, place, center=0.2 - 0.1j)
    circle = 1.5 * np.exp(1j * np.linspace(0.0, 2.0 * np.pi, 721))
    moved = forces.displacement(circle)
    assert np.abs(np.diff(moved, axis=0)).max() <= 0.02 * np.ptp(moved)
    normal = circle / 1.5
    flux = traction(forces.stress(circle), np.broadcast_to(normal[:, None], (721, 2)))[:-1].mean(axis=0)
    assert flux == pytest.approx(np.zeros((2, 2, 2)), abs=1e-12)
    far = forces.displacement(at(1e6))
    assert far == pytest.approx(np.zeros((1, 2, 2, 2)), abs=1e-5)
    one, stress = forces.displacement_of_each(circle[:2]), forces.stress_of_each(circle[:2])
    for which in range(2):
        assert one[which] == pytest.approx(moved[which, which], abs=1e-14)
        assert stress[which] == pytest.approx(forces.stress(circle[:2])[which, which], abs=1e-14)


def test_nearly_isotropic_materials() -> None:
    even = isotropic(1.0, 0.3, "stress")
    nearly = orthotropic((1.0 + 1e-6, 1.0, 1.0), (0.3, 0.3, 0.3), 0.5 / 1.3, 0.2, "stress")
    assert isinstance(kernel_of(even), Isotropic)
    assert isinstance(kernel_of(nearly), Anisotropic)
    places = at(0.4 - 0.3j, -0.8 - 0.9j)
    one, other = (kernel_of(material).stress(places) for material in (even, nearly))
    assert other == pytest.approx(one, abs=1e-5)
