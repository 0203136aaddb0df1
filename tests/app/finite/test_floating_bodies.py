"""Bodies at finite strain that turn about a hinge, and roll."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from tests.app.scenes import done, solve
from tests.case_text import annulus, disk, head, neo_hookean, pin, rubber, support


def test_a_lever_rests_about_its_hinge(tmp_path: Path) -> None:
    """Its weight and the force of a disk balance about the hinge, far from the middle of the lever."""
    text = head("strain", strain="finite") + neo_hookean("hard", 1e3, 0.3).body(
        "bar", "hard", 0.15, box=([-0.2, 4.0], [-0.2, 0.2])
    ).pin("bar", [0.0, 0.0], ux=0.0, uy=0.0).body_force("weight", "bar", [0.0, -0.5]).contact(
        "rest", "bar.bottom", disk=([3.0, -0.7], 0.5)
    ).probe("middle", "bar", [1.9, 0.0])
    summary = solve(text, tmp_path / "run")
    x, y = summary["contacts"]["rest"]["force"]
    weight, middle = 0.5 * 4.2 * 0.4, 1.9 + summary["probes"]["middle"]["displacement"][0]
    np.testing.assert_allclose(3.0 * y + 0.7 * x, weight * middle, rtol=2e-3)


def test_a_wheel_rolls_by_more_than_a_right_angle(tmp_path: Path) -> None:
    """On an axle of its own, turned by a road that is pressed against it and drawn along."""
    text = (
        rubber(3.0, 0.4)
        .body("wheel", "rubber", 0.2, disk=([0.0, 1.0], 1.0))
        .pin("wheel", [0.0, 1.0], ux=0.0, uy=0.0)
        .contact("road", "wheel.arc", plane=([0.0, 0.0], [0.0, 1.0]), friction=0.6)
        .pushed("lift", "road", uy=0.1)
        .pushed("drive", "road", ux=1.7)
        .stages("lift", "drive")
        .probe("rim", "wheel", [0.0, 2.0])
    )
    summary = solve(text, tmp_path / "run")
    x, y = summary["probes"]["rim"]["displacement"]
    angle = np.arctan2(-x, 1.0 + y) % (2.0 * np.pi)
    np.testing.assert_allclose(angle, 1.7, rtol=0.04)
    assert abs(summary["contacts"]["road"]["force"][0]) < 0.05 * summary["contacts"]["road"]["force"][1]


def test_a_loose_pin_falls_into_its_hole(tmp_path: Path) -> None:
    """Nothing holds it until it touches: its weight carries it no further than that."""
    text = rubber(3.0, 0.4) + neo_hookean("hard", 30.0, 0.3).body(
        "bush", "rubber", 0.2, annulus=([0.0, 0.0], [1.0, 1.5])
    ).body("pin", "hard", 0.2, disk=([0.0, 0.0], 0.9)).support("bush.outer", ux=0.0, uy=0.0).body_force(
        "weight", "pin", [0.0, -0.3]
    ).contact("bore", "pin.arc", "bush.inner").probe("middle", "pin", [0.0, 0.0])
    summary = solve(text, tmp_path / "run")
    np.testing.assert_allclose(
        summary["contacts"]["bore"]["force"], [0.0, 0.3 * np.pi * 0.81], rtol=2e-3, atol=1e-6
    )
    assert -0.2 < summary["probes"]["middle"]["displacement"][1] < -0.1


def test_a_wheel_held_at_a_single_node_is_told_of(tmp_path: Path) -> None:
    """Its force depends on the cloud; on a hub the same is sound."""
    rim = annulus([0.0, 0.0], [0.3, 1.0])
    for side, shape, hold in (
        ("arc", disk([0.0, 0.0], 1.0), pin("wheel", [0.0, 0.0], ux=0.0, uy=0.0)),
        ("outer", rim, support("wheel.inner", ux=0.0, uy=0.0)),
    ):
        text = rubber(3.0, 0.4).body("wheel", "rubber", 0.15, shape) + hold.contact(
            "road", f"wheel.{side}", plane=([0.0, -1.0], [0.0, 1.0])
        ).pushed("lift", "road", uy=0.06)
        summary = done(text, tmp_path / side)
        assert any("single nodes" in one for one in summary["warnings"]) is (side == "arc")


BLOCK = rubber(2.0, 0.35).body("block", "rubber", 0.12, box=([-1.0, 1.0], [0.0, 1.5]), clamped="bottom")


def test_a_plate_turned_by_a_large_angle(tmp_path: Path) -> None:
    """Forces of nine-node finite elements, 14 x 10, at a fifth and at the end."""
    text = BLOCK.load("p", "block.top", "platen", displacement=[0.0, -0.1], rotation=0.5)
    summary = solve(text, tmp_path / "run")
    assert summary["plates"]["block.top"]["rotation"] == 0.5
    np.testing.assert_allclose(summary["forces"]["p"], [0.3655, -0.6248], rtol=0.02)
    text = BLOCK.load("p", "block.top", "platen", displacement=[0.0, -0.02], rotation=0.1)
    np.testing.assert_allclose(solve(text, tmp_path / "part")["forces"]["p"], [0.0596, -0.0780], rtol=0.01)


def test_a_plate_under_forces_goes_where_it_takes_these_to_go(tmp_path: Path) -> None:
    """A plate driven by forces and a moment, and one that is moved as far: the same forces and moment."""
    forced = {"fx": 0.2, "fy": -0.4, "moment": 0.1, "hinge": [0.3, 1.5]}
    probe = '[[probe]]\nname = "hinge"\nbody = "block"\npoint = [0.3, 1.5]\n'
    text = BLOCK.load("p", "block.top", "platen", **forced) + probe
    driven = solve(text, tmp_path / "driven")
    assert driven["status"] == "done"
    np.testing.assert_allclose(driven["forces"]["p"], [0.2, -0.4], rtol=1e-8)
    turned = driven["plates"]["block.top"]
    assert turned["moment"] == pytest.approx(0.1, rel=1e-8)
    assert abs(turned["rotation"]) > 0.1
    moved = driven["probes"]["hinge"]["displacement"]
    given = {"displacement": moved, "rotation": turned["rotation"], "hinge": [0.3, 1.5]}
    back = solve(BLOCK.load("p", "block.top", "platen", **given), tmp_path / "given")
    np.testing.assert_allclose(back["forces"]["p"], [0.2, -0.4], rtol=5e-3)
    assert back["plates"]["block.top"]["moment"] == pytest.approx(0.1, rel=5e-3)


def test_one_plate_on_two_bodies_in_contact(tmp_path: Path) -> None:
    """Two alike columns under a force beside their middle bear what the balance of moments gives them."""
    text = rubber(2.0, 0.3).load("p", ["one.top", "other.top"], "platen", fx=0.0, fy=-0.2, hinge=[0.15, 0.6])
    for name, x in (("one", -1.0), ("other", 0.5)):
        text = text.body(name, "rubber", 0.15, box=([x, x + 0.5], [0.0, 0.6]))
        text = text.contact(name, f"{name}.bottom", plane=([0.0, 0.0], [0.0, 1.0]), friction=0.8)
    summary = done(text, tmp_path / "run")
    forces = [summary["contacts"][name]["force"][1] for name in ("one", "other")]
    assert sum(forces) == pytest.approx(0.2, rel=1e-7)
    # Springs at +-0.75 by a force at 0.15: their bending and the turn of the plate change that a little.
    assert forces[1] / forces[0] == pytest.approx(1.5, rel=0.1)
