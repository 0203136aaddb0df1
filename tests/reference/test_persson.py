"""Persson's pin: equilibrium, the half-plane's limit, and the conformity of both surfaces."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import quad

from benchmarks.formulas.persson import FIT, PinInHole, clearance_ratio
from mlsanm_cli.reference.hertz import HertzLine


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
