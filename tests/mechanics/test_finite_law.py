"""Hyperelastic laws: series against values, derivatives against differences, small strains, plane stress."""

from __future__ import annotations

import numpy as np
import pytest

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.mechanics.finite.law import Law, cauchy_stress
from mlsanm_cli.mechanics.finite.response import Kind
from mlsanm_cli.mechanics.material import isotropic
from tests.mechanics.finite_bodies import KINDS, NU, E

PLANES = ("strain", "stress")
LAWS = [Law.isotropic(kind, E, NU, plane) for kind in KINDS for plane in PLANES]


def random_series(seed: int = 0, orders: int = 7) -> FloatArray:
    return np.asarray(0.08 * np.random.default_rng(seed).normal(size=(orders, 4, 3, 5)))


@pytest.mark.parametrize("law", LAWS, ids=lambda law: f"{law.kind} {law.plane}")
def test_series_are_those_of_the_law(law: Law) -> None:
    coefficients = random_series()
    response = law.series(len(coefficients) - 1, 3, 5)
    for order, one in enumerate(coefficients):
        response.put(order, one)
    a, h = 0.02, 1e-5
    powers = a ** np.arange(len(coefficients))

    def stress(x: float, y: float) -> FloatArray:
        value = coefficients[:, :, 0] + x * coefficients[:, :, 1] + y * coefficients[:, :, 2]
        return law.stress(np.tensordot(powers, value, 1))

    found = np.einsum("k,ckjn->cjn", powers, response.stress)
    np.testing.assert_allclose(found[:, 0], stress(0.0, 0.0), atol=1e-10)
    np.testing.assert_allclose(found[:, 1], (stress(h, 0.0) - stress(-h, 0.0)) / (2.0 * h), atol=1e-8)
    np.testing.assert_allclose(found[:, 2], (stress(0.0, h) - stress(0.0, -h)) / (2.0 * h), atol=1e-8)


@pytest.mark.parametrize("law", LAWS, ids=lambda law: f"{law.kind} {law.plane}")
def test_moduli_are_derivatives_and_begin_with_linear_elasticity(law: Law) -> None:
    gradient, h = random_series(1)[0, :, 0], 1e-6
    moduli = law.moduli(gradient)
    for component in range(4):
        step = np.zeros((4, 1))
        step[component] = h
        difference = (law.stress(gradient + step) - law.stress(gradient - step)) / (2.0 * h)
        np.testing.assert_allclose(moduli[:, component], difference, atol=1e-8)
    c = isotropic(E, NU, law.plane).stiffness
    first = law.moduli(np.zeros((4, 1)))[..., 0]
    np.testing.assert_allclose(first[0, [0, 3]], c[0, :2], rtol=1e-12)
    np.testing.assert_allclose(first[1, [1, 2]], [c[2, 2], c[2, 2]], rtol=1e-12)


@pytest.mark.parametrize("law", LAWS, ids=lambda law: f"{law.kind} {law.plane}")
def test_rotations_make_no_stress_and_turn_cauchys(law: Law) -> None:
    turn = np.array([[np.cos(1.2), -np.sin(1.2)], [np.sin(1.2), np.cos(1.2)]])
    rigid = (turn - np.eye(2)).reshape(4, 1)
    assert np.abs(law.stress(rigid)).max() <= 1e-14
    f = np.array([[1.2, 0.1], [-0.05, 0.85]])
    first = cauchy_stress(law, (f - np.eye(2)).reshape(4, 1))[:, 0]
    turned = cauchy_stress(law, (turn @ f - np.eye(2)).reshape(4, 1))[:, 0]
    matrix = turn @ np.array([[first[0], first[2]], [first[2], first[1]]]) @ turn.T
    np.testing.assert_allclose(turned, [matrix[0, 0], matrix[1, 1], matrix[0, 1]], atol=1e-13)


@pytest.mark.parametrize("kind", KINDS)
def test_plane_stress_is_plane_strain_without_stress_across(kind: Kind) -> None:
    """Three dimensions reduced by hand: diagonal stretches, that across the plane as the law says."""
    law = Law.isotropic(kind, E, NU, "stress")
    gradient = np.array([0.3, 0.0, 0.0, -0.2])[:, None]
    stretch = np.array([1.3, 0.8, float(law.across(gradient)[0])])
    if kind == "neo-hookean":
        first = law.mu * (stretch - 1.0 / stretch) + law.lam * np.log(stretch.prod()) / stretch
    else:
        strain = 0.5 * (stretch**2 - 1.0)
        first = stretch * (law.lam * strain.sum() + 2.0 * law.mu * strain)
    assert abs(first[2]) <= 1e-13
    np.testing.assert_allclose(law.stress(gradient)[[0, 3], 0], first[:2], rtol=1e-13)
    sigma = cauchy_stress(law, gradient)[:2, 0]
    np.testing.assert_allclose(sigma, first[:2] * stretch[:2] / stretch.prod(), rtol=1e-13)


def test_saint_venant_kirchhoff_loses_ellipticity_at_stretch_0_7() -> None:
    law = Law.isotropic("saint-venant-kirchhoff", E, NU, "strain")
    stretch = np.array([0.9, 0.8, 0.7, 0.6])
    gradient = np.stack([stretch - 1.0, *np.zeros((3, 4))])
    np.testing.assert_allclose(law.ellipticity(gradient), [0.65, 0.31, -0.02, -0.34], atol=0.02)
    neo = Law.isotropic("neo-hookean", E, NU, "strain")
    assert neo.ellipticity(gradient).min() >= 0.99
