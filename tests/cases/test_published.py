"""Every case in cases/ against its closed formula, with the bars that its users may rely on."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from benchmarks.formulas.kirsch import KirschHole
from benchmarks.formulas.lame import LameRing
from benchmarks.formulas.persson import PinInHole
from mlsanm_cli.app.run import run
from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.io.run_reader import RunData, read_run
from tests.app.scenes import Quiet

CASES = Path(__file__).parents[2] / "cases"


Run = tuple[Mapping[str, Any], RunData]


def solve(name: str, directory: Path, *overrides: str) -> Run:
    summary = run(CASES / f"{name}.toml", overrides=overrides, out=directory, console=Quiet())
    assert summary["status"] == "done", summary
    assert summary["force_balance"] <= 1e-8
    return summary, read_run(directory)


@pytest.fixture(scope="module")
def exact(tmp_path_factory: pytest.TempPathFactory) -> Run:
    return solve("hertz", tmp_path_factory.mktemp("published") / "exact")


def deviations(summary: Mapping[str, Any], name: str = "interface") -> tuple[float, float, float]:
    """L2 error of the profile of a contact, relative errors of peak and half-width."""
    contact = summary["contacts"][name]
    reference = contact["reference"]
    peak, width = (contact[key] / reference[key] - 1.0 for key in ("peak_pressure", "half_width"))
    return reference["pressure_error_l2"], peak, width


def test_hertz_profile(exact: Run) -> None:
    summary, _ = exact
    profile, peak, width = deviations(summary)
    assert summary["nodes"] <= 400
    # Of a contact a twentieth of the radius wide: 0.23 % and 0.08 % on any grid and cloud.
    assert profile <= 0.003
    assert abs(peak) <= 0.001
    assert abs(width) <= 0.001


def test_hertz_forces(exact: Run) -> None:
    summary, _ = exact
    force = np.array(summary["contacts"]["interface"]["force"])
    applied = np.array(summary["forces"]["press"])
    np.testing.assert_allclose(force, -applied, atol=1e-9 * 226.566)
    # The reaction comes from the stress at the clamped bottom, independent of how the force was applied.
    reaction = np.array(summary["forces"]["block.bottom"])
    np.testing.assert_allclose(reaction, -applied, atol=2e-9 * 226.566)


def norm(weight: FloatArray, values: FloatArray) -> float:
    return float(np.sqrt((weight * values**2).sum()))


def test_two_cylinders(tmp_path: Path) -> None:
    summary, _ = solve("two_cylinders", tmp_path / "run")
    _, peak, width = deviations(summary)
    assert summary["nodes"] <= 400
    assert abs(peak) <= 0.0015
    assert abs(width) <= 0.0015


def test_patch(tmp_path: Path) -> None:
    summary, data = solve("patch", tmp_path / "patch")
    pressure = data.contacts["interface"].pressure[-1]
    assert np.abs(pressure / 100.0 - 1.0).max() <= 1e-11
    for body in data.states[-1].bodies.values():
        assert np.abs(body["stress"][:, 1] / -100.0 - 1.0).max() <= 1e-6
    # An exact result is known to be exact.
    assert summary["error_estimate"]["displacement"] <= 1e-11
    assert summary["error_estimate"]["pressure"]["interface"] <= 1e-7


def test_lame(tmp_path: Path) -> None:
    summary, data = solve("lame", tmp_path / "lame")
    ring = LameRing(1.0, 2.0, 100.0, 210e3 / (1.0 - 0.3**2), 0.3 / 0.7)
    points, fields = data.bodies["ring"].points, data.states[-1].bodies["ring"]
    r = np.hypot(points[:, 0], points[:, 1])
    outward = points / r[:, None]
    moved = (fields["displacement"] * outward).sum(axis=1)
    expected = ring.displacement(r)
    assert np.abs(moved - expected).max() <= 1e-3 * expected.max()
    xx, yy, xy = fields["stress"].T
    c, s = outward.T
    radial, hoop = ring.stress(r)
    assert np.abs(xx * c**2 + yy * s**2 + 2.0 * xy * c * s - radial).max() <= 0.5
    assert np.abs(xx * s**2 + yy * c**2 - 2.0 * xy * c * s - hoop).max() <= 0.5
    # Without contact: one solve for the one load, nothing else.
    assert summary["condensation_solves"] == 1
    assert summary["contact_unknowns"] == 0


@pytest.mark.parametrize(("degree", "bar"), [(4, 0.005), (2, 0.02)])
def test_kirsch(degree: int, bar: float, tmp_path: Path) -> None:
    # The plate's edges raise the stress at the hole: 3.0036 times the tension (degree 6, and 2.9998 for a
    # plate four times as large).
    summary, data = solve("kirsch", tmp_path / "kirsch", f"mls.degree={degree}")
    assert summary["nodes"] <= 3700
    assert not summary["warnings"]
    points, stress = data.bodies["plate"].points, data.states[-1].bodies["plate"]["stress"]
    r = np.hypot(points[:, 0], points[:, 1])
    rim = r <= 1.0 + 1e-9
    assert abs(stress[rim, 0].max() / 300.0 - 1.0) <= bar
    difference = (stress - KirschHole(1.0, 100.0).stress(points)) / 100.0
    assert np.abs(difference[rim]).max() <= 3.5 * bar
    ligament = (np.abs(points[:, 0]) < 0.5) & (np.abs(points[:, 1]) < 10.0)
    assert ligament.sum() > 100
    assert np.abs(difference[ligament]).max() <= 3.5 * bar
    assert np.abs(difference).max() <= 3.5 * bar


def test_pin_in_hole(tmp_path: Path) -> None:
    clearance = 0.01
    center = f"body.plate.shape.center=[0.0, {clearance}]"
    radii = f"body.plate.shape.radii=[{10 + clearance}, 200.0]"
    summary, _ = solve("pin_in_hole", tmp_path / "pin", center, radii)
    pin = PinInHole(10.0, clearance, 5000.0, 210e3)
    contact = summary["contacts"]["fit"]
    assert summary["nodes"] <= 8000
    assert contact["peak_pressure"] == pytest.approx(pin.peak_pressure, rel=0.01)
    assert contact["half_width"] == pytest.approx(10.0 * pin.half_angle, rel=0.015)
    assert contact["force"] == pytest.approx([0.0, 5000.0], abs=5.0)


@pytest.mark.parametrize("degree", [2, 4])
def test_self_weight(degree: int, tmp_path: Path) -> None:
    summary, data = solve("self_weight", tmp_path / "run", f"mls.degree={degree}")
    y, fields = data.bodies["block"].points[:, 1], data.states[-1].bodies["block"]
    direct = 30e3 * 0.8 / (1.2 * 0.6)
    expected = -0.024 / direct * (3.0 * y - 0.5 * y**2)
    assert np.abs(fields["displacement"][:, 1] - expected).max() <= 1e-8 * np.abs(expected).max()
    assert np.abs(fields["stress"][:, 1] + 0.024 * (3.0 - y)).max() <= 1e-8 * 0.072
    np.testing.assert_allclose(summary["forces"]["block.bottom"], [0.0, 0.144], atol=1e-10)
    assert summary["force_balance"] <= 1e-9


def test_orthotropic(tmp_path: Path) -> None:
    summary, data = solve("orthotropic", tmp_path / "run")
    assert summary["force_balance"] <= 1e-9
    compliance = np.array(
        [[1 / 12e3, -0.4 / 12e3, 0.0], [-0.4 / 12e3, 1 / 0.9e3, 0.0], [0.0, 0.0, 1 / 0.7e3]]
    )
    c, s = np.sqrt(0.75), 0.5
    # Stresses along the grain's axes, and strains (the last one doubled) back along x and y.
    own = np.array([[c * c, s * s, 2 * c * s], [s * s, c * c, -2 * c * s], [-c * s, c * s, c * c - s * s]])
    stress = np.array([8.0, 0.0, 2.0])
    strain = own.T @ compliance @ own @ stress
    heat = own.T @ (40.0 * np.array([4e-6, 35e-6, 0.0]))
    for state, total in zip(data.states, (strain, strain + heat), strict=True):
        fields, points = state.bodies["board"], data.bodies["board"].points
        # The pins at (0, 0) and (2, 0) keep the lower edge's ends level.
        expected = np.stack([points @ [total[0], total[2]], total[1] * points[:, 1]], axis=1)
        assert np.abs(fields["displacement"] - expected).max() <= 1e-9 * np.abs(expected).max()
        assert np.abs(fields["stress"] - stress).max() <= 1e-9 * 8.0
