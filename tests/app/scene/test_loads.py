"""Loads, springs and materials in whole runs, against solutions that the method reproduces exactly; forces
and moments that are spread over bodies and boundaries."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from mlsanm_cli.app.check import check
from mlsanm_cli.io.run_reader import read_run
from tests.app.blocks import BOTTOM, CLAMP, HEAT, LEFT, PINS, WEIGHT, WOOD, Result, block, traction
from tests.app.scenes import PATCH, Quiet, done, refused, solve
from tests.case_text import Scene, box, head, load, support


def test_body_force_against_a_platen(tmp_path: Path) -> None:
    # Nothing but the platen resists the weight: it carries exactly that and what is applied to it.
    plate = load("plate", "block.bottom", "platen", uy=0.01)
    found = Result(block(LEFT, plate, WEIGHT), tmp_path / "run")
    np.testing.assert_allclose(found.forces["plate"], [0.0, 6.0], atol=1e-11)


@pytest.mark.parametrize("stiffness", [0.1, 50.0, 1e7])
def test_winkler_foundation(stiffness: float, tmp_path: Path) -> None:
    foundation = support("block.bottom", spring=[0.0, stiffness])
    text = block(LEFT, foundation, traction("top", 0.0, -8.0), plane="stress")
    found = Result(text, tmp_path / "run")
    x, y = found.points.T
    expected = np.stack([0.25 * 8.0 / 200.0 * x, -8.0 / stiffness - 8.0 / 200.0 * y], axis=1)
    assert np.abs(found.displacement - expected).max() <= 1e-8 * np.abs(expected).max()
    assert np.abs(found.stress - [0.0, -8.0, 0.0]).max() <= 1e-8 * 8.0
    np.testing.assert_allclose(found.forces["block.bottom"], [0.0, 16.0], rtol=1e-8, atol=1e-8)
    assert found.summary["force_balance"] <= 1e-8


@pytest.mark.parametrize("stiffness", [1e9, 50.0, 1.0])
def test_a_beam_on_springs_at_its_end(stiffness: float, tmp_path: Path) -> None:
    # Springs far stiffer than the beam clamp it. Soft ones turn by M / (k I) and move by F / k beyond that.
    beam = block(traction("right", 0.0, -1.0), plane="stress", spacing=0.1, box=([0.0, 4.0], [0.0, 1.0]))
    tips = []
    for number, held in enumerate((CLAMP, support("block.left", spring=[stiffness, stiffness]))):
        found = Result(beam + held, tmp_path / f"run{number}")
        at = np.isclose(found.points, [4.0, 1.0]).all(axis=1)
        tips.append(float(found.displacement[at, 1][0]))
        np.testing.assert_allclose(found.forces["block.left"], [0.0, 1.0], atol=0.01)
        assert found.summary["force_balance"] <= 0.01
    rigid = (1.0 + 4.0 * 4.0 * 12.0) / stiffness
    assert tips[1] == pytest.approx(tips[0] - rigid, rel=0.005)


def test_springs_share_a_force_with_a_platen(tmp_path: Path) -> None:
    # A rigid shift: the platen's force goes into the springs alone.
    foundation = support("block.bottom", spring=[4.0, 0.0])
    push = load("push", "block.top", "platen", fx=2.4)
    found = Result(block(BOTTOM, foundation, push, WEIGHT), tmp_path / "run")
    np.testing.assert_allclose(found.forces["push"], [2.4, 0.0], atol=1e-12)
    assert found.forces["block.bottom"][0] == pytest.approx(-2.4, abs=1e-9)


def test_tractions_by_expression_and_by_table(tmp_path: Path) -> None:
    # Pure bending: sigma_xx = 12 y - 6, quadratic displacements. The right side runs upward.
    (tmp_path / "bending.csv").write_text("s, tx, ty\n0.0, -6.0, 0.0\n1.0, 6.0, 0.0\n")
    table = load("right", "block.right", "traction", table="bending.csv")
    pressure = load("left", "block.left", "pressure", pressure="6 - 12*y")
    found = Result(block(PINS, table, pressure, plane="stress"), tmp_path / "run")
    bending = 12.0 * found.points[:, 1] - 6.0
    assert np.abs(found.stress - np.outer(bending, [1.0, 0.0, 0.0])).max() <= 1e-8 * 6.0
    np.testing.assert_allclose(found.forces["right"], [0.0, 0.0], atol=1e-12)


def test_a_displacement_in_one_direction_by_expression(tmp_path: Path) -> None:
    parts = LEFT.pin("block", [0.0, 0.0], uy=0.0).load("pull", "block.right", "displacement", ux="0.1*y")
    found = Result(block(parts, plane="stress", material={"E": 200.0, "nu": 0.0}), tmp_path / "run")
    # u_x = x y / 20, u_y = -x^2 / 40: bending, without Poisson's ratio.
    x, y = found.points.T
    expected = np.stack([0.05 * x * y, -0.025 * x**2], axis=1)
    assert np.abs(found.displacement - expected).max() <= 1e-8


def test_all_kinds_survive_their_resolved_file(tmp_path: Path) -> None:
    (tmp_path / "sides.csv").write_text("s,pressure\n0.0, 1.0\n1.0, 2.0\n")
    foundation = support("block.bottom", spring=[1.0, 2.0])
    push = load("push", "block.top", "pressure", pressure="1 + x")
    table = load("side", "block.right", "pressure", table="sides.csv")
    text = block(foundation, push, table, WEIGHT, HEAT, material=WOOD)
    first = Result(text, tmp_path / "first")
    second = Result((tmp_path / "first" / "resolved.toml").read_text(), tmp_path / "second")
    assert (second.displacement == first.displacement).all()
    one, other = ((tmp_path / name / "resolved.toml").read_text() for name in ("first", "second"))
    assert one == other
    assert first.summary["force_balance"] <= 1e-3


def push(**keys: Any) -> Scene:
    return block(LEFT, BOTTOM).load("push", "block.top", "pressure", **keys)


@pytest.mark.parametrize(
    ("keys", "words"),
    [
        ({"pressure": "1 / (x - 2)"}, "divides by zero at (2, 1)"),
        ({"pressure": "log(x)"}, "has no value at (0, 1)"),
        ({"pressure": "sqrt(x - 0.5)"}, "has no value"),
        ({"table": [[0, 1], [1.9, 1]]}, "goes from 0 to 1.9, the boundary from 0 to 2"),
        ({"table": [[0.1, 1], [2, 1]]}, "goes from 0.1"),
    ],
)
def test_values_that_the_boundary_does_not_have(keys: dict[str, Any], words: str, tmp_path: Path) -> None:
    (key,) = keys
    problem = refused(push(**keys), tmp_path / "run", f"load.push.{key}", words)
    assert problem.source == str(tmp_path / "run.toml")
    line = (tmp_path / "run.toml").read_text().splitlines()[problem.line - 1]
    assert line.startswith(f"{key} = ")


def test_tables_run_along_the_boundary_with_the_material_on_the_left(tmp_path: Path) -> None:
    # The top runs from x = 2 to x = 0.
    text = push(table=[[0, 2], [2, 0]])
    found = Result(text, tmp_path / "run")
    np.testing.assert_allclose(found.forces["push"], [0.0, -2.0], atol=1e-12)
    top = found.points[:, 1] == 1.0
    middle = top & (np.abs(found.points[:, 0] - 1.0) < 0.7)
    np.testing.assert_allclose(found.stress[middle, 1], -found.points[middle, 0], atol=0.1)


def test_check_tells_what_acts_where(tmp_path: Path) -> None:
    case = tmp_path / "case.toml"
    case.write_text(push(pressure="1 + x").support("block.right", spring=[2.0, 0.0]) + WEIGHT + HEAT)
    told = check(case, console=Quiet())["boundaries"]
    assert told["block.top"]["y"] == "pressure 1 + x (push)"
    assert told["block.right"] == {"x": "spring 2", "y": "free"}
    assert told["block"]["y"] == "body-force -3 (weight), temperature 5 (heat)"


def test_contact_under_weight_and_heat(tmp_path: Path) -> None:
    # Two blocks that fit between two walls, heated; then the weight of the upper one. Without Poisson's ratio
    # all is one-dimensional.
    blocks = PATCH.changed("nu = 0.3", "nu = 0.0\nalpha = 1e-5").changed("fy = -200.0", "uy = 0.0")
    text = blocks.changed('[reference]\nsolution = "uniform-pressure"\n', "")
    text = text.heat("heat-upper", "upper", 100.0).heat("heat-lower", "lower", 100.0)
    text = text.body_force("weight", "upper", [0.0, -3.0])
    text = text.stages("press heat-upper heat-lower", "weight")
    summary = done(text, tmp_path / "run")
    assert summary["force_balance"] <= 1e-9
    data = read_run(tmp_path / "run")
    pressure = data.contacts["interface"].pressure
    hot = pressure[np.asarray(data.path.position) == 1.0]
    np.testing.assert_allclose(hot, 210.0, rtol=1e-6)
    # Half of the weight stands on the lower block, half hangs from the wall.
    np.testing.assert_allclose(pressure[-1:] - hot, 0.75, atol=1e-4)
    assert summary["forces"]["press"][1] == pytest.approx(-2.0 * 210.0 + 6.0 - 1.5, rel=1e-9)


BAR = head("stress").material("m", E=1000.0, nu=0.3)
STRIP = BAR.body("bar", "m", 0.2, box([0.0, 10.0], [0.0, 1.0])).support("bar.left", ux=0.0)
STRIP = STRIP.pin("bar", [0.0, 0.5], uy=0.0).item("probe", name="tip", body="bar", point=[10.0, 0.5])
HOLLOW = BAR.body("bar", "m", annulus=([3.0, -2.0], [0.5, 2.0])).support("bar.inner", ux=0.0, uy=0.0)


def force(text: Scene, **keys: object) -> Scene:
    return text.item("load", name="pull", kind="force", **keys)


def test_a_moment_on_a_boundary_bends_a_strip(tmp_path: Path) -> None:
    """u_y = M L^2 / (2 E I), u_x = F L / (E A)."""
    text = force(STRIP, boundary="bar.right", moment=0.1, fx=0.5)
    moved = solve(text, tmp_path / "run")["probes"]["tip"]["displacement"]
    np.testing.assert_allclose(moved, [0.005, 0.06], rtol=1e-6)


@pytest.mark.parametrize("place", [{"body": "bar"}, {"boundary": "bar.outer"}], ids=["body", "boundary"])
def test_the_support_carries_what_is_given(tmp_path: Path, place: dict[str, str]) -> None:
    summary = solve(force(HOLLOW, force=[0.3, -0.2], moment=0.5, **place), tmp_path / "run")
    np.testing.assert_allclose(summary["forces"]["bar.inner"], [-0.3, 0.2], rtol=1e-4)


def test_a_moment_shears_a_ring(tmp_path: Path) -> None:
    """tau = M / (2 pi r^2) at the distance r = 1 from the centre, if it acts further outside."""
    text = force(HOLLOW, boundary="bar.outer", moment=0.5).item(
        "probe", name="middle", body="bar", point=[4.0, -2.0]
    )
    probe = solve(text, tmp_path / "run")["probes"]["middle"]
    np.testing.assert_allclose(probe["stress"], [0.0, 0.0, 0.5 / (2.0 * np.pi)], atol=2e-3)


def test_a_part_of_a_boundary(tmp_path: Path) -> None:
    part = force(HOLLOW, boundary="bar.outer", from_=[5.0, -2.0], to=[3.0, 0.0], fy=1.0)
    assert solve(part, tmp_path / "run")["forces"]["bar.inner"][1] == pytest.approx(-1.0, rel=1e-9)


def test_a_ring_of_revolution_carries_the_force_of_the_full_turn(tmp_path: Path) -> None:
    text = HOLLOW.changed('"stress"', '"axisymmetric"')
    for place in ({"body": "bar"}, {"boundary": "bar.outer"}):
        summary = solve(force(text, fy=1.0, **place), tmp_path / next(iter(place)))
        assert summary["forces"]["bar.inner"][1] == pytest.approx(-1.0, rel=1e-6)
