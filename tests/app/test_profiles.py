"""Rigid profiles from tables: waves that touch in one place, small summits between nodes of grids."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.io.run_reader import read_run
from tests.app.scenes import Quiet, solve
from tests.case_text import body, box, contact, head, material, pushed, support

MODULUS = 70e3 / 0.91


def pressed(
    points: FloatArray, force: float, directory: Path, accuracy: float
) -> tuple[FloatArray, FloatArray]:
    """Places along x and pressures, in order, at the end of a run without warnings."""
    console, profile = Quiet(), {"kind": "polyline", "points": points.tolist()}
    text = (
        head("strain")
        + material("alloy", E=70e3, nu=0.3)
        + body("block", "alloy", shape=box([0.0, points[-1, 0]], [-2.0, 0.0]))
        + support("block.bottom", uy=0.0)
        + support("block.left", ux=0.0)
        + support("block.right", ux=0.0)
        + contact("face", "block.top", obstacle=profile, accuracy=accuracy)
        + pushed("press", "face", fy=-force)
    )
    summary = solve(text, directory, console=console)
    assert summary["status"] == "done", summary["stop_reason"]
    assert not console.warnings
    found = read_run(directory).contacts["face"]
    x = found.points[:, 0]
    order = np.argsort(x)
    return x[order], found.pressure[-1][order]


def test_a_wave_from_a_table_is_a_smooth_wave(tmp_path: Path) -> None:
    """Westergaard 1939: the corners of the table's polyline would have pressures without bound."""
    height, mean = 0.003, 30.0
    x = np.linspace(0.0, 1.0, 49)
    wave = np.column_stack([x, 0.5 * height * (1.0 + np.cos(2.0 * np.pi * x))])
    _, pressure = pressed(wave, mean, tmp_path, 0.01)
    full = 0.5 * np.pi * MODULUS * height
    assert abs(pressure.max() / (2.0 * np.sqrt(mean * full)) - 1.0) < 2e-3


def test_a_small_summit_apart_from_the_others_touches(tmp_path: Path) -> None:
    """Narrower than intervals and spacings there: neither means over wide hats nor nodes see it."""
    x = np.linspace(0.0, 2.0, 801)
    radius, force, at = 100.0, 40.0, 1.75
    wide = 2.0 * np.sqrt(force * radius / (np.pi * MODULUS))
    ratio = (at - 0.6) / wide
    gap = 0.5 * wide**2 / radius * (ratio * np.sqrt(ratio**2 - 1.0) - np.arccosh(ratio))
    summit = (gap + 1e-4) * np.exp(-(((x - at) / 0.02) ** 4))
    profile = np.column_stack([x, 0.5 * (x - 0.6) ** 2 / radius - summit])
    place, pressure = pressed(profile, force, tmp_path, 0.05)
    assert pressure[np.abs(place - at) < 0.02].max(initial=0.0) > 0.0
