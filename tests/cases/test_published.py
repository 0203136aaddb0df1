"""Every case in cases/ against its closed formula, with the bars that its users may rely on."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from benchmarks.formulas import KirschHole, LameRing, PinInHole
from mlsanm_cli.app.checks.references import HertzLine
from mlsanm_cli.app.results.probe import probe_named, probe_point
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


STEEL, ALUMINIUM = 210e3 / (1.0 - 0.3**2), 70e3 / (1.0 - 0.33**2)
HERTZ = HertzLine(226.566, 1.0, 0.5 * STEEL)
CYLINDERS = HertzLine(60.0, 2.0 / 3.0, 1.0 / (1.0 / STEEL + 1.0 / ALUMINIUM))
RIGID = HertzLine(14.5, 20.0, STEEL)
PLATES = HertzLine(500.0, 1.0, STEEL)
PIN = PinInHole(10.0, 0.01, 5000.0, 210e3)
CLEARANCE = ("body.plate.shape.center=[0.0, 0.01]", "body.plate.shape.radii=[10.01, 200.0]")
COARSE = "contact.interface.accuracy=1e-2"

MOST_NODES = {
    "hertz": 400,
    "two_cylinders": 400,
    "disk_between_plates": 600,
    "pin_in_hole": 8000,
    "ball_on_flat": 3000,
    "shrink_fit": 3500,
}
# Case, figure of its summary, formula, tolerance relative to the largest number of the formula.
FIGURES: list[tuple[str, str, float | list[float], float]] = [
    ("hertz", "contacts/interface/peak_pressure", HERTZ.peak_pressure, 1e-3),
    ("hertz", "contacts/interface/half_width", HERTZ.half_width, 1e-3),
    # Of a contact a twentieth of the radius wide 0.23 % on any grid and cloud.
    ("hertz", "contacts/interface/reference/pressure_error_l2", 0.0, 3e-3),
    ("hertz", "contacts/interface/force", [0.0, 226.566], 1e-9),
    ("hertz", "forces/press", [0.0, -226.566], 1e-9),
    # From the stress at the clamped bottom, independent of how the force was applied.
    ("hertz", "forces/block.bottom", [0.0, 226.566], 2e-9),
    ("two_cylinders", "contacts/interface/peak_pressure", CYLINDERS.peak_pressure, 1.5e-3),
    ("two_cylinders", "contacts/interface/half_width", CYLINDERS.half_width, 1.5e-3),
    ("ball_on_flat", "contacts/under/peak_pressure", 2.0 / np.pi * STEEL * 0.02, 1e-3),
    ("ball_on_flat", "contacts/under/half_width", 0.2, 8e-3),
    # Mean pressure by finite elements, in the middle of an interference of 1e-3 of the radius.
    ("shrink_fit", "contacts/fit/force", [0.39363 * 210.0 * 2.0 * np.pi * 20.0 * 10.0, 0.0], 1e-3),
    ("rigid_cylinder", "contacts/under/peak_pressure", RIGID.peak_pressure, 1e-3),
    ("rigid_cylinder", "contacts/under/half_width", RIGID.half_width, 5e-3),
    ("rigid_cylinder", "contacts/under/reference/pressure_error_l2", 0.0, 3e-3),
    ("rigid_cylinder", "contacts/under/singular_ends", 0.0, 0.0),
    ("disk_between_plates", "contacts/top/peak_pressure", PLATES.peak_pressure, 3e-3),
    ("disk_between_plates", "contacts/bottom/peak_pressure", PLATES.peak_pressure, 3e-3),
    ("disk_between_plates", "contacts/top/force", [0.0, -500.0], 2e-11),
    ("disk_between_plates", "contacts/bottom/force", [0.0, 500.0], 2e-11),
    ("disk_between_plates", "forces/press", [0.0, -500.0], 2e-11),
    ("pin_in_hole", "contacts/fit/peak_pressure", PIN.peak_pressure, 0.01),
    ("pin_in_hole", "contacts/fit/half_width", 10.0 * PIN.half_angle, 0.015),
    ("pin_in_hole", "contacts/fit/force", [0.0, 5000.0], 1e-3),
    ("wedge", "forces/push", [100.0 * 0.4 / 0.97, 0.0], 1e-6),
    ("wedge without friction", "forces/push", [10.0, 0.0], 1e-6),
]
SETTINGS = {
    "pin_in_hole": CLEARANCE,
    "wedge": (COARSE,),
    "wedge without friction": (COARSE, "contact.interface.friction=0.0"),
}


@pytest.mark.parametrize("case", dict.fromkeys(row[0] for row in FIGURES))
def test_figures_are_those_of_formulas(case: str, tmp_path: Path) -> None:
    summary, _ = solve(case.partition(" ")[0], tmp_path / "run", *SETTINGS.get(case, ()))
    assert summary["nodes"] <= MOST_NODES.get(case, 1000)
    for _, figure, formula, tolerance in (row for row in FIGURES if row[0] == case):
        found: Any = summary
        for key in figure.split("/"):
            found = found[key]
        off = np.abs(np.subtract(found or 0.0, formula)).max()
        assert off <= tolerance * (np.abs(formula).max() or 1.0), (figure, found, formula)


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
    """Fields where they are saved, and probes between, too: heat strains the board and stresses nothing."""
    directory, place = tmp_path / "run", (1.3, 0.7)
    summary, data = solve("orthotropic", directory, 'probe=[{name="p", body="board", point=[1.3, 0.7]}]')
    assert summary["force_balance"] <= 1e-9
    compliance = np.array(
        [[1 / 12e3, -0.4 / 12e3, 0.0], [-0.4 / 12e3, 1 / 0.9e3, 0.0], [0.0, 0.0, 1 / 0.7e3]]
    )
    c, s = np.sqrt(0.75), 0.5
    # Stresses along the grain's axes, and strains (the last one doubled) back along x and y.
    own = np.array([[c * c, s * s, 2 * c * s], [s * s, c * c, -2 * c * s], [-c * s, c * s, c * c - s * s]])
    stress = np.array([8.0, 0.0, 2.0])

    def moved(degrees: float, points: FloatArray) -> FloatArray:
        heat = degrees * np.array([4e-6, 35e-6, 0.0])
        xx, yy, xy = own.T @ (compliance @ own @ stress + heat)
        # The pins at (0, 0) and (2, 0) keep the lower edge's ends level.
        return np.stack([points @ [xx, xy], yy * points[:, 1]], axis=1)

    for state, degrees in zip(data.states, (0.0, 40.0), strict=True):
        fields, expected = state.bodies["board"], moved(degrees, data.bodies["board"].points)
        assert np.abs(fields["displacement"] - expected).max() <= 1e-9 * np.abs(expected).max()
        assert np.abs(fields["stress"] - stress).max() <= 1e-9 * 8.0
    for position, degrees in ((1.0, 0.0), (1.6, 24.0), (2.0, 40.0)):
        exact = [*moved(degrees, np.array([place]))[0], *stress]
        for (row,) in (
            probe_named(directory, [position], "p"),
            probe_point(directory, [position], "board", place),
        ):
            found = [row[key] for key in ("ux", "uy", "xx", "yy", "xy")]
            assert found == pytest.approx(exact, rel=1e-8, abs=1e-8)
