"""Pressures and stresses of small Hertz scenes against the closed formulas."""

from __future__ import annotations

import numpy as np
import pytest

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.contact.geometry.profile import half_width
from mlsanm_cli.reference.hertz import HertzLine
from tests.contact.scenes import Small, cylinder

HERTZ = HertzLine(226.566, 1.0, 0.5 * 210e3 / 0.91)


def profile_error(small: Small, pressure: FloatArray) -> float:
    """L2 norm of the difference over the surface, pressures joined linearly, relative."""
    x = np.linspace(-0.08, 0.08, 4001)
    expected = HERTZ.pressure(x)
    return float(
        np.linalg.norm(np.interp(x, small.coordinate, pressure) - expected) / np.linalg.norm(expected)
    )


@pytest.fixture(scope="module")
def fine() -> Small:
    """Spacing a/12 in the contact."""
    return cylinder(0.004)


def test_pressure_profile(fine: Small) -> None:
    pressure = fine.exact().pressure
    coarse = cylinder(0.008)
    error = profile_error(fine, pressure)
    assert error <= 0.035
    assert error <= 0.9 * profile_error(coarse, coarse.exact().pressure)
    assert pressure.max() == pytest.approx(HERTZ.peak_pressure, rel=0.005)
    assert half_width(fine.coordinate, pressure) == pytest.approx(HERTZ.half_width, abs=0.004)


@pytest.mark.parametrize(("body", "sign"), [("block", -1.0), ("cylinder", 1.0)])
def test_stress_below_the_surface(fine: Small, body: str, sign: float) -> None:
    points = fine.scene.bodies[body].model.cloud.points
    stress = fine.scene.bodies[body].model.stress(fine.displacement(body, fine.exact()))
    x, z = points[:, 0], sign * points[:, 1]
    within = (np.abs(x) <= 0.06) & (z >= 0.012) & (z <= 0.1)
    expected = HERTZ.stress(x[within], z[within]) * np.array([1.0, 1.0, sign])
    assert within.sum() > 100
    assert np.abs(stress[within] - expected).max() <= 0.04 * HERTZ.peak_pressure
