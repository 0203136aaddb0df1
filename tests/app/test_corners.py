"""Contacts that end at corners of bodies: patch tests, punches, stacks, roles and walls."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from mlsanm_cli.io.run_reader import read_run
from tests.app.scenes import solve

BLOCK = """
format = 1
[model]
plane = "strain"
[material.one]
E = 1.0
nu = 0.3
[material.other]
E = 1.0
nu = 0.3
[[body]]
name = "block"
material = "one"
spacing = 0.5
[body.shape]
kind = "rectangle"
x = [-5.0, 5.0]
y = [0.0, 5.0]
"""
PRESSED = (
    BLOCK.replace("[material.other]\nE = 1.0\nnu = 0.3\n", "")
    + """
[[load]]
name = "press"
boundary = "block.top"
kind = "pressure"
pressure = "{pressure}"
[[contact]]
name = "foot"
slave = "block.bottom"
obstacle = {{ kind = "plane", point = [0.0, 0.0], normal = [0.0, 1.0] }}
regularization = {{ law = "exact" }}
"""
)
PUNCH = (
    BLOCK
    + """
[[body]]
name = "base"
material = "other"
spacing = 5.0
[body.shape]
kind = "rectangle"
x = [-50.0, 50.0]
y = [-50.0, 0.0]
[[support]]
boundary = "base.bottom"
ux = 0.0
uy = 0.0
[[load]]
name = "press"
boundary = "block.top"
kind = "platen"
force = [0.0, -0.01]
[[contact]]
name = "foot"
slave = "block.bottom"
master = "base.top"
regularization = {{ law = "exact" }}
"""
)


def pressures(directory: Path, at: list[float]) -> list[float]:
    """Final pressures at places along x."""
    found = read_run(directory).contacts["foot"]
    order = np.argsort(found.points[:, 0])
    return [float(v) for v in np.interp(at, found.points[order, 0], found.pressure[-1][order])]


def test_a_whole_side_under_uniform_pressure(tmp_path: Path) -> None:
    solve(PRESSED.format(pressure="0.01"), tmp_path / "run")
    found = read_run(tmp_path / "run").contacts["foot"].pressure[-1]
    assert found == pytest.approx(0.01, rel=1e-6)


def test_uneven_pressure_up_to_the_corners(tmp_path: Path) -> None:
    """On clouds of 200 and of 800 nodes alike."""
    text = PRESSED.format(pressure="0.01 * (1 + 0.5 * cos(pi * x / 5))")
    coarse = solve(text, tmp_path / "coarse", "mls.degree=4")
    solve(text, tmp_path / "fine", "body.block.spacing=0.25", "mls.degree=4")
    at = [-4.9, -4.0, -2.0, 0.0, 1.0, 3.0, 4.5]
    one, other = (pressures(tmp_path / name, at) for name in ("coarse", "fine"))
    assert one == pytest.approx(other, rel=4e-3)
    assert coarse["contacts"]["foot"]["force"][1] == pytest.approx(0.1, rel=1e-8)


@pytest.mark.parametrize("stiffer", [0.1, 1000.0])
def test_an_elastic_punch_whatever_the_roles(stiffer: float, tmp_path: Path) -> None:
    text = PUNCH.format().replace("E = 1.0", f"E = {stiffer}", 1)
    one = solve(text, tmp_path / "one")
    turned = text.replace(
        'slave = "block.bottom"\nmaster = "base.top"', 'slave = "base.top"\nmaster = "block.bottom"'
    )
    solve(turned, tmp_path / "other")
    at = [-4.5, -2.0, 0.0, 2.0, 4.0]
    found = pressures(tmp_path / "one", at)
    assert pressures(tmp_path / "other", at) == pytest.approx(found, rel=1e-6)
    assert found[1] == pytest.approx(found[3], rel=2e-3)
    assert one["force_balance"] < 1e-8
    if stiffer > 1.0:
        # A flat rigid punch on a half-plane: P / (pi sqrt(a^2 - x^2)) (Johnson 1985, section 2.8).
        expected = [0.01 / (np.pi * np.sqrt(25.0 - x * x)) for x in at]
        assert found == pytest.approx(expected, rel=0.015)


def test_a_wall_beside_the_contact(tmp_path: Path) -> None:
    """Half of a symmetric scene between rollers has the pressures of the whole."""
    text = PRESSED.format(pressure="0.01 * (1 + 0.5 * cos(pi * x / 5))")
    half = (
        text.replace("x = [-5.0, 5.0]", "x = [0.0, 5.0]") + '[[support]]\nboundary = "block.left"\nux = 0.0\n'
    )
    solve(text, tmp_path / "whole", "mls.degree=4")
    solve(half, tmp_path / "half", "mls.degree=4")
    at = [0.01, 1.0, 2.0, 3.0, 4.5]
    assert pressures(tmp_path / "half", at) == pytest.approx(pressures(tmp_path / "whole", at), rel=5e-3)


def test_a_block_pushed_until_it_slides(tmp_path: Path) -> None:
    """With little friction under a flat face sticking places are few, and hard to find."""
    text = (
        PUNCH.format()
        .replace(
            "[[contact]]",
            """
[[load]]
name = "push"
boundary = "block.top"
kind = "platen"
fx = 0.001
[[contact]]""",
        )
        .replace('slave = "block.bottom"', 'slave = "block.bottom"\nfriction = 0.05')
    )
    text += "[[stage]]\npress = 1.0\n[[stage]]\npush = 1.0\n"
    text = text.replace("force = [0.0, -0.01]", "fy = -0.01")
    found = solve(text, tmp_path / "run")
    assert found["stop_reason"].startswith("the contact slides as a whole")
    assert found["position"] == pytest.approx(1.5, abs=1e-3)
