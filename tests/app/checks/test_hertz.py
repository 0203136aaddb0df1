"""Hertz and McEwen against quadrature, equilibrium and published values."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import quad

from mlsanm_cli.app.checks.references import HertzLine


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
