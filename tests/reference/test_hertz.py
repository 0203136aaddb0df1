"""Hertz and McEwen against quadrature, equilibrium and published values."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import quad
from scipy.optimize import minimize_scalar

from mlsanm_cli.reference.hertz import HertzLine

UNIT = HertzLine(force=0.5 * np.pi, radius=1.0, modulus=2.0)
"""A contact with half width 1 and peak pressure 1."""


def stress(x: float, z: float) -> list[float]:
    """Stresses xx, zz, xz of UNIT at one point."""
    return [float(s) for s in UNIT.stress(np.array([x]), np.array([z]))[0]]


@given(force=st.floats(1e-3, 1e6), radius=st.floats(1e-3, 1e3), modulus=st.floats(1.0, 1e12))
def test_pressure_carries_the_force(force: float, radius: float, modulus: float) -> None:
    hertz = HertzLine(force, radius, modulus)
    a = hertz.half_width
    # x = a sin(angle) takes the square root's slope away at the ends.
    total = quad(
        lambda angle: float(hertz.pressure(np.array([a * np.sin(angle)]))[0]) * a * np.cos(angle),
        -0.5 * np.pi,
        0.5 * np.pi,
    )[0]
    assert total == pytest.approx(force, rel=1e-9)
    assert hertz.pressure(np.zeros(1))[0] == hertz.peak_pressure
    assert (hertz.pressure(np.array([-1.0001 * a, a, 2.0 * a])) <= 1e-6 * hertz.peak_pressure).all()


@given(force=st.floats(1e-3, 1e3), radius=st.floats(0.1, 10.0), modulus=st.floats(1.0, 1e6))
def test_pressed_surfaces_stay_in_contact(force: float, radius: float, modulus: float) -> None:
    # Under a pressure the half-plane's surface slopes by 2/(pi E*) times the principal value of p/(t - x):
    # both surfaces together by what the cylinders' curvature opens.
    hertz = HertzLine(force, radius, modulus)
    a = hertz.half_width
    x = 0.3 * a

    def pressure(t: float) -> float:
        return float(hertz.pressure(np.array([t]))[0])

    principal = quad(pressure, -a, a, weight="cauchy", wvar=x, limit=200)[0]
    assert 2.0 / (np.pi * modulus) * principal == pytest.approx(-x / radius, rel=1e-5)


def test_hand_values() -> None:
    assert (UNIT.half_width, UNIT.peak_pressure) == pytest.approx((1.0, 1.0))
    # The published scene: R = 1, E = 210e3, nu = 0.3 on both sides, a = R/20.
    steel = HertzLine(226.566, 1.0, 0.5 * 210e3 / 0.91)
    assert steel.half_width == pytest.approx(0.05, rel=1e-4)
    assert steel.peak_pressure == pytest.approx(2884.7, rel=1e-4)


def test_largest_shear_lies_below_the_surface() -> None:
    def shear(z: float) -> float:
        xx, zz, _ = stress(0.0, z)
        return 0.5 * abs(xx - zz)

    found = minimize_scalar(lambda z: -shear(z), bounds=(0.1, 3.0), method="bounded", options={"xatol": 1e-9})
    assert found.x == pytest.approx(0.786, abs=5e-4)
    assert -found.fun == pytest.approx(0.3003, abs=5e-5)


@pytest.mark.parametrize("x", [-0.9, -0.4, 0.0, 0.55, 1.3])
def test_surface_stress_is_the_pressure(x: float) -> None:
    xx, zz, xz = stress(x, 1e-12)
    p = np.sqrt(max(0.0, 1.0 - x**2))
    assert (zz, xz) == pytest.approx((-p, 0.0), abs=1e-9)
    # Under a normal pressure the half-plane's surface is pressed alike along and across.
    assert xx == pytest.approx(-p, abs=1e-9)


@given(x=st.floats(-3.0, 3.0), z=st.floats(0.2, 3.0))
def test_stress_is_in_equilibrium_and_compatible(x: float, z: float) -> None:
    step = 1e-3

    def slope(component: int, dx: float, dz: float) -> float:
        values = [stress(x + k * step * dx, z + k * step * dz)[component] for k in (-2, -1, 1, 2)]
        return (values[0] - 8.0 * values[1] + 8.0 * values[2] - values[3]) / (12.0 * step)

    assert slope(0, 1, 0) + slope(2, 0, 1) == pytest.approx(0.0, abs=1e-7)
    assert slope(2, 1, 0) + slope(1, 0, 1) == pytest.approx(0.0, abs=1e-7)
    around = [stress(x + dx, z + dz) for dx, dz in ((step, 0), (-step, 0), (0, step), (0, -step))]
    trace = sum(s[0] + s[1] for s in around) - 4.0 * sum(stress(x, z)[:2])
    assert trace / step**2 == pytest.approx(0.0, abs=1e-2)
