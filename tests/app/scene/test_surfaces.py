"""Surfaces as users think of them: faces with rounded corners, parts of sides, pressures in contacts."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from mlsanm_cli.app.checks.references import read_case
from mlsanm_cli.app.scene.boundaries import Boundaries
from mlsanm_cli.app.scene.clouds import clouds
from mlsanm_cli.app.scene.contact_pairs import check_tips, pair
from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.errors import CaseError
from mlsanm_cli.io.run_reader import read_run
from tests.app.runs import warned
from tests.app.scene.test_imported import PULLED, polar_plate, write_gmsh
from tests.app.scenes import done, hertz, prepared, refused, solve
from tests.case.scenes import parse
from tests.case_text import EXACT, FLOOR, Scene, polygon, scene

HEAD = scene("strain", E=1000.0)
FOOT = ["pad.corner2", "pad.bottom", "pad.corner1"]


def pad(radius: float, slave: Any = FOOT, master: Any = "block.top", spacing: float | None = None) -> Scene:
    """A pad with two rounded corners on a block."""
    corners = [[-1.0, 0.0], [1.0, 0.0], [1.0, 1.5], [-1.0, 1.5]]
    shape = polygon(corners, "bottom right top left", rounding=[radius, radius, 0.0, 0.0])
    return (
        HEAD.body("pad", "steel", spacing, shape)
        .body("block", "steel", spacing, box=([-3.0, 3.0], [-3.0, 0.0]), clamped="bottom")
        .load("press", "pad.top", "platen", ux=0.0, fy=-5.0)
        .contact("foot", slave, master, accuracy=0.02, regularization=EXACT)
    )


def pressed(directory: Path, name: str) -> tuple[FloatArray, FloatArray]:
    """Points and final pressures of a contact."""
    found = read_run(directory).contacts[name]
    return found.points, found.pressure[-1]


def test_a_pad_touches_with_its_face_and_its_rounded_corners(tmp_path: Path) -> None:
    found = solve(pad(0.3), tmp_path / "pad")["contacts"]["foot"]
    swapped = solve(pad(0.3, "block.top", FOOT), tmp_path / "swapped")
    spacings = "body.pad.spacing=0.1", "body.block.spacing=0.25"
    fine = solve(pad(0.3), tmp_path / "fine", *spacings)["contacts"]["foot"]
    # The face ends at 0.7: contact continues into the arcs, a little.
    assert 0.7 < found["half_width"] < 0.73
    assert found["force"] == pytest.approx([0.0, 5.0], abs=2e-3)
    assert swapped["contacts"]["foot"]["peak_pressure"] == pytest.approx(found["peak_pressure"], rel=1e-6)
    assert fine["peak_pressure"] == pytest.approx(found["peak_pressure"], rel=5e-3)
    points, pressure = pressed(tmp_path / "pad", "foot")
    even = np.interp(-points[:, 0], points[:, 0], pressure)
    assert np.abs(even - pressure).max() < 0.02 * pressure.max()


@pytest.mark.parametrize("side", ["slave", "master"])
def test_sides_that_face_nobody_change_nothing(side: str, tmp_path: Path) -> None:
    """At a corner only the side that faces the other body receives pressures, on slaves and on masters."""
    names = {"slave": "block.top", "master": "block.top", side: ["pad.left", "pad.bottom", "pad.right"]}
    joined = solve(pad(0.0, **names, spacing=0.2), tmp_path / "run")
    assert joined["force_balance"] < 1e-9
    up = 5.0 if side == "slave" else -5.0
    assert joined["contacts"]["foot"]["force"] == pytest.approx([0.0, up], abs=1e-6)


def test_a_disk_rests_on_both_sides_of_an_elastic_groove_of_one_name(tmp_path: Path) -> None:
    # A contact grid on one of the sides alone left nothing to hold the disk; a warning tells what is better.
    low, high = -(2.0**0.5), 3.0 - 2.0**0.5
    groove = [[-3.0, high], [0.0, low], [3.0, high], [3.0, -4.0], [-3.0, -4.0]]
    text = (
        HEAD.body("disk", "steel", disk=([0.0, 0.0], 1.0))
        .body("rail", "steel", shape=polygon(groove, "groove groove right base left"), clamped="base")
        .body_force("weight", "disk", [0.0, -1.0])
        .contact("both", "disk.arc", "rail.groove")
    )
    summary = solve(text, tmp_path / "run")
    assert summary["contacts"]["both"]["force"] == pytest.approx([0.0, np.pi], abs=0.01)
    assert "contact_corner" in warned(summary)


@pytest.mark.parametrize("high", [5.0, 0.5])
def test_the_pressure_at_a_sharp_rigid_tip_is_told_to_be_unbounded(high: float, tmp_path: Path) -> None:
    text = (
        HEAD.body("block", "steel", box=([-10.0, 10.0], [-10.0, 0.0]), clamped="bottom")
        .pushed("press", "tip", fy=-10.0)
        .contact("tip", "block.top", polyline=([-5.0, high], [0.0, 0.0], [5.0, high]), accuracy=0.05)
    )
    summary = solve(text, tmp_path / "run", "output.fields=[]")
    told = [text for text in summary["warnings"] if "times the contact modulus" in text]
    assert len(told) == (high == 5.0)


def test_pieces_that_do_not_join_are_told_by_name(tmp_path: Path) -> None:
    text = pad(0.3, ["pad.left", "pad.bottom"])
    refused(text, tmp_path / "pad", "contact.foot.slave", '"bottom" and "left" do not join')


PATCH = {"from_": [0.33, 0.0], "to": [-0.51, 0.01], "table": [[0.0, 0.0], [0.84, 10.0]]}
PARTS = (
    HEAD.body("block", "steel", 0.2, box=([-2.0, 2.0], [-2.0, 0.0]))
    .support("block.bottom", from_=[-1.0, -2.0], to=[1.0, -2.0], ux=0.0, uy=0.0)
    .support("block.bottom", from_=[2.0, -2.0], to=[1.0, -2.0], spring=[0.0, 10.0])
    .load("patch", "block.top", "pressure", **PATCH)
    .load("plate", ["block.top", "block.right"], "platen", from_=[1.2, 0.0], to=[2.0, -0.4], ux=0.0, fy=-2.0)
)


def test_parts_of_sides_are_held_loaded_and_pressed(tmp_path: Path) -> None:
    found = solve(PARTS, tmp_path / "parts")
    forces = found["forces"]
    # The table runs from the part's start with the material on the left: here from right to left.
    assert forces["patch"] == pytest.approx([0.0, -4.2])
    assert forces["plate"][1] == pytest.approx(-2.0)
    held, sprung = (f"block.bottom from ({a}, -2) to (1, -2)" for a in (-1, 2))
    assert forces[sprung][0] == 0.0
    assert 0.0 < forces[sprung][1] < 1.0
    assert forces[held][1] + forces[sprung][1] == pytest.approx(6.2)
    assert found["force_balance"] < 1e-9
    assert not any("both act" in text for text in found["warnings"])


def test_feet_of_one_name_are_clamped_as_those_of_two() -> None:
    portal = [(0, 0), (1, 0), (1, 2), (3, 2), (3, 0), (4, 0), (4, 3), (0, 3)]

    def placed(*feet: str) -> FloatArray:
        names = f"{feet[0]} in1 under in2 {feet[-1]} right top left"
        text = scene("stress").body("portal", "steel", shape=polygon(portal, names))
        for foot in feet:
            text = text.support(f"portal.{foot}", ux=0.0, uy=0.0)
        text = text.load("press", "portal.top", "pressure", pressure=1.0)
        return clouds(Boundaries.of(parse(text).case))["portal"].points

    np.testing.assert_array_equal(placed("foot"), placed("foot1", "foot2"))


@pytest.mark.parametrize(
    ("setting", "key", "words"),
    [
        ("load.patch.to=[5.0, 0.0]", "load.patch.to", "is 3 away from the boundary"),
        ("load.patch.from=[1.5, 0.0]", "load.plate", "both act on a part"),
        ("load.patch.to=[0.33, 0.2]", "load.patch.to", "has no length"),
    ],
)
def test_parts_without_sense(tmp_path: Path, setting: str, key: str, words: str) -> None:
    refused(PARTS, tmp_path / "parts", key, words, setting)


def test_a_part_of_a_circle_runs_with_the_material_on_its_left(tmp_path: Path) -> None:
    text = (
        HEAD.body("disk", "steel", disk=([0.0, 0.0], 1.0))
        .support("disk.arc", from_=[-0.2, -1.0], to=[0.2, -1.0], ux=0.0, uy=0.0)
        .load("patch", "disk.arc", "pressure", from_=[0.6, 0.8], to=[-0.6, 0.8], pressure=10.0)
    )
    assert solve(text, tmp_path / "disk")["forces"]["patch"] == pytest.approx([0.0, -12.0])


def test_a_part_of_a_mesh_ends_at_nodes(tmp_path: Path) -> None:
    write_gmsh(tmp_path / "plate.msh", *polar_plate(48, 5.0))
    load = "traction = [100.0, 0.0]"
    text = PULLED.changed(load, f"{load}\nfrom = [5.0, -2.0]\nto = [5.0, 2.0]")
    (tmp_path / "case.toml").write_text(text)
    loaded = read_case(tmp_path / "case.toml")
    outline = Boundaries.of(loaded.case).outline(loaded.case.body[0].name)
    assert {"right/1", "right/2", "right/3"} <= set(outline.names)
    middle = outline.curves[outline.names.index("right/2")]
    found = solve(text, tmp_path / "part")
    assert found["forces"]["pull"][0] == pytest.approx(100.0 * middle.length)
    assert 3.0 < middle.length < 5.0
    assert "loaded_length" in warned(found)
    jumping = text.changed(load, 'traction = ["100.0 if abs(y) < 2 else 0", 0.0]').split("from = ")
    whole = jumping[0] + jumping[1].split("\n", 2)[2]
    assert solve(whole, tmp_path / "jump")["forces"]["pull"][0] == pytest.approx(400.0, rel=2e-3)


def test_a_pressure_and_a_contact_share_a_surface(tmp_path: Path) -> None:
    """What presses from above is shared by the contact and the pressure."""
    text = (
        HEAD.body("pad", "steel", 0.25, box=([-1.0, 1.0], [0.0, 1.0]))
        .load("top", "pad.top", "pressure", pressure=10.0)
        .load("fluid", "pad.bottom", "pressure", pressure=4.0)
        .pin("pad", [0.0, 1.0], ux=0.0)
        .contact("foot", "pad.bottom", obstacle=FLOOR)
    )
    found = solve(text, tmp_path / "pad")
    assert pressed(tmp_path / "pad", "foot")[1] == pytest.approx(6.0)
    assert found["forces"]["fluid"] == pytest.approx([0.0, 8.0])
    with pytest.raises(CaseError, match="acts on the contact surface"):
        solve(text.support("pad.bottom", ux=0.0), tmp_path / "no")


def standing(on: float, **part: list[float]) -> Scene:
    """A block on a roller from its left end to ``on``, and on a plane along a part of the rest."""
    return (
        scene("strain", "a", E=1000.0, nu=0.0)
        .body("block", "a", 0.1, box=([0.0, 2.0], [0.0, 1.0]))
        .load("press", "block.top", "platen", uy=-0.01, ux=0.0)
        .contact("c", "block.bottom", obstacle=FLOOR, **part)
        .support("block.bottom", from_=[0.0, 0.0], to=[on, 0.0], uy=0.0)
    )


REST = {"from_": [1.0, 0.0], "to": [2.0, 0.0]}


def test_a_part_of_a_side_is_in_contact(tmp_path: Path) -> None:
    summary = done(standing(1.0, **REST), tmp_path / "run")
    # Pressed, the block does not see where it stands on what.
    contact = read_run(tmp_path / "run").contacts["c"]
    assert (contact.points[:, 0] >= 1.0).all()
    np.testing.assert_allclose(contact.pressure[-1], 10.0, rtol=1e-3)
    assert summary["contacts"]["c"]["force"][1] == pytest.approx(10.0, rel=1e-3)
    # Pulled, it lifts off where nothing holds it.
    pulled = done(standing(1.0, **REST), tmp_path / "pulled", "load.press.uy=0.01")
    assert pulled["contacts"]["c"]["force"] == pytest.approx([0.0, 0.0], abs=1e-9)
    assert pulled["forces"]["block.bottom from (0, 0) to (1, 0)"][1] < -5.0


@pytest.mark.parametrize(
    ("text", "key", "words"),
    [
        (standing(1.2, **REST), "contact.c.slave", "acts on a part of the contact surface"),
        (standing(1.0, from_=[1.0, 0.0]), "contact.c.from", 'needs "to" too'),
        (standing(1.0, **{**REST, "to": [2.0, 5.0]}), "contact.c.to", " away"),
    ],
)
def test_parts_of_contacts_meet_no_supports(text: str, key: str, words: str, tmp_path: Path) -> None:
    refused(text, tmp_path / "run", key, words)


def test_a_part_of_an_arc_touches_as_the_arc_does(tmp_path: Path) -> None:
    part = ("contact.interface.from=[-0.5, 0.15]", "contact.interface.to=[0.5, 0.15]")
    found = done(hertz(), tmp_path / "part", *part)
    peak = done(hertz(), tmp_path / "whole")["contacts"]["interface"]["peak_pressure"]
    assert found["contacts"]["interface"]["peak_pressure"] == pytest.approx(peak, rel=2e-3)


@pytest.mark.parametrize(("slope", "sharp"), [(0.1, True), (1.0, True), (3.0, False)])
def test_a_tip_that_touches_with_both_sides_needs_a_radius(slope: float, sharp: bool) -> None:
    points = [[0.0, 0.0], [4.0, 4.0 * slope], [4.0, 16.0], [-4.0, 16.0], [-4.0, 4.0 * slope]]
    case = parse(
        scene("strain")
        .body("wedge", "steel", shape=polygon(points, "one right back left other"))
        .body("block", "steel", box=([-8.0, 8.0], [-8.0, 0.0]), clamped="bottom")
        .load("press", "wedge.back", "platen", ux=0.0, fy=-10.0)
        .contact("tip", slave=["wedge.other", "wedge.one"], master="block.top")
    ).case
    pairings = tuple(pair(Boundaries.of(case), clouds(Boundaries.of(case))))
    if not sharp:
        check_tips(case, pairings)
        return
    with pytest.raises(CaseError) as caught:
        check_tips(case, pairings)
    (problem,) = caught.value.problems
    assert "sharp corner at (0, 0)" in problem.message
    assert "contact.tip.slave" in problem.hint


def test_contacts_that_meet_on_one_pair_of_surfaces_are_refused() -> None:
    """On parts that are apart, or of two masters side by side, they are fine."""
    upper = HEAD.body("upper", "steel", 0.2, box=([0.0, 2.0], [1.0, 2.0]))
    upper = upper.load("press", "upper.top", "platen", ux=0.0, uy=-0.01)
    lower = upper.body("lower", "steel", 0.2, box=([0.0, 2.0], [0.0, 1.0])).support(
        "lower.bottom", ux=0.0, uy=0.0
    )

    def both(body: Scene, end: float, masters: tuple[str, str]) -> Scene:
        parts = (0.0, end), (1.0, 2.0)
        for name, (first, last), master in zip(("left", "right"), parts, masters, strict=True):
            ends = {"from_": [first, 1.0], "to": [last, 1.0]}
            body = body.contact(name, "upper.bottom", master, **ends)
        return body

    with pytest.raises(CaseError) as error:
        prepared(both(lower, 1.0, ("lower.top",) * 2))
    assert [problem.key for problem in error.value.problems] == ["contact.right"]
    prepared(both(lower, 0.6, ("lower.top",) * 2))
    blocks = upper
    for name, x in (("a", [0.0, 1.0]), ("b", [1.0, 2.0])):
        blocks = blocks.body(name, "steel", 0.2, box=(x, [0.0, 1.0])).support(
            f"{name}.bottom", ux=0.0, uy=0.0
        )
    prepared(both(blocks, 1.0, ("a.top", "b.top")))
