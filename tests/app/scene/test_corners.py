"""Contacts that end at corners of bodies: patch tests, punches, stacks, roles and walls."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from mlsanm_cli.io.run_reader import read_run
from tests.app.scenes import Quiet, solve
from tests.case_text import EXACT, FLOOR, Scene, load, scene

SOFT = scene("strain", "one", E=1.0)
PRESS = load("press", "block.top", "platen", force=[0.0, -0.01])
SIDES = ("block.bottom", "base.top")


def block(left: float = -5.0, stiff: float = 1.0) -> Scene:
    return scene("strain", "one", E=stiff).body("block", "one", 0.5, box=([left, 5.0], [0.0, 5.0]))


def punch(stiff: float, slave: str, master: str, **keys: Any) -> Scene:
    """The block on a base that is ten times as wide."""
    return (
        block(stiff=stiff)
        .material("other", E=1.0, nu=0.3)
        .body("base", "other", 5.0, box=([-50.0, 50.0], [-50.0, 0.0]), clamped="bottom")
        .contact("foot", slave, master, regularization=EXACT, **keys)
    )


def pressed(pressure: str, left: float = -5.0) -> Scene:
    """The block alone on a plane."""
    text = block(left).load("press", "block.top", "pressure", pressure=pressure)
    return text.contact("foot", "block.bottom", obstacle=FLOOR, regularization=EXACT)


def pressures(directory: Path, at: list[float]) -> list[float]:
    """Final pressures at places along x."""
    found = read_run(directory).contacts["foot"]
    order = np.argsort(found.points[:, 0])
    return [float(v) for v in np.interp(at, found.points[order, 0], found.pressure[-1][order])]


def test_uneven_pressure_up_to_corners_and_walls(tmp_path: Path) -> None:
    """On clouds of 200 and of 800 nodes alike; half of the scene between rollers has the pressures of all."""
    wave = "0.01 * (1 + 0.5 * cos(pi * x / 5))"
    text = pressed(wave)
    half = pressed(wave, 0.0).support("block.left", ux=0.0)
    whole = solve(text, tmp_path / "whole", "mls.degree=4")
    solve(text, tmp_path / "fine", "body.block.spacing=0.25", "mls.degree=4")
    solve(half, tmp_path / "half", "mls.degree=4")
    at = [-4.9, -4.0, -2.0, 0.0, 1.0, 3.0, 4.5]
    assert pressures(tmp_path / "whole", at) == pytest.approx(pressures(tmp_path / "fine", at), rel=4e-3)
    assert whole["contacts"]["foot"]["force"][1] == pytest.approx(0.1, rel=1e-8)
    at = [0.01, 1.0, 2.0, 3.0, 4.5]
    assert pressures(tmp_path / "half", at) == pytest.approx(pressures(tmp_path / "whole", at), rel=5e-3)


def test_a_stiff_punch_whatever_the_roles(tmp_path: Path) -> None:
    one = solve(punch(1000.0, *SIDES) + PRESS, tmp_path / "one")
    solve(punch(1000.0, *SIDES[::-1]) + PRESS, tmp_path / "other")
    at = [-4.5, -2.0, 0.0, 2.0, 4.0]
    found = pressures(tmp_path / "one", at)
    assert pressures(tmp_path / "other", at) == pytest.approx(found, rel=1e-6)
    assert found[1] == pytest.approx(found[3], rel=2e-3)
    assert one["force_balance"] < 1e-8
    # A flat rigid punch on a half-plane: P / (pi sqrt(a^2 - x^2)) (Johnson 1985, section 2.8).
    assert found == pytest.approx([0.01 / (np.pi * np.sqrt(25.0 - x * x)) for x in at], rel=0.015)


def test_a_contact_reaches_a_clamped_side(tmp_path: Path) -> None:
    beam = (
        scene("strain")
        .body("beam", "steel", box=([0.0, 4.0], [0.0, 1.0]), clamped="left")
        .contact("floor", "beam.bottom", obstacle=FLOOR)
        .load("press", "beam.top", "pressure", pressure=10.0)
        .probe("tip", "beam", [4.0, 1.0])
    )
    summary = solve(beam, tmp_path / "run")
    # By finite elements, biquadratic ones graded towards the clamped side.
    assert summary["probes"]["tip"]["displacement"][1] == pytest.approx(-4.3322e-5, rel=2e-3)
    assert summary["contacts"]["floor"]["force"][1] == pytest.approx(36.4, rel=0.01)
    assert summary["contacts"]["floor"]["peak_pressure"] == pytest.approx(10.2, rel=0.02)


def pad(*sides: str, base: str = "base.top", force: float = 0.0, **shape: Any) -> Scene:
    """A chamfered pad on a block."""
    points = [[-8.0, 0.0], [8.0, 0.0], [10.0, 2.0], [10.0, 10.0], [-10.0, 10.0], [-10.0, 2.0]]
    return (
        SOFT.body("pad", "one", polygon=(points, "bottom right_edge right top left left_edge"))
        .body("base", "one", **shape or {"box": ([-30.0, 30.0], [-30.0, 0.0])}, clamped="bottom")
        .load("press", "pad.top", "platen", force=[force, -0.01])
        .contact("foot", [f"pad.{side}" for side in sides], base.split(), regularization=EXACT)
    )


def test_pressures_up_to_corners_within_a_surface(tmp_path: Path) -> None:
    chamfered = pad("left_edge", "bottom", "right_edge")
    for name, text in (("chamfered", chamfered), ("flat", pad("bottom"))):
        solve(text, tmp_path / name, "contact.foot.accuracy=3e-3")
    at = [-7.9, -6.0, -3.0, 0.0, 2.0, 5.0, 7.5]
    found = pressures(tmp_path / "chamfered", at)
    assert found == pytest.approx(pressures(tmp_path / "flat", at), rel=2e-3)


def test_what_only_pieces_beyond_a_range_resist(tmp_path: Path) -> None:
    """Open chamfers resist no motion along the block. Where one stops the pad, pressures are nodal."""
    names = ("left_edge", "bottom", "right_edge")
    console = Quiet()
    solve(pad(*names), tmp_path / "open", "contact.foot.accuracy=0.1", console=console)
    assert any("ux is fixed at 0" in text for text in console.notes)
    corners = [[-30.0, -30.0], [30.0, -30.0], [30.0, 8.0], [16.01, 8.0], [8.01, 0.0], [-30.0, 0.0]]
    ramp = (corners, "bottom right shelf ramp top left")
    found = solve(pad(*names, base="base.ramp base.top", force=0.004, polygon=ramp), tmp_path / "stopped")
    assert found["contacts"]["foot"]["force"] == pytest.approx([-0.004, 0.01], rel=1e-6)
