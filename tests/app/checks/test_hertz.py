"""Hertz against quadrature, and runs against McEwen's stresses beneath a contact."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import quad

from benchmarks.formulas import stress_below
from mlsanm_cli.app.checks.references import HertzLine
from tests.app.scenes import solve
from tests.case_text import scene


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


def test_stresses_beneath_are_mcewen_s(tmp_path: Path) -> None:
    modulus, half = 105e3 / 0.91, 1e-2
    formula = HertzLine(0.25 * np.pi * modulus * half**2, 1.0, modulus)
    text = (
        scene("strain")
        .body("cylinder", "steel", half_disk=([0.0, 1.0], 1.0))
        .body("block", "steel", box=([-2.0, 2.0], [-2.0, 0.0]), clamped="bottom")
        .load("press", "cylinder.flat", "platen", force=[0.0, -formula.force])
        .contact("interface", "cylinder.arc", "block.top")
    )
    x, z = (half * one.ravel() for one in np.meshgrid((0.0, 1.0, 1.2), (0.02, 0.786, 4.0)))
    for k, place in enumerate(zip(x.tolist(), (-z).tolist(), strict=True)):
        text = text.probe(f"p{k}", "block", place)
    summary = solve(text, tmp_path / "run")
    assert not summary["warnings"]
    found = np.array([probe["stress"] for probe in summary["probes"].values()])
    # z points into the block: xz is -xy.
    off = (found - stress_below(formula, x, z) * [1.0, 1.0, -1.0]) / formula.peak_pressure
    assert np.abs(off[:, 1:]).max() <= 3e-4
    # The block bends as a whole: 0.34 a / R of the peak along it, that changes with the depth in the block.
    assert np.abs(off[:, 0]).max() <= 5e-3
    assert np.ptp(off[:, 0]) <= 5e-4
