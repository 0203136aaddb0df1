"""Contacts on grids of their own: pressures, stresses beneath and forces of whole runs."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from benchmarks.formulas import stress_below
from mlsanm_cli.app.checks.references import HertzLine
from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.io.run_reader import read_run
from tests.app.scenes import Quiet, solve
from tests.case_text import EXACT, Scene, head, polygon, scene

NOSE = {"kind": "half-disk", "center": [0.0, 1.0], "radius": 1.0, "side": "lower"}
SIDES = ("cylinder.arc", "block.top")


def pressed(width: float, ratio: float = 1.0, swapped: bool = False) -> tuple[Scene, HertzLine]:
    """A unit cylinder, ``ratio`` times as stiff as the block, pressed to a half ``width``."""
    modulus = 210e3 / 0.91 * ratio / (1.0 + ratio)
    force = 0.25 * np.pi * modulus * width**2
    slave, master = SIDES[::-1] if swapped else SIDES
    text = (
        scene("strain", "block", E=210e3, nu=0.3)
        .material("cylinder", E=210e3 * ratio, nu=0.3)
        .body("cylinder", "cylinder", shape=NOSE)
        .body("block", "block", box=([-2.0, 2.0], [-2.0, 0.0]), clamped="bottom")
        .load("press", "cylinder.flat", "platen", force=[0.0, -force])
        .contact("interface", slave, master, regularization=EXACT)
    )
    return text, HertzLine(force, 1.0, modulus)


def done(text: str, directory: Path, *overrides: str) -> dict[str, Any]:
    """The summary of a run that is done and warns of nothing."""
    console = Quiet()
    summary = solve(text, directory, *overrides, console=console)
    assert summary["status"] == "done", summary["stop_reason"]
    assert not console.warnings
    return dict(summary)


def pressures(directory: Path) -> tuple[FloatArray, FloatArray]:
    """Places (m,), increasing from the middle of the range on, and pressures (m,) at the end of a run."""
    contact = read_run(directory).contacts["interface"]
    return contact.arc_length, contact.pressure[-1]


def apart(directory: Path, formula: HertzLine) -> float:
    """L2 norm of a run's pressures less Hertz's, over that of Hertz's."""
    x, p = pressures(directory)
    # The contact of a half-disk is in the middle of its arc: 0.5 pi from the start.
    x = x - 0.5 * np.pi
    fine = np.linspace(-1.5 * formula.half_width, 1.5 * formula.half_width, 20001)
    exact = formula.pressure(fine)
    return float(np.linalg.norm(np.interp(fine, x, p, 0.0, 0.0) - exact) / np.linalg.norm(exact))


def test_hertz_pressures_of_a_narrow_contact(tmp_path: Path) -> None:
    text, formula = pressed(1e-3)
    summary = done(text, tmp_path / "run")
    assert summary["nodes"] <= 600
    assert apart(tmp_path / "run", formula) <= 1e-3
    figures = summary["contacts"]["interface"]
    assert figures["peak_pressure"] == pytest.approx(formula.peak_pressure, rel=1e-3)
    assert figures["half_width"] == pytest.approx(formula.half_width, rel=3e-3)
    assert summary["error_estimate"]["pressure"]["interface"] <= 1e-3


def test_roles_have_no_part_in_it(tmp_path: Path) -> None:
    ratio, found = 1e5, []
    for swapped in (False, True):
        text, formula = pressed(1e-2, ratio, swapped)
        summary = done(text, tmp_path / str(swapped))
        force = summary["contacts"]["interface"]["force"]
        assert force == pytest.approx([0.0, -formula.force if swapped else formula.force], rel=1e-10)
        x, p = pressures(tmp_path / str(swapped))
        found.append((-x[::-1], p[::-1]) if swapped else (x, p))
        assert summary["forces"]["block.bottom"] == pytest.approx([0.0, formula.force], rel=1e-8, abs=1e-12)
    (x, p), (other_x, other) = found
    # Arc lengths are along the slave, and half a disk curves away from a flat.
    assert other_x - other_x.mean() == pytest.approx(x - x.mean(), abs=5e-6)
    assert other == pytest.approx(p, abs=1e-8 * p.max())


DEPTHS = (0.02, 0.786, 4.0)
OFFSETS = (0.0, 1.0, 1.2)


def test_stresses_beneath_are_mcewen_s(tmp_path: Path) -> None:
    text, formula = pressed(1e-2)
    x, z = (1e-2 * one.ravel() for one in np.meshgrid(OFFSETS, DEPTHS))
    for k, place in enumerate(zip(x.tolist(), (-z).tolist(), strict=True)):
        text = text.probe(f"p{k}", "block", place)
    found = np.array([probe["stress"] for probe in solve(text, tmp_path / "run")["probes"].values()])
    # z points into the block: xz is -xy.
    off = (found - stress_below(formula, x, z) * [1.0, 1.0, -1.0]) / formula.peak_pressure
    assert np.abs(off[:, 1:]).max() <= 3e-4
    # The block bends as a whole: 0.34 a / R of the peak along it, that changes with the depth in the block.
    assert np.abs(off[:, 0]).max() <= 5e-3
    assert np.ptp(off[:, 0]) <= 5e-4


RECEDING = (
    head("strain")
    .table("mls", degree=4)
    .material("m", E=1.0, nu=0.3)
    .body("layer", "m", 0.125, box=([-7.0, 7.0], [0.0, 1.0]))
    .body("block", "m", box=([-8.0, 8.0], [-8.0, 0.0]), clamped="bottom")
    .load("press", "layer.top", "pressure", pressure="2e-3 * cos(pi * x)**2 if abs(x) < 0.5 else 0")
    .contact("seat", "layer.bottom", "block.top")
)


def test_a_layer_that_recedes_has_samples_for_its_bending(tmp_path: Path) -> None:
    """Quadratic finite elements, 59,000 unknowns: peak 0.6735e-3, half-width 1.356 to 1.363."""
    summary = done(RECEDING, tmp_path)["contacts"]["seat"]
    assert summary["peak_pressure"] == pytest.approx(0.6735e-3, rel=8e-3)
    assert summary["half_width"] == pytest.approx(1.356, rel=8e-3)


LATE = (
    scene("stress", "nylon", E=2800.0, nu=0.4)
    .material("steel", E=210e3, nu=0.3)
    .body("beam", "nylon", box=([0.0, 40.0], [0.0, 3.0]), clamped="left")
    .body("stop", "steel", shape={**NOSE, "center": [37.0, -8.5], "radius": 6.0, "side": "upper"})
    .support("stop.flat", ux=0.0, uy=0.0)
    .load("push", "beam.top", "pressure", pressure=0.1)
    .contact("rest", "beam.bottom", "stop.arc", regularization=EXACT)
)


def test_surfaces_may_come_a_long_way(tmp_path: Path) -> None:
    summary = solve(LATE, tmp_path / "run", console=Quiet())
    assert summary["status"] == "done"
    # It slides by most of its width, which is warned of.
    assert all("slide along each other" in warning for warning in summary["warnings"])
    found = summary["contacts"]["rest"]
    force = float(np.hypot(*found["force"]))
    together = 1.0 / (1.0 / 2800.0 + 1.0 / 210e3)
    assert found["closed_nodes"] > 20
    assert found["peak_pressure"] == pytest.approx(np.sqrt(force * together / (np.pi * 6.0)), rel=5e-3)
    assert force == pytest.approx(0.771, rel=0.01)


POINTS = [[0, 0], [20, 0], [22, -1.5], [25, -1.5], [26.5, 0], [26.5, 1.6], [0, 1.6]]
ROUNDED = polygon(POINTS, "under ramp nose back tip top root", rounding=[0.0, 0.5, 0.4, 0.4, 0.0, 0.0, 0.0])
HOOK = (
    scene("stress", "nylon", E=2800.0, nu=0.4)
    .body("hook", "nylon", shape=ROUNDED, clamped="root")
    .pushed("lift", "cam", uy=1.0)
    .contact("cam", "hook.nose", disk=([23.5, -5.5], 4.0))
)


def test_a_contact_may_wander_on_its_way(tmp_path: Path) -> None:
    # At the end it touches far from where it began, beyond the first grid.
    found = solve(HOOK, tmp_path / "run", console=Quiet())
    assert found["status"] == "done", found["stop_reason"]
    assert found["contacts"]["cam"]["force"][1] == pytest.approx(0.2304, rel=0.01)
