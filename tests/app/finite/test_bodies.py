"""Bodies in contact with each other at finite strain."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from mlsanm_cli.io.run_reader import read_run
from tests.app.scenes import done, solve
from tests.case_text import (
    Scene,
    body,
    box,
    contact,
    head,
    load,
    neo_hookean,
    polygon,
    pushed,
    rubber,
    support,
)

HEAD = rubber(2.6, 0.3)


def disk_on_block(depth: float, radius: float, base: dict[str, Any], friction: float | None = None) -> Scene:
    """Half a disk pressed on a block with fine nodes on its ``base``, its own within a ``radius``."""
    fine = {"at": [0.0, 2.0], "spacing": 0.05, "radius": radius, "growth": 0.2}
    return (
        HEAD.body("disk", "rubber", 0.25, half_disk=([0.0, 3.0], 1.0), refine=[fine])
        .body(
            "block",
            "rubber",
            0.3,
            box=([-2.0, 2.0], [0.0, 2.0]),
            refine=[{"growth": 0.2, **base}],
            clamped="bottom",
        )
        .load("press", "disk.flat", "displacement", displacement=[0.0, -depth])
        .contact("touch", "disk.arc", "block.top", friction=friction)
    )


def stack(*names: str, joined: bool = True) -> Scene:
    """Blocks of 1 x 1 between smooth plates, from below, compressed by 15 %."""
    spacings = (0.25, 0.19, 0.22)
    text = HEAD.support(f"{names[0]}.bottom", uy=0.0)
    for number, name in enumerate(names):
        text += body(name, "rubber", spacings[number], box([0.0, 1.0], [number, number + 1.0]))
        text += support(f"{name}.left", ux=0.0)
    for low, high in pairwise(names if joined else ()):
        text += contact(f"{low}-{high}", f"{high}.bottom", f"{low}.top")
    return text.load("press", f"{names[-1]}.top", "displacement", uy=-0.15 * len(names))


@pytest.mark.parametrize("names", [("low", "high"), ("low", "high", "top")])
def test_even_state_through_unlike_clouds(names: tuple[str, ...], tmp_path: Path) -> None:
    """Blocks between smooth plates are stretched as one; contacts alone hold the middle one of three."""
    directory = tmp_path / "run"
    summary = done(stack(*names), directory)
    for name in names:
        stretch = read_run(directory).states[-1].bodies[name]["stretch"]
        np.testing.assert_allclose(stretch[:, 1], 0.85, rtol=1e-6)
        np.testing.assert_allclose(stretch[:, 0], stretch[0, 0], rtol=1e-6)
    assert summary["force_balance"] <= 1e-9


ROLLER = (
    HEAD.body("roller", "rubber", 0.3, disk=([0.0, 1.0], 1.0))
    .item("body.refine", along="arc", spacing=0.09, radius=0.05, growth=0.3)
    .pushed("press", "plate", uy=-0.1)
    .pushed("roll", "plate", ux=1.0)
    .contact("floor", "roller.arc", friction=0.5, plane=([0.0, 0.0], [0.0, 1.0]))
    .contact("plate", "roller.arc", friction=0.5, plane=([0.0, 2.0], [0.0, -1.0]))
    .stages("press", "roll")
    .probe("middle", "roller", [0.0, 1.0])
)


def test_a_roller_rolls(tmp_path: Path) -> None:
    """A disk that only a floor and a plate hold: its middle moves half as far as the plate."""
    summary = done(ROLLER, tmp_path / "run")
    assert summary["probes"]["middle"]["displacement"][0] == pytest.approx(0.5, rel=3e-3)
    floor, plate = summary["contacts"]["floor"], summary["contacts"]["plate"]
    np.testing.assert_allclose(floor["force"], -np.array(plate["force"]), atol=1e-9)
    # Rolling takes next to nothing.
    assert abs(floor["force"][0]) <= 0.02 * floor["force"][1]
    assert floor["dissipated_work"] <= 2e-3 * floor["force"][1]


def test_what_no_contact_keeps_out_is_told(tmp_path: Path) -> None:
    """Without the contact the upper block is pushed into the lower one."""
    summary = solve(stack("low", "high", joined=False), tmp_path / "run")
    assert summary["status"] == "failed"
    told = summary["stop_reason"]
    assert "high.bottom lies inside low.top by" in told or "low.top lies inside high.bottom by" in told


def test_a_body_is_dragged_along_another(tmp_path: Path) -> None:
    """Half a disk along a block: no force is lost, and the work is what friction dissipates."""
    base = {"along": "top", "spacing": 0.07, "radius": 0.05, "growth": 0.25}
    summary = done(
        disk_on_block(0.06, 0.3, base, friction=0.2)
        .load("drag", "disk.flat", "displacement", displacement=[0.3, 0.0])
        .stages("press", "drag")
        .table("output", at=[1.0, 1.5, 2.0]),
        tmp_path / "run",
    )
    touch = summary["contacts"]["touch"]
    np.testing.assert_allclose(touch["force"], -np.array(touch["force_master"]), atol=1e-9)
    run = read_run(tmp_path / "run")
    slips = run.path.position >= 1.5
    work = -0.3 * float(
        np.trapezoid(run.path.resultants["contact touch"][slips, 0], run.path.position[slips])
    )
    lost = run.contacts["touch"].dissipated_work
    assert lost is not None
    assert work == pytest.approx(lost[-1] - lost[slips][0], rel=0.01)
    assert touch["force"][0] == pytest.approx(-0.2 * touch["force"][1], rel=0.05)


DIE = (
    head("strain", strain="finite")
    + neo_hookean("soft", 1.0, 0.3)
    + neo_hookean("hard", 100.0, 0.3)
    .body("base", "soft", 0.25, box=([-2.0, 2.0], [0.0, 1.0]))
    .body("die", "hard", 0.14, half_disk=([0.0, 2.0], 1.0))
    .support("base.bottom", ux=0.0, uy=0.0)
    .load("press", "die.flat", "displacement", displacement=[0.0, -0.15])
)


def test_slave_and_master_are_names_only_where_one_is_softer(tmp_path: Path) -> None:
    """The softer one carries the pressures; what is reported is as it acts on the slave of the case."""
    found = {}
    for slave, master in (("die.arc", "base.top"), ("base.top", "die.arc")):
        directory = tmp_path / slave
        summary = done(DIE.contact("c", slave, master), directory)
        assert summary["stability"] >= 0.8
        found[slave] = (summary["contacts"]["c"], read_run(directory).contacts["c"])
    (one, stored), (other, same) = found.values()
    np.testing.assert_allclose(one["force"], -np.array(other["force"]), atol=1e-9)
    np.testing.assert_allclose(one["force"], other["force_master"], atol=1e-9)
    assert one["force"][1] > 0.08
    np.testing.assert_allclose(stored.normal, -same.normal)
    np.testing.assert_allclose(stored.pressure, same.pressure, atol=1e-9)


def test_a_punch_with_sharp_corners(tmp_path: Path) -> None:
    """On a block that it only just touches at first, whose surface stays flat beneath it."""
    text = (
        head("strain", strain="finite")
        + neo_hookean("soft", 2.0, 0.3)
        + neo_hookean("hard", 20.0, 0.3)
        .body("base", "soft", 0.25, box=([-3.0, 3.0], [0.0, 2.0]))
        .item("body.refine", along="top", spacing=0.12, radius=0.1, growth=0.3)
        .body("punch", "hard", 0.25, box=([-1.0, 1.0], [2.0, 3.0]))
        .item("body.refine", along="bottom", spacing=0.1, radius=0.1, growth=0.3)
        .support("base.bottom", ux=0.0, uy=0.0)
        .load("press", "punch.top", "displacement", displacement=[0.0, -0.3])
        .contact("c", "base.top", "punch.bottom", friction=0.2)
    )
    directory = tmp_path / "run"
    touch = done(text, directory)["contacts"]["c"]
    np.testing.assert_allclose(touch["force"], -np.array(touch["force_master"]), atol=1e-9)
    run = read_run(directory)
    pressed = run.contacts["c"].points[run.contacts["c"].pressure[-1] > 0.0]
    nodes, moved = run.bodies["base"].points, run.states[-1].bodies["base"]["displacement"]
    edge = pressed[np.argmax(pressed[:, 0])]
    low = (nodes + moved)[(np.abs(nodes[:, 0]) < 0.95) & (nodes[:, 1] == 2.0), 1]
    assert np.ptp(low) <= 0.02
    assert edge[0] == pytest.approx(1.0, abs=0.15)


def test_a_side_of_several_pieces(tmp_path: Path) -> None:
    """A cylinder pressed into the joint of two pieces of one side, slave or master, against one piece."""
    fine = [{"at": [0.0, 2.0], "spacing": 0.15, "radius": 0.5, "growth": 0.4}]
    corners = [[-2.0, 2.0], [-2.0, 0.0], [2.0, 0.0], [2.0, 2.0]]
    one_piece = polygon(corners, "left bottom right top")
    two_pieces = polygon([*corners, [0.0, 2.0]], "left bottom right east west")
    forces: list[list[float]] = []
    for shape, side in ((one_piece, "block.top"), (two_pieces, ["block.east", "block.west"])):
        parts = HEAD.body("block", "rubber", 0.4, shape, refine=fine)
        parts += support("block.bottom", ux=0.0, uy=0.0)
        rigid = contact("c", side, disk=([0.0, 3.0], 1.0), friction=0.3)
        rigid += pushed("press", "c", uy=-0.1)
        soft = neo_hookean("softer", 1.0, 0.3).body("disk", "softer", 0.2, half_disk=([0.0, 3.0], 1.0))
        soft += load("press", "disk.flat", "displacement", displacement=[0.0, -0.1])
        soft += contact("c", "disk.arc", side)
        runs = [done(parts + more, tmp_path / f"{len(forces)}{k}") for k, more in enumerate((rigid, soft))]
        forces.append([one["contacts"]["c"]["force"][1] for one in runs])
    np.testing.assert_allclose(forces[1], forces[0], rtol=2e-3)


def test_sliding_without_memory_takes_long_steps(tmp_path: Path) -> None:
    """A hook pushed over a cam with friction: all that touches slides one way."""
    points = [[0.0, 0.0], [8.0, 0.0], [8.0, -1.0], [9.5, 0.3], [9.5, 1.0], [0.0, 1.0]]
    arm = polygon(points, "under catch nose tip top root") | {"rounding": [0.0, 0.1, 0.15, 0.1, 0.0, 0.0]}
    text = (
        head("strain", strain="finite")
        .material("plastic", E=2000.0, nu=0.35, law="saint-venant-kirchhoff")
        .body("arm", "plastic", 0.25, arm, clamped="root")
        .contact("cam", "arm.nose", disk=([11.0, -1.2], 0.9), friction=0.2)
        .pushed("pass", "cam", ux=-3.0)
    )
    summary = done(text, tmp_path / "run")
    assert summary["steps"] <= 12
    across, up = summary["contacts"]["cam"]["force"]
    assert summary["contacts"]["cam"]["max_cone_ratio"] == pytest.approx(1.0, abs=1e-6)
    assert up > abs(across)


def test_a_pin_in_half_a_bearing(tmp_path: Path) -> None:
    """Contact over most of a short side, near its corners."""
    text = (
        head("strain", strain="finite")
        + neo_hookean("soft", 5.0, 0.3)
        + neo_hookean("hard", 50.0, 0.3)
        .body("pin", "hard", 0.15, half_disk=([0.0, 0.0], 1.0))
        .body("shell", "soft", 0.15)
        .table("body.shape", kind="sector", center=[0.0, 0.0], radii=[1.05, 2.0], angles=[180.0, 360.0])
        .support("shell.outer", ux=0.0, uy=0.0)
        .load("press", "pin.flat", "displacement", displacement=[0.0, -0.2])
        .contact("c", "pin.arc", "shell.inner", friction=0.1)
    )
    directory = tmp_path / "run"
    summary = done(text, directory)
    assert summary["stability"] >= 0.7
    # With half of the spacing, and a quarter of it.
    assert summary["contacts"]["c"]["force"][1] == pytest.approx(1.896, rel=0.012)
    pressure = read_run(directory).contacts["c"].pressure[-1]
    pressed = pressure[pressure > 0.0]
    top = int(np.argmax(pressed))
    # At degree 4 pressures fall by 0.022 of the peak at one node.
    assert (np.diff(pressed[: top + 1]) > -0.03 * pressed[top]).all()


def test_a_body_that_only_moves_is_in_balance(tmp_path: Path) -> None:
    """Carried along without touching anything: forces of round-off were said not to balance."""
    text = HEAD.body("block", "rubber", 0.25, box=([0.0, 1.0], [1.0, 2.0]))
    text += load("go", "block.top", "displacement", displacement=[3.0, 0.5])
    text += contact("c", "block.bottom", plane=([0.0, 0.0], [0.0, 1.0]))
    done(text, tmp_path / "run")
