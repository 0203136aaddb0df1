"""What the comparison with other programs judges by: its measure of error and its stored references."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.peers.scenes import (
    FORCE,
    FRICTION,
    HALF_WIDTH,
    REFERENCE,
    SHEAR,
    Profile,
    difference,
    path,
    read_profile,
)


def resultant(profile: Profile) -> float:
    """Integral over the arc: dx to ds is 1/sqrt(1 - x^2) for radius 1."""
    return float(np.trapezoid(profile.values / np.sqrt(1.0 - profile.x**2), profile.x))


def test_difference_is_exact_for_lines_that_meet_between_nodes() -> None:
    hat = Profile(np.array([-1.0, 0.0, 1.0]), np.array([0.0, 1.0, 0.0]))
    shifted = Profile(np.array([-1.0, 0.5, 1.0]), np.array([0.0, 1.0, 0.0]))
    x = np.linspace(-1.0, 1.0, 400_001)
    expected = np.sqrt(np.sum((shifted.at(x) - hat.at(x)) ** 2) / np.sum(hat.at(x) ** 2))
    assert difference(shifted, hat) == pytest.approx(expected, rel=1e-6)
    assert difference(hat, hat) == 0.0


def test_even_part_drops_what_is_odd() -> None:
    x = np.array([-1.0, -0.3, 0.0, 0.5, 1.0])
    even = Profile(x, 2.0 + x).even()
    np.testing.assert_allclose(even.values, 2.0, rtol=1e-14)


def test_histories_end_where_the_case_does() -> None:
    assert path("hertz", 1) == [(0.0, FORCE)]
    history = path("history", 60)
    assert len(history) == 60
    assert history[14] == pytest.approx((0.0, FORCE))
    assert history[29] == pytest.approx((-SHEAR, FORCE))
    assert history[59] == pytest.approx((SHEAR, FORCE))


def test_references_carry_their_loads_within_the_cone() -> None:
    assert resultant(read_profile(REFERENCE / "hertz.csv", "pressure")) == pytest.approx(FORCE, rel=2e-4)
    for name, shear in (("slip", -SHEAR), ("history", SHEAR)):
        pressure = read_profile(REFERENCE / f"{name}.csv", "pressure")
        traction = read_profile(REFERENCE / f"{name}.csv", "traction")
        assert resultant(pressure) == pytest.approx(FORCE, rel=2e-4)
        assert resultant(traction) == pytest.approx(shear, rel=2e-4)
        assert np.all(np.abs(traction.values) <= FRICTION * pressure.values + 1e-6 * FORCE / HALF_WIDTH)
