"""Laws at finite strain: series against values, derivatives against differences, small strains, plane stress,
homogeneous states of each against its closed formula."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.mechanics.laws.law import Law, SaintVenantKirchhoff, law_class
from mlsanm_cli.mechanics.material import orthotropic
from tests.mechanics.finite_bodies import NU, E, law_of

PLANES = ("strain", "stress")
CONSTANTS: dict[str, dict[str, Any]] = {
    "neo-hookean": {"E": E, "nu": NU},
    "mooney-rivlin": {"c10": 0.3, "c01": 0.1, "nu": 0.4},
    "yeoh": {"c10": 0.4, "c20": -0.02, "c30": 0.01, "nu": 0.4},
    "arruda-boyce": {"mu": 0.8, "locking_stretch": 2.5, "nu": 0.4},
    "blatz-ko": {"E": 2.0, "nu": 0.25, "f": 0.3},
    "ogden": {"shear_moduli": (0.63, 0.012, -0.1), "exponents": (1.3, 5.0, -2.0), "nu": 0.4},
}
LAWS = [
    *(law_class(name)(plane=plane, **keys) for name, keys in CONSTANTS.items() for plane in PLANES),
    *(law_of("saint-venant-kirchhoff", plane) for plane in PLANES),
    *(
        SaintVenantKirchhoff(orthotropic((4.0, 1.0, 2.0), (0.3, 0.2, 0.25), 0.7, 0.4, plane), plane)
        for plane in PLANES
    ),
]
each_law = pytest.mark.parametrize("law", LAWS, ids=lambda law: f"{law.name} {law.plane}")


def random_series(seed: int = 0, orders: int = 7) -> FloatArray:
    return np.asarray(0.08 * np.random.default_rng(seed).normal(size=(orders, 4, 3, 5)))


@each_law
def test_series_are_those_of_the_law(law: Law) -> None:
    coefficients = random_series()
    response = law.series(len(coefficients) - 1, 3, 5)
    for order, coefficient in enumerate(coefficients):
        response.put(order, coefficient)
    a, h = 0.02, 1e-5
    powers = a ** np.arange(len(coefficients))

    def stress(x: float, y: float) -> FloatArray:
        value = coefficients[:, :, 0] + x * coefficients[:, :, 1] + y * coefficients[:, :, 2]
        return law.stress(np.tensordot(powers, value, 1))

    found = np.einsum("k,ckjn->cjn", powers, response.stress)
    np.testing.assert_allclose(found[:, 0], stress(0.0, 0.0), atol=1e-10)
    np.testing.assert_allclose(found[:, 1], (stress(h, 0.0) - stress(-h, 0.0)) / (2.0 * h), atol=1e-8)
    np.testing.assert_allclose(found[:, 2], (stress(0.0, h) - stress(0.0, -h)) / (2.0 * h), atol=1e-8)


@each_law
def test_moduli_are_derivatives_and_begin_with_linear_elasticity(law: Law) -> None:
    gradient, h = random_series(1)[0, :, 0], 1e-6
    moduli = law.moduli(gradient)
    for component in range(4):
        step = np.zeros((4, 1))
        step[component] = h
        difference = (law.stress(gradient + step) - law.stress(gradient - step)) / (2.0 * h)
        np.testing.assert_allclose(moduli[:, component], difference, atol=1e-8)
    first = law.moduli(np.zeros((4, 1)))[..., 0]
    places = [0, 3, 1]
    np.testing.assert_allclose(first[np.ix_(places, places)], law.linear.stiffness, rtol=1e-12, atol=1e-14)


@each_law
def test_rotations_make_no_stress_and_turn_that_of_isotropic_laws(law: Law) -> None:
    turn = np.array([[np.cos(1.2), -np.sin(1.2)], [np.sin(1.2), np.cos(1.2)]])
    assert np.abs(law.stress((turn - np.eye(2)).reshape(4, 1))).max() <= 1e-14
    f = np.array([[1.2, 0.1], [-0.05, 0.85]])
    first = law.state((f - np.eye(2)).reshape(4, 1)).cauchy[:, 0]
    turned = law.state((turn @ f - np.eye(2)).reshape(4, 1)).cauchy[:, 0]
    matrix = turn @ np.array([[first[0], first[3]], [first[3], first[1]]]) @ turn.T
    np.testing.assert_allclose(turned, [matrix[0, 0], matrix[1, 1], first[2], matrix[0, 1]], atol=1e-13)


def principal_stresses(law: Law, stretches: FloatArray) -> FloatArray:
    """First Piola-Kirchhoff stresses (3,) at principal ``stretches`` (3,), from the energy's formula."""
    step = 1e-20j * np.eye(3)
    return np.array([energy(law, stretches + part).imag / 1e-20 for part in step])


def energy(law: Law, stretches: FloatArray) -> complex:
    """Strain energy at principal stretches (3,), which may be complex: derivatives by complex steps are
    exact."""
    squares, volume, keys = stretches**2, stretches.prod(), CONSTANTS.get(law.name, {})
    first, second = squares.sum(), (1.0 / squares).sum() * volume**2
    isochoric = stretches / volume ** (1.0 / 3.0)
    one, two = (isochoric**2).sum() - 3.0, (isochoric**-2).sum() - 3.0
    lam, mu = E * NU / ((1.0 + NU) * (1.0 - 2.0 * NU)), 0.5 * E / (1.0 + NU)
    match law.name:
        case "saint-venant-kirchhoff":
            strain = 0.5 * (squares - 1.0)
            return complex(0.5 * lam * strain.sum() ** 2 + mu * (strain**2).sum())
        case "neo-hookean":
            log = np.log(volume)
            return complex(0.5 * mu * (first - 3.0) - mu * log + 0.5 * lam * log**2)
        case "blatz-ko":
            f, b = keys["f"], keys["nu"] / (1.0 - 2.0 * keys["nu"])
            solid = first - 3.0 + (volume ** (-2.0 * b) - 1.0) / b
            foam = second / volume**2 - 3.0 + (volume ** (2.0 * b) - 1.0) / b
            return complex(0.5 * keys["E"] / 2.5 * (f * solid + (1.0 - f) * foam))
        case "mooney-rivlin":
            distortion, shear = keys["c10"] * one + keys["c01"] * two, 2.0 * (keys["c10"] + keys["c01"])
        case "yeoh":
            distortion, shear = sum(keys[f"c{i}0"] * one**i for i in (1, 2, 3)), 2.0 * keys["c10"]
        case "arruda-boyce":
            terms = zip((1 / 2, 1 / 20, 11 / 1050, 19 / 7000, 519 / 673750), range(1, 6), strict=True)
            chains = [(c / keys["locking_stretch"] ** (2 * i - 2), i) for c, i in terms]
            distortion = keys["mu"] * sum(c * ((one + 3.0) ** i - 3.0**i) for c, i in chains)
            shear = 2.0 * keys["mu"] * sum(c * i * 3.0 ** (i - 1) for c, i in chains)
        case "ogden":
            pairs = list(zip(keys["shear_moduli"], keys["exponents"], strict=True))
            distortion = sum(m / a * ((isochoric**a).sum() - 3.0) for m, a in pairs)
            shear = 0.5 * sum(m * a for m, a in pairs)
    bulk = 2.0 * shear * (1.0 + keys["nu"]) / (3.0 * (1.0 - 2.0 * keys["nu"]))
    return complex(distortion + 0.5 * bulk * (volume - 1.0) ** 2)


@pytest.mark.parametrize("law", LAWS[:-2], ids=lambda law: f"{law.name} {law.plane}")
@pytest.mark.parametrize(
    "stretches", [(1.6, 0.8), (1.4, 1.4), (0.7, 1.0)], ids=["uniaxial", "equal", "planar"]
)
def test_homogeneous_states(law: Law, stretches: tuple[float, float]) -> None:
    """Stresses at principal stretches are derivatives of the energy; in plane stress the third vanishes."""
    gradient = np.array([stretches[0] - 1.0, 0.0, 0.0, stretches[1] - 1.0])[:, None]
    response = law.state(gradient)
    whole = np.array([*stretches, response.stretch_across[0]])
    exact = principal_stresses(law, whole)
    if law.plane == "stress":
        assert abs(exact[2]) <= 1e-12
        exact[2] = 0.0
    np.testing.assert_allclose(response.stress[[0, 3], 0, 0, 0], exact[:2], rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(response.cauchy[:3, 0], exact * whole / whole.prod(), rtol=1e-12, atol=1e-12)


@each_law
def test_free_expansion_makes_no_stress(law: Law) -> None:
    """In plane stress; in plane strain it is the linear law's for small changes."""
    free = (
        np.array([0.3, 0.2, 0.0, 0.1])
        if law.name == "saint-venant-kirchhoff"
        else np.array([0.2, 0.2, 0.0, 0.2])
    )
    warm = warmed(law, free)
    if law.plane == "stress":
        gradient = np.array([free[0], 0.0, 0.0, free[1]])[:, None]
        state = warm.state(gradient, np.ones(1))
        assert np.abs(state.stress[:, 0, 0]).max() <= 1e-14
        np.testing.assert_allclose(state.stretch_across, 1.0 + free[3], rtol=1e-14)
        return
    h, material = 1e-6, warm.linear
    state = warm.state(np.zeros((4, 1)), np.array([h]))
    exact = -material.stiffness @ material.expansion
    np.testing.assert_allclose(state.stress[[0, 3, 1], 0, 0, 0] / h, exact, rtol=1e-5, atol=1e-9)
    across = material.across @ exact + material.across_heat
    np.testing.assert_allclose(state.cauchy[2] / h, across, rtol=1e-5)


def warmed(law: Law, free: FloatArray) -> Law:
    """The law with free strains (4,) per degree."""
    if isinstance(law, SaintVenantKirchhoff):
        return replace(law, linear=replace(law.linear, free_expansion=free))
    return replace(law, alpha=free[0])  # type: ignore[type-var]


def test_saint_venant_kirchhoff_loses_ellipticity_at_stretch_0_7() -> None:
    law = law_of("saint-venant-kirchhoff", "strain")
    stretch = np.array([0.9, 0.8, 0.7, 0.6])
    gradient = np.stack([stretch - 1.0, *np.zeros((3, 4))])
    np.testing.assert_allclose(law.ellipticity(gradient), [0.65, 0.31, -0.02, -0.34], atol=0.02)
    assert law_of("neo-hookean", "strain").ellipticity(gradient).min() >= 0.99
