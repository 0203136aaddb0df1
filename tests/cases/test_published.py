"""Every case in cases/ against its closed formula, with the bars that its users may rely on."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from benchmarks.formulas import PinInHole
from benchmarks.gallery_entries import entries
from mlsanm_cli.app.checks.references import HertzLine
from mlsanm_cli.app.run import run
from mlsanm_cli.io.run_reader import RunData, read_run
from tests.app.scenes import Quiet

CASES = Path(__file__).parents[2] / "cases"

Run = tuple[Mapping[str, Any], RunData]


def solve(name: str, directory: Path, *overrides: str, balance: float = 1e-8) -> Run:
    summary = run(CASES / f"{name}.toml", overrides=overrides, out=directory, console=Quiet())
    assert summary["status"] == "done", summary
    assert summary["force_balance"] <= balance
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


WHOLE = 'contact.under.slave=["block.beside", "block.under", "block.beyond"]'
# Case, settings, and the largest error that benchmarks/gallery_entries.py may find in its result.
JUDGED: list[tuple[str, tuple[str, ...], float]] = [
    ("kirsch", (), 5e-3),
    ("kirsch", ("mls.degree=2",), 0.024),
    ("lame", (), 1e-3),
    ("self_weight", ("mls.degree=2",), 1e-8),
    ("self_weight", ("mls.degree=4",), 1e-8),
    ("orthotropic", (), 1e-9),
    ("shear_patch", (), 1e-11),
    ("block_slide", (COARSE,), 1e-6),
    ("disk_between_plates", (), 9e-3),
    ("stack", ("contact.*.accuracy=1e-2",), 1e-6),
    ("press_fit", (), 4e-3),
    ("rigid_punch", (), 4e-3),
    ("rigid_punch", (WHOLE,), 4e-3),
    ("paper_sliding_patch", (), 4e-3),
    ("springback", (), 0.01),
    ("indentation", (), 5e-3),
    ("bent_cantilever", (), 3e-3),
    ("deep_cylinder", (), 5e-3),
    ("rubber_half_disk", (), 7e-3),
    ("squeezed_ring", (), 0.01),
    ("inflated_tube", (), 6e-3),
    ("snap_through", (), 0.01),
]


@pytest.mark.parametrize(("case", "settings", "bar"), JUDGED)
def test_results_are_those_of_formulas_and_of_finite_elements(
    case: str, settings: tuple[str, ...], bar: float, tmp_path: Path
) -> None:
    _, data = solve(case, tmp_path / "run", *settings, balance=1e-6)
    judge = entries()[case].judge
    assert judge is not None
    assert max(judge(data).values()) <= bar
