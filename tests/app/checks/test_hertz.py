"""Hertz and McEwen against quadrature, equilibrium and published values."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import quad
from scipy.optimize import minimize_scalar

from benchmarks.formulas import FIT, KirschHole, LameRing, PinInHole, clearance_ratio, stress_below
from mlsanm_cli.app.checks.references import HertzLine
from mlsanm_cli.arrays import FloatArray

UNIT = HertzLine(force=0.5 * np.pi, radius=1.0, modulus=2.0)
"""A contact with half width 1 and peak pressure 1."""


def stress(x: float, z: float) -> list[float]:
    """Stresses xx, zz, xz of UNIT at one point."""
    return [float(s) for s in stress_below(UNIT, np.array([x]), np.array([z]))[0]]


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


@given(
    inner=st.floats(0.1, 2.0),
    thickness=st.floats(0.05, 5.0),
    pressure=st.floats(-10.0, 10.0),
    poisson=st.floats(0.0, 0.49),
)
def test_ring_is_in_equilibrium_and_takes_its_pressure(
    inner: float, thickness: float, pressure: float, poisson: float
) -> None:
    ring = LameRing(inner, inner + thickness, pressure, 210.0, poisson)
    radial, _ = ring.stress(np.array([ring.inner, ring.outer]))
    assert radial == pytest.approx([-pressure, 0.0], abs=1e-9)
    r = np.linspace(ring.inner, ring.outer, 7)[1:-1]
    step = 1e-4 * ring.inner
    slope = (ring.stress(r + step)[0] - ring.stress(r - step)[0]) / (2.0 * step)
    radial, hoop = ring.stress(r)
    size = max(1.0, abs(pressure)) * (1.0 + ring.inner / thickness)
    assert r * slope + radial - hoop == pytest.approx(0.0, abs=1e-5 * size)
    # Strains of the displacement are those of the stress.
    u = ring.displacement(r)
    e_r = (ring.displacement(r + step) - ring.displacement(r - step)) / (2.0 * step)
    assert 210.0 * u / r == pytest.approx(hoop - poisson * radial, abs=1e-9 * size)
    assert 210.0 * e_r == pytest.approx(radial - poisson * hoop, abs=1e-5 * size)


def test_a_thin_ring_carries_the_boiler_stress() -> None:
    ring = LameRing(10.0, 10.1, 2.0, 1.0, 0.3)
    hoop = ring.stress(np.array([10.05]))[1][0]
    assert hoop == pytest.approx(2.0 * 10.05 / 0.1, rel=6e-3)


HOLE = KirschHole(0.7, 3.0)
STEP = 1e-4


def ring(radius: float) -> tuple[FloatArray, FloatArray]:
    """Points and outward directions (24, 2) on a circle."""
    angle = np.linspace(0.1, 6.3, 24)
    direction = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    return radius * direction, direction


def test_the_hole_is_free_and_its_sides_carry_three_times_the_tension() -> None:
    points, n = ring(0.7)
    xx, yy, xy = HOLE.stress(points).T
    assert np.abs(xx * n[:, 0] + xy * n[:, 1]).max() <= 1e-13
    assert np.abs(xy * n[:, 0] + yy * n[:, 1]).max() <= 1e-13
    assert HOLE.stress(np.array([[0.0, 0.7]]))[0] == pytest.approx([9.0, 0.0, 0.0], abs=1e-13)
    assert HOLE.stress(np.array([[0.7, 0.0]]))[0] == pytest.approx([0.0, -3.0, 0.0], abs=1e-13)


def test_far_away_the_tension_is_left() -> None:
    points, _ = ring(700.0)
    assert HOLE.stress(points) == pytest.approx(np.tile([3.0, 0.0, 0.0], (24, 1)), abs=1e-5)


def test_equilibrium_and_compatibility() -> None:
    points, _ = ring(1.1)
    move = STEP * np.eye(2)
    by_x, by_y = ((HOLE.stress(points + m) - HOLE.stress(points - m)) / (2.0 * STEP) for m in move)
    assert np.abs(by_x[:, 0] + by_y[:, 2]).max() <= 1e-6
    assert np.abs(by_x[:, 2] + by_y[:, 1]).max() <= 1e-6
    # Compatible without body force: the sum of the normal stresses is harmonic.
    total = [HOLE.stress(points + m)[:, :2].sum(axis=1) for m in (*move, *-move, 0.0 * move[0])]
    assert np.abs(sum(total[:4]) - 4.0 * total[4]).max() / STEP**2 <= 1e-4


@pytest.mark.parametrize("clearance", [0.5, 0.05, 0.005])
def test_the_pressure_carries_the_force(clearance: float) -> None:
    pin = PinInHole(10.0, clearance, 700.0, 1e4)
    end = pin.half_angle

    def lift(angle: float) -> float:
        return float(pin.pressure(np.array([angle]))[0] * np.cos(angle) * pin.radius)

    assert quad(lift, -end, end, limit=200)[0] == pytest.approx(700.0, rel=1e-7)
    assert (pin.pressure(np.array([end, 1.1 * end, -3.0])) == 0.0).all()
    assert clearance_ratio(pin.b) == pytest.approx(1e4 * clearance / 700.0)


def test_a_small_contact_is_that_of_hertz() -> None:
    pin = PinInHole(10.0, 0.1, 1e-3, 1e4)
    # Two bodies of E* each make half of it; 1/R = 1/10 - 1/10.1.
    hertz = HertzLine(1e-3, 10.0 * 10.1 / 0.1, 0.5e4)
    assert pin.half_angle < 0.002
    # Persson's clearance is small next to the radius, here to 1 %.
    assert 10.0 * pin.half_angle == pytest.approx(hertz.half_width, rel=0.006)
    assert pin.peak_pressure == pytest.approx(hertz.peak_pressure, rel=0.006)


def test_a_pin_that_fits_touches_the_same_angle_under_any_force() -> None:
    assert clearance_ratio(FIT) == pytest.approx(0.0, abs=1e-4)
    assert np.degrees(PinInHole(1.0, 1e-9, 1.0, 1.0).half_angle) == pytest.approx(84.828, abs=0.001)
