"""Rigid plates at finite strain: turned by any angle, moved by forces and moments."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from tests.app.finite.finite_scenes import rubber
from tests.app.scenes import done, solve
from tests.case_text import body, box, contact, load, plane, support

BLOCK = (
    rubber(2.0, 0.35)
    + body("block", "rubber", 0.12, box([-1.0, 1.0], [0.0, 1.5]))
    + support("block.bottom", ux=0.0, uy=0.0)
)


def test_a_plate_turned_by_a_large_angle(tmp_path: Path) -> None:
    """Pressed by 0.1 and turned by half a radian by power series: forces of nine-node finite elements, 14 x
    10, at a fifth and at the end."""
    text = BLOCK + load("p", "block.top", "platen", displacement=[0.0, -0.1], rotation=0.5)
    summary = solve(text, tmp_path / "run")
    assert summary["plates"]["block.top"]["rotation"] == 0.5
    np.testing.assert_allclose(summary["forces"]["p"], [0.3655, -0.6248], rtol=0.02)
    text = BLOCK + load("p", "block.top", "platen", displacement=[0.0, -0.02], rotation=0.1)
    np.testing.assert_allclose(solve(text, tmp_path / "part")["forces"]["p"], [0.0596, -0.0780], rtol=0.01)


def test_a_plate_under_forces_goes_where_it_takes_these_to_go(tmp_path: Path) -> None:
    """A plate driven by forces and a moment, and one that is moved as far: the same forces and moment."""
    forced = {"fx": 0.2, "fy": -0.4, "moment": 0.1, "hinge": [0.3, 1.5]}
    probe = '[[probe]]\nname = "hinge"\nbody = "block"\npoint = [0.3, 1.5]\n'
    text = BLOCK + load("p", "block.top", "platen", **forced) + probe
    driven = solve(text, tmp_path / "driven")
    assert driven["status"] == "done"
    np.testing.assert_allclose(driven["forces"]["p"], [0.2, -0.4], rtol=1e-8)
    turned = driven["plates"]["block.top"]
    assert turned["moment"] == pytest.approx(0.1, rel=1e-8)
    assert abs(turned["rotation"]) > 0.1
    moved = driven["probes"]["hinge"]["displacement"]
    given = {"displacement": moved, "rotation": turned["rotation"], "hinge": [0.3, 1.5]}
    back = solve(BLOCK + load("p", "block.top", "platen", **given), tmp_path / "given")
    np.testing.assert_allclose(back["forces"]["p"], [0.2, -0.4], rtol=5e-3)
    assert back["plates"]["block.top"]["moment"] == pytest.approx(0.1, rel=5e-3)


def test_one_plate_on_two_bodies_in_contact(tmp_path: Path) -> None:
    """Two alike columns under a plate with a force beside its middle, on a rigid floor: each bears what the
    balance of moments gives it."""
    text = (
        rubber(2.0, 0.3)
        + "".join(
            body(name, "rubber", 0.15, box([x, x + 0.5], [0.0, 0.6]))
            for name, x in (("one", -1.0), ("other", 0.5))
        )
        + load("p", ["one.top", "other.top"], "platen", fx=0.0, fy=-0.2, hinge=[0.15, 0.6])
        + "".join(
            contact(name, f"{name}.bottom", obstacle=plane([0.0, 0.0], [0.0, 1.0]), friction=0.8)
            for name in ("one", "other")
        )
    )
    summary = done(text, tmp_path / "run")
    forces = [summary["contacts"][name]["force"][1] for name in ("one", "other")]
    assert sum(forces) == pytest.approx(0.2, rel=1e-7)
    # Springs at +-0.75 by a force at 0.15: their bending and the turn of the plate change that a little.
    assert forces[1] / forces[0] == pytest.approx(1.5, rel=0.1)
