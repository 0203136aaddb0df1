"""Rigid obstacles pressed deep into bodies at finite strain, and dragged along them."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from mlsanm_cli.app.comparison.compare import compare
from mlsanm_cli.app.results.path_lookup import along_surface
from mlsanm_cli.app.results.probe import probe_contact, probe_force
from mlsanm_cli.errors import RunError
from mlsanm_cli.io.run_reader import read_path, read_run
from mlsanm_cli.mechanics.laws.law import law_class
from tests.app.output.test_paraview import area, listed, read
from tests.app.runs import warned
from tests.app.scenes import Quiet, done, solve
from tests.case_text import Scene, disk, load, plane, pushed, rubber, support

CASES = Path(__file__).parents[3] / "cases"

FINE = {"at": [0.0, 2.0], "spacing": 0.05, "radius": 0.75, "growth": 0.15}
DISK = disk([0.0, 3.0], 1.0)


def block(
    obstacle: Any, depth: float, refine: Any = None, left: float = 0.0, ux: Any = 0.0, friction: Any = None
) -> Scene:
    """A block, or half of it, on whose top an obstacle is pressed; held sideways at its bottom by ``ux``."""
    fine = None if refine is None else [refine]
    return (
        rubber(2.6, 0.3)
        .body("block", "rubber", 0.25, box=([left, 2.0], [0.0, 2.0]), refine=fine)
        .support("block.bottom", ux=ux, uy=0.0)
        .pushed("press", "under", uy=depth)
        .contact("under", "block.top", obstacle=obstacle, friction=friction)
    )


SQUEEZED = (
    rubber(2.6, 0.3)
    .body("ring", "rubber", 0.2, disk=([0.0, 1.0], 1.0))
    .pushed("close", "lid", uy=-0.2)
    .contact("floor", "ring.arc", plane=([0.0, 0.0], [0.0, 1.0]), friction=0.1)
    .contact("lid", "ring.arc", plane=([0.0, 2.0], [0.0, -1.0]), friction=0.1)
    .table("output", at=[1.0])
)
SIDE = support("block.left", ux=0.0)


def shown_at_the_end(directory: Path) -> tuple[dict[str, Any], dict[str, Any]]:
    """Bodies, and surfaces in contact with obstacles, of the last saved state as ParaView sees them."""
    found: list[dict[str, Any]] = []
    for kind in ("fields", "contacts"):
        entries = listed(directory / f"{kind}.pvd")
        last = [entry for entry in entries if entry["timestep"] == entries[-1]["timestep"]]
        found.append({entry["name"]: read(directory / entry["file"]) for entry in last})
    return found[0], found[1]


def test_cylinder_pressed_by_a_force(tmp_path: Path) -> None:
    """Under the force that it takes to press it in by a fifth of its radius, it goes there."""
    text = block(DISK, -1.0, FINE) + SIDE.probe("under", "block", [0.0, 2.0])
    summary = done(text.replace("uy = -1.0", "fy = -0.20485"), tmp_path / "run")
    assert summary["contacts"]["under"]["force"][1] == pytest.approx(-0.20485, rel=1e-8)
    assert summary["probes"]["under"]["displacement"][1] == pytest.approx(-0.2, rel=5e-3)


@pytest.mark.parametrize("degree", [2, 4])
def test_a_plate_on_a_block_up_to_its_corners(degree: int, tmp_path: Path) -> None:
    """A clamped block pressed down by three tenths, against nine-node finite elements (16 x 8)."""
    text = (
        rubber(2.0, 0.35)
        .body("block", "rubber", 0.1, box=([-1.0, 1.0], [0.0, 1.0]), clamped="bottom")
        .pushed("down", "lid", uy=-0.3)
        .contact("lid", "block.top", plane=([0.0, 1.0], [0.0, -1.0]))
        .table("mls", degree=degree)
        .table("output", at=[0.25, 1.0])
    )
    summary = done(text, tmp_path / "run")
    assert summary["stability"] >= 0.8
    forces = [row["fy"] for row in probe_force(tmp_path / "run", [0.25, 1.0], "lid")]
    assert forces[0] == pytest.approx(-0.3967, rel=0.01)
    # The clamped corners: 2.035 with half of the spacing.
    assert forces[1] == pytest.approx(-2.009, rel=0.04)


@pytest.mark.parametrize(
    ("poisson", "ux", "force", "accuracy"), [(0.44, 0.0, -0.612, 0.05), (0.3, 0.2, -0.4423, 0.012)]
)
def test_friction_up_to_corners(
    poisson: float, ux: float, force: float, accuracy: float, tmp_path: Path
) -> None:
    """Forces are those of blocks bonded to the lid, with nodes eight times finer at all corners."""
    text = (
        rubber(1.0, poisson)
        .body("block", "rubber", None, box=([0.0, 1.0], [0.0, 1.0]), clamped="bottom")
        .pushed("down", "lid", ux=ux, uy=-0.3)
        .contact("lid", "block.top", plane=([0.0, 1.0], [0.0, -1.0]), friction=0.3)
    )
    summary = done(text, tmp_path / "run")
    lateral, down = summary["forces"]["down"]
    assert down == pytest.approx(force, rel=accuracy)
    if ux:
        assert summary["factorizations"] <= 40
    else:
        assert abs(lateral) <= 0.01 * abs(down)
        # Without the residual that renewed equations keep, 0.0394.
        assert summary["error_estimate"]["energy"] >= 0.042


def test_a_pad_that_friction_holds_alone(tmp_path: Path) -> None:
    """A trapezoid between plates, against 12 x 12 graded nine-node finite elements: 0.4827, falling."""
    points = [[-1.0, 0.0], [1.0, 0.0], [0.7, 0.6], [-0.7, 0.6]]
    shape = {"kind": "polygon", "points": points, "names": ["bottom", "right", "top", "left"]}
    text = (
        rubber(1.0, 0.4)
        .body("pad", "rubber", None, shape)
        .contact("floor", "pad.bottom", plane=([0.0, 0.0], [0.0, 1.0]), friction=0.4)
        .contact("lid", "pad.top", plane=([0.0, 0.6], [0.0, -1.0]), friction=0.4)
        .pushed("down", "lid", uy=-0.1)
    )
    summary = done(text, tmp_path / "run")
    assert summary["stability"] > 0.5
    lateral, down = summary["forces"]["down"]
    assert down == pytest.approx(-0.481, rel=0.015)
    assert abs(lateral) <= 0.004 * abs(down)


def test_plate_makes_an_even_state(tmp_path: Path) -> None:
    """A smooth plate on a block on a smooth base: even strains, the pressure Cauchy's stress."""
    directory = tmp_path / "run"
    text = block(plane([0.0, 2.0], [0.0, -3.0]), -0.6, ux=None) + SIDE
    summary = done(text, directory)
    state = read_run(directory).states[-1].bodies["block"]
    across, along = state["stretch"].T
    np.testing.assert_allclose(along, 0.7, rtol=1e-8)
    np.testing.assert_allclose(across, across[0], rtol=1e-8)
    law = law_class("neo-hookean")(E=2.6, nu=0.3, plane="strain")
    gradient = np.array([across[0] - 1.0, 0.0, 0.0, -0.3])[:, None]
    xx, yy, _, _ = law.state(gradient).cauchy[:, 0]
    assert abs(xx) <= 1e-7
    pressure = probe_contact(directory, [1.0], "under")[0]["pressure"]
    np.testing.assert_allclose(pressure, -yy, rtol=1e-6)
    with pytest.raises(RunError, match="nothing to compare"):
        compare(directory.with_suffix(".toml"), methods=("newton",), out=tmp_path / "c", console=Quiet())
    np.testing.assert_allclose(summary["contacts"]["under"]["force"], [0.0, 2.0 * across[0] * yy], atol=1e-7)


def test_dissipated_work_does_not_depend_on_the_increments(tmp_path: Path) -> None:
    """A cylinder pressed in and moved aside by less than it slips: with few increments, with ten more."""
    text = (
        block(DISK, -0.05, FINE, -2.0, friction=0.5)
        .pushed("aside", "under", ux=0.02)
        .stages("press", "aside")
    )
    works = [
        done(text.table("output", at=at), tmp_path / str(len(at)))["contacts"]["under"]["dissipated_work"]
        for at in ([1.0, 2.0], [1.0, *np.linspace(1.1, 2.0, 10).tolist()])
    ]
    assert works[0] == pytest.approx(works[1], rel=0.025)


def test_a_profile_of_points_is_as_good_as_the_disk_it_is_of(tmp_path: Path) -> None:
    """Dragged with friction too; and corners of a profile are pressed in."""
    angle = np.linspace(-1.2, 1.2, 49)
    points = np.stack([np.sin(angle) - 0.3, 3.0 - np.cos(angle)], axis=1).tolist()
    top = {"along": "top", "spacing": 0.16, "radius": 0.05, "growth": 0.3}
    moved = pushed("drag", "under", ux=0.15).stages("press", "drag")
    round_one, profile = (
        done(block(shape, -0.1, top, -2.0, friction=0.3) + moved, tmp_path / shape["kind"])
        for shape in (disk([-0.3, 3.0], 1.0), {"kind": "polyline", "points": points})
    )
    expected, found = (one["contacts"]["under"] for one in (round_one, profile))
    np.testing.assert_allclose(found["force"], expected["force"], rtol=1e-5)
    assert found["dissipated_work"] == pytest.approx(expected["dissipated_work"], rel=1e-3)
    punch = {"kind": "polyline", "points": [[-1.0, 2.8], [-0.4, 2.0], [0.4, 2.0], [1.0, 2.8]]}
    summary = done(block(punch, -0.2, top) + SIDE, tmp_path / "punch")
    assert summary["contacts"]["under"]["min_gap"] >= -1e-9
    assert summary["force_balance"] <= 1e-6


def test_ironing_without_friction(tmp_path: Path) -> None:
    """A stiff tool dragged by three contact widths feels the same vertical force and no other."""
    directory = tmp_path / "run"
    done((CASES / "ironing.toml").read_text(), directory)
    forces = [[row["fx"], row["fy"]] for row in probe_force(directory, [1.0, 1.25, 1.5, 1.75, 2.0], "iron")]
    across, up = np.array(forces).T
    assert np.abs(across).max() <= 5e-3 * up.mean()
    np.testing.assert_allclose(up, up.mean(), rtol=0.01)
    filled, lines = shown_at_the_end(directory)
    for name, count in (("base", 4.4 * 1.5), ("tool", 0.5 * np.pi)):
        mesh = filled[name]
        parts = area(mesh.points, mesh.cells_dict["triangle"])
        assert parts.sum() == pytest.approx(count, rel=0.02)
    # Pressures stand on the softer side, and are told as they act on the case's slave, the tool.
    data, (line,) = lines["contacts"].point_data, lines["contacts"].cells
    assert line.type == "line"
    moved = (lines["contacts"].points + data["displacement"])[:, :2]
    stress = data["contact_stress"][:, :2]
    middle, length = 0.5 * (stress[1:] + stress[:-1]), np.hypot(*np.diff(moved, axis=0).T)
    np.testing.assert_allclose(length @ middle, forces[-1], atol=0.01 * up[-1])
    np.testing.assert_allclose(data["pressure"], (stress * data["normal"][:, :2]).sum(axis=1), atol=1e-2)


def test_a_roller_that_turns_on_the_spot(tmp_path: Path) -> None:
    """Its moment is what friction bears on its radius, and does the work that friction dissipates."""
    text = block(DISK, -0.1, {**FINE, "radius": 0.4, "growth": 0.3}, -2.0, friction=0.3)
    text += pushed("turn", "under", rotation=0.5).stages("press", "turn")
    directory = tmp_path / "run"
    summary = done(text.table("output", at=[1.5, 2.0]), directory)
    found = summary["contacts"]["under"]
    across, down = found["force"]
    assert found["max_cone_ratio"] == pytest.approx(1.0)
    # Turning counter-clockwise the roller pushes the block below it to the right.
    assert across == pytest.approx(-0.3 * down, rel=0.06)
    assert found["moment"] == pytest.approx(-0.3 * down, rel=0.03)
    run = read_run(directory)
    work, half = run.contacts["under"].dissipated_work, int(np.argmin(np.abs(run.path.position - 1.5)))
    assert work[-1] - work[half] == pytest.approx(found["moment"] * 0.25, rel=0.02)


def test_a_plate_that_has_turned_is_one_drawn_so(tmp_path: Path) -> None:
    """Turned before it touches, about a point off it."""
    forces: list[list[float]] = []
    for angle in (0.0, 0.2):
        normal = [float(np.sin(0.1 - angle)), -float(np.cos(0.1 - angle))]
        turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
        point = np.array([1.0, 3.0]) + turn.T @ np.array([-1.0, -0.7])
        text = block(plane(point.tolist(), normal), -0.6, left=-2.0)
        text += pushed("turn", "under", rotation=angle, pivot=[1.0, 3.0]) if angle else ""
        text = text.stages(*(("turn", "press") if angle else ("press",)))
        forces.append(solve(text, tmp_path / str(angle))["contacts"]["under"]["force"])
    assert abs(forces[0][1]) > 0.1
    np.testing.assert_allclose(forces[1], forces[0], rtol=1e-6)


def test_a_disk_pressed_where_its_arc_begins(tmp_path: Path) -> None:
    """At its top: half-width and picture are of one stretch, not of all that is between its halves."""
    summary = solve(SQUEEZED, tmp_path / "run")
    widths = [summary["contacts"][name]["half_width"] for name in ("floor", "lid")]
    assert widths[1] == pytest.approx(widths[0], rel=0.3)
    assert 0.2 < widths[0] < 0.6
    path = read_path(tmp_path / "run")
    for axis, name in enumerate(("contact.lid.force_x", "contact.lid.force_y")):
        assert path[name][-1] == pytest.approx(summary["contacts"]["lid"]["force"][axis], rel=1e-9, abs=1e-9)
    contact = read_run(tmp_path / "run").contacts["lid"]
    order, arc = along_surface(contact, contact.pressure[-1])
    assert sorted(order.tolist()) == list(range(len(arc)))
    assert (np.diff(arc) > 0.0).all()
    assert np.ptp(arc[contact.pressure[-1][order] > 0.0]) < 1.5


def test_equations_that_no_state_near_solves_keep_their_residual(tmp_path: Path) -> None:
    """A bulb seal whose door is shut and slides: the residual acts as a load, which is told."""
    text = (
        rubber(3.0, 0.4)
        .body("bulb", "rubber", 0.3)
        .table("body.shape", kind="sector", center=[0.0, 0.0], radii=[4.0, 6.0], angles=[0.0, 180.0])
        .support(["bulb.start", "bulb.end"], ux=0.0, uy=0.0)
        .contact("door", "bulb.outer", friction=0.4, plane=([0.0, 6.0], [0.0, -1.0]))
        .pushed("shut", "door", uy=-2.0)
        .pushed("slide", "door", ux=1.0)
        .stages("shut", "slide")
    )
    summary = done(text, tmp_path / "run", "solver.max_increment=0.3")
    x, y = summary["contacts"]["door"]["force"]
    # Each load reports what it prescribes.
    assert [summary["forces"][load] for load in ("slide", "shut")] == [[x, 0.0], [0.0, y]]
    assert 0.0 < x <= 0.401 * abs(y)
    assert summary["error_estimate"]["energy"] > 0.1
    assert "energy_estimate" in warned(summary)


def test_a_pressure_that_follows_beside_a_contact(tmp_path: Path) -> None:
    """Its force is that on the chord of the side, whose upper end the plate has pressed down."""
    text = block(plane([0.0, 2.0], [0.0, -1.0]), -0.1)
    text += load("blow", "block.right", "pressure", pressure=0.05, follows=True)
    summary = done(text, tmp_path / "run")
    assert summary["forces"]["blow"][0] == pytest.approx(-0.05 * 1.9, rel=2e-3)
    assert summary["force_balance"] <= 1e-6
