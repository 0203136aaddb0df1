"""Surfaces as users think of them: faces with rounded corners, profiles, parts of sides, pressures in
contacts."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from mlsanm_cli.app.check import check
from mlsanm_cli.app.scene.assemble import prepare
from mlsanm_cli.app.scene.boundaries import Boundaries
from mlsanm_cli.app.scene.clouds import clouds
from mlsanm_cli.app.scene.contact_pairs import pair
from mlsanm_cli.app.scene.default_spacing import arc_zones, valleys
from mlsanm_cli.app.scene.imported import load_with_files
from mlsanm_cli.app.scene.outlines import drawn
from mlsanm_cli.app.scene.tips import check_tips
from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.case import OutlineShape
from mlsanm_cli.cloud.curves import Outline
from mlsanm_cli.cloud.splines import NodeSpline, SplinePart
from mlsanm_cli.errors import CaseError
from mlsanm_cli.io.run_reader import read_run
from mlsanm_cli.reference.hertz import HertzLine
from tests.app.scenes import Quiet, hertz, solve
from tests.app.test_foreign import PULLED, polar_plate, write_gmsh
from tests.case.scenes import parse
from tests.case_text import (
    EXACT,
    body,
    box,
    contact,
    disk,
    head,
    item,
    load,
    material,
    pin,
    plane,
    polygon,
    pushed,
    support,
    table,
)

HEAD = head("strain") + material("steel", E=1000.0, nu=0.3)
FOOT = ["pad.corner2", "pad.bottom", "pad.corner1"]


def pad(radius: float, slave: Any = FOOT, master: Any = "block.top") -> str:
    """A pad with two rounded corners on a block."""
    return (
        HEAD
        + body("pad", "steel")
        + table(
            "body.shape",
            kind="polygon",
            points=[[-1.0, 0.0], [1.0, 0.0], [1.0, 1.5], [-1.0, 1.5]],
            names=["bottom", "right", "top", "left"],
            rounding=[radius, radius, 0.0, 0.0],
        )
        + body("block", "steel", shape=box([-3.0, 3.0], [-3.0, 0.0]))
        + support("block.bottom", ux=0.0, uy=0.0)
        + load("press", "pad.top", "platen", ux=0.0, fy=-5.0)
        + contact("foot", slave, master, accuracy=0.02, regularization=EXACT)
    )


def test_ranges_go_on_where_the_outline_does() -> None:
    """Pressures had kept four spacings off the ends of edges that pass smoothly into free sides: contacts on
    coarse clouds had no grid."""
    case = parse(pad(0.3).replace('name = "pad"', 'name = "pad"\nspacing = 0.2', 1)).case
    limits = prepare(case, clouds(case)).ranges["foot"]
    assert limits.last - limits.first > 2.0 * (0.7 + 0.7 * 0.5 * np.pi * 0.3)


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


@pytest.mark.parametrize("slave", ["pad.bottom", "block.top"])
@pytest.mark.parametrize("spacing", [0.13, 0.2])
def test_flat_faces_press_along_the_one_without_roundings(slave: str, spacing: float) -> None:
    """The pressed pad's face is as flat as the block where they touch, and its roundings belong to it."""
    master = "block.top" if slave == "pad.bottom" else "pad.bottom"
    text = pad(0.3, slave=slave, master=master)
    case = parse(text, [f"body.{name}.spacing={spacing}" for name in ("pad", "block")]).case
    facing = prepare(case, clouds(case)).ranges["foot"].facing
    normal = facing.normal(facing.locate(np.stack([np.linspace(-0.9, 0.9, 7), np.zeros(7)], axis=1)))
    assert np.abs(normal - [0.0, 1.0 if slave == "pad.bottom" else -1.0]).max() < 1e-12


@pytest.mark.parametrize("side", ["slave", "master"])
def test_sides_that_face_nobody_change_nothing(side: str, tmp_path: Path) -> None:
    """At a corner only the side that faces the other body receives pressures, on slaves and on masters."""
    names = {"slave": "block.top", "master": "block.top", side: ["pad.left", "pad.bottom", "pad.right"]}
    joined = solve(pad(0.0, **names), tmp_path / "run", "body.pad.spacing=0.2", "body.block.spacing=0.2")
    assert joined["force_balance"] < 1e-9
    up = 5.0 if side == "slave" else -5.0
    assert joined["contacts"]["foot"]["force"] == pytest.approx([0.0, up], abs=1e-6)


def test_a_disk_rests_on_both_sides_of_an_elastic_groove_of_one_name(tmp_path: Path) -> None:
    # A contact grid on one of the sides alone left nothing to hold the disk; a warning tells what is better.
    low, high = -(2.0**0.5), 3.0 - 2.0**0.5
    groove = [[-3.0, high], [0.0, low], [3.0, high], [3.0, -4.0], [-3.0, -4.0]]
    text = (
        HEAD
        + body("disk", "steel", shape=disk([0.0, 0.0], 1.0))
        + body("rail", "steel", shape=polygon(groove, "groove groove right base left"))
        + support("rail.base", ux=0.0, uy=0.0)
        + item("load", name="weight", kind="body-force", body="disk", body_force=[0.0, -1.0])
        + contact("both", "disk.arc", "rail.groove")
    )
    summary = solve(text, tmp_path / "run")
    assert summary["contacts"]["both"]["force"] == pytest.approx([0.0, np.pi], abs=0.01)
    assert [text for text in summary["warnings"] if "define a contact for each of both sides" in text]


def test_the_pressure_at_a_sharp_rigid_tip_is_told_to_be_unbounded(tmp_path: Path) -> None:
    for number, high in enumerate((5.0, 0.5)):
        wedge = {"kind": "polyline", "points": [[-5.0, high], [0.0, 0.0], [5.0, high]]}
        text = (
            HEAD
            + body("block", "steel", shape=box([-10.0, 10.0], [-10.0, 0.0]))
            + support("block.bottom", ux=0.0, uy=0.0)
            + pushed("press", "tip", fy=-10.0)
            + contact("tip", "block.top", obstacle=wedge, accuracy=0.05)
        )
        summary = solve(text, tmp_path / f"run{number}", "output.fields=[]")
        told = [text for text in summary["warnings"] if "times the contact modulus" in text]
        assert len(told) == (high == 5.0)


def test_pieces_that_do_not_join_are_told_by_name(tmp_path: Path) -> None:
    with pytest.raises(CaseError) as caught:
        solve(pad(0.3, ["pad.left", "pad.bottom"]), tmp_path / "pad")
    (problem,) = caught.value.problems
    assert problem.key == "contact.foot.slave"
    assert '"bottom" and "left" do not join' in problem.message


def wavy(waves: int, height: float, mean: float, folder: Path) -> tuple[str, float]:
    """A block with waves of length 1 between rollers under a rigid plane, and Westergaard's largest pressure.

    Johnson, Contact Mechanics, 1985, section 13.2.
    """
    x = np.linspace(0.0, waves, 16 * waves + 1)
    rows = [
        f"{a!r},{b!r}" for a, b in zip(x.tolist(), (-height * np.cos(2.0 * np.pi * x)).tolist(), strict=True)
    ]
    (folder / "profile.csv").write_text("\n".join(["x,y", *rows]))
    full = np.pi * 1000.0 / 0.91 * height
    sides = [{"name": "top", "file": "profile.csv"}, {"name": "right", "to": [float(waves), -1.5]}]
    sides += [{"name": "bottom", "to": [0.0, -1.5]}, {"name": "left"}]
    text = (
        HEAD
        + body("block", "steel", shape={"kind": "outline", "sides": sides})
        + support("block.bottom", uy=0.0)
        + support(["block.left", "block.right"], ux=0.0)
        + pushed("press", "lid", fy=-mean * full * waves)
        + contact(
            "lid",
            "block.top",
            accuracy=0.01,
            regularization=EXACT,
            obstacle=plane([0.0, height], [0.0, -1.0]),
        )
    )
    return text, 2.0 * full * float(np.sqrt(mean))


def test_a_wavy_surface_has_westergaards_pressures(tmp_path: Path) -> None:
    text, peak = wavy(3, 1e-3, 0.2, tmp_path)
    found = solve(text, tmp_path / "wavy")
    assert found["nodes"] < 500
    points, pressure = pressed(tmp_path / "wavy", "lid")
    for wave in range(3):
        here = (points[:, 0] >= wave) & (points[:, 0] < wave + 1)
        assert pressure[here].max() == pytest.approx(peak, rel=0.01)
        half = np.arcsin(np.sqrt(0.2)) / np.pi
        away = np.abs(points[here, 0] - wave - 0.5)
        assert away[pressure[here] > 0.0].max() == pytest.approx(half, rel=0.05)


def test_shallow_waves_need_no_fine_nodes_and_tight_turns_do() -> None:
    def finest(x: FloatArray, y: FloatArray, far: float) -> float:
        spline = SplinePart(NodeSpline(np.stack([x, y], axis=1), False), 0, len(x) - 1)
        return min([far, *(zone.spacing for zone in arc_zones(Outline(("a",), (spline,)), far))])

    x = np.linspace(0.0, 20.0, 801)
    assert finest(x, 0.01 * np.cos(2.0 * np.pi * x), 1.0) == 1.0
    assert finest(x, 0.1 * np.cos(2.0 * np.pi * x), 1.0) < 0.2
    angle = np.linspace(0.0, np.pi, 41)
    # As along arcs: a fifth of the radius, in hollows a fourteenth.
    x, y = -0.5 * np.cos(angle), -0.5 * np.sin(angle)
    assert 0.06 <= finest(x, y, 0.5) <= 0.1
    assert 0.03 <= finest(x[::-1], y[::-1], 0.5) <= 0.05


def test_last_bits_of_flat_surfaces_are_no_places_of_contact() -> None:
    noise = 1e-16 * np.random.default_rng(1).normal(size=200)
    assert len(valleys(noise, 1e-9)) == 1
    x = np.linspace(0.0, 5.0, 401)
    found = valleys(-1e-3 * np.cos(2.0 * np.pi * (x - 0.5)) + noise[0], 1e-9)
    assert x[found] == pytest.approx([0.5, 1.5, 2.5, 3.5, 4.5], abs=0.02)


def flanks(first: tuple[float, float], second: tuple[float, float], spacing: Any, **press: float) -> str:
    """Two teeth with involutes of two base and curvature radii, that touch at the pitch point."""

    def flank(base: float, radius: float, sign: float) -> list[list[float]]:
        a = np.linspace(-0.3, 0.25, 21)
        ahead, across = np.stack([np.cos(a), np.sin(a)], axis=1), np.stack([-np.sin(a), np.cos(a)], axis=1)
        points = np.array([-base, -radius]) + base * ahead + (radius - base * a)[:, None] * across
        return [[float(sign * x), float(sign * y)] for x, y in points]

    text = HEAD
    for name, sign, points in (("one", 1.0, flank(*first, 1.0)), ("two", -1.0, flank(*second, -1.0))):
        ends = {"to": [points[-1][0], -sign]}, {"name": "base", "to": [points[0][0], -sign]}
        sides = [{"name": "flank", "points": points}, *ends, {}]
        text += body(name, "steel", spacing, {"kind": "outline", "sides": sides})
    text += support("one.base", ux=0.0, uy=0.0) + load("press", "two.base", "platen", **press)
    return text + contact("mesh", "two.flank", "one.flank", regularization=EXACT)


def test_flanks_of_gears_from_points(tmp_path: Path) -> None:
    """Two involutes touch as circles of their radii of curvature do."""
    force = 0.3
    text = flanks((3.0, 1.0), (4.0, 1.5), None, ux=0.0, fy=-force)
    found = solve(text, tmp_path / "gears")["contacts"]["mesh"]
    hertz = HertzLine(force, 1.0 / (1.0 + 1.0 / 1.5), 0.5 * 1000.0 / 0.91)
    assert found["peak_pressure"] == pytest.approx(hertz.peak_pressure, rel=5e-3)


def test_which_of_two_equal_flanks_gives_directions_does_not_depend_on_nodes() -> None:
    """Curvatures are compared where the flanks touch, not at the nodes next to that place: what resists their
    motion along each other is curvature alone, and varied by 1 to 2 %."""
    first = []
    for spacing in (0.1, 0.083, 0.07):
        case = parse(flanks((3.0, 1.0), (3.0, 1.0), spacing, fy=-3.0)).case
        first.append(prepare(case, clouds(case)).ranges["mesh"].facing.slave_first)
    assert len(set(first)) == 1


PARTS = (
    HEAD
    + body("block", "steel", 0.2, box([-2.0, 2.0], [-2.0, 0.0]))
    + support("block.bottom", from_=[-1.0, -2.0], to=[1.0, -2.0], ux=0.0, uy=0.0)
    + support("block.bottom", from_=[2.0, -2.0], to=[1.0, -2.0], spring=[0.0, 10.0])
    + load(
        "patch",
        "block.top",
        "pressure",
        from_=[0.33, 0.0],
        to=[-0.51, 0.01],
        table=[[0.0, 0.0], [0.84, 10.0]],
    )
    + load("plate", ["block.top", "block.right"], "platen", from_=[1.2, 0.0], to=[2.0, -0.4], ux=0.0, fy=-2.0)
)


def test_parts_of_sides_are_held_loaded_and_pressed(tmp_path: Path) -> None:
    console = Quiet()
    found = solve(PARTS, tmp_path / "parts", console=console)
    forces: Mapping[str, Any] = found["forces"]
    # The table runs from the part's start with the material on the left: here from right to left.
    assert forces["patch"] == pytest.approx([0.0, -4.2])
    assert forces["plate"][1] == pytest.approx(-2.0)
    held, sprung = (f"block.bottom from ({a}, -2) to (1, -2)" for a in (-1, 2))
    assert forces[sprung][0] == 0.0
    assert 0.0 < forces[sprung][1] < 1.0
    assert forces[held][1] + forces[sprung][1] == pytest.approx(6.2)
    assert found["force_balance"] < 1e-9
    assert not any("both act" in text for text in console.warnings)


def test_feet_of_one_name_are_clamped_as_those_of_two() -> None:
    # Where spacings are automatic, sides of one name that do not join were refused.
    portal = [(0, 0), (1, 0), (1, 2), (3, 2), (3, 0), (4, 0), (4, 3), (0, 3)]

    def placed(*feet: str) -> FloatArray:
        names = f"{feet[0]} in1 under in2 {feet[-1]} right top left"
        text = head("stress") + material("steel", E=210e3, nu=0.3)
        text += body("portal", "steel", shape=polygon(portal, names))
        text += "".join(support(f"portal.{foot}", ux=0.0, uy=0.0) for foot in feet)
        text += load("press", "portal.top", "pressure", pressure=1.0)
        return clouds(parse(text).case)["portal"].points

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
    with pytest.raises(CaseError) as caught:
        solve(PARTS, tmp_path / "parts", setting)
    assert any(problem.key == key and words in problem.message for problem in caught.value.problems)


def test_a_part_of_a_circle_runs_with_the_material_on_its_left(tmp_path: Path) -> None:
    text = (
        HEAD
        + body("disk", "steel", shape=disk([0.0, 0.0], 1.0))
        + support("disk.arc", from_=[-0.2, -1.0], to=[0.2, -1.0], ux=0.0, uy=0.0)
        + load("patch", "disk.arc", "pressure", from_=[0.6, 0.8], to=[-0.6, 0.8], pressure=10.0)
    )
    assert solve(text, tmp_path / "disk")["forces"]["patch"] == pytest.approx([0.0, -12.0])


def test_a_part_of_a_mesh_ends_at_nodes(tmp_path: Path) -> None:
    write_gmsh(tmp_path / "plate.msh", *polar_plate(48, 5.0))
    load = "traction = [100.0, 0.0]"
    text = PULLED.replace(load, f"{load}\nfrom = [5.0, -2.0]\nto = [5.0, 2.0]")
    (tmp_path / "case.toml").write_text(text)
    loaded = load_with_files(tmp_path / "case.toml")
    outline = Boundaries.of(loaded.case).outline(loaded.case.body[0].name)
    assert {"right/1", "right/2", "right/3"} <= set(outline.names)
    middle = outline.curves[outline.names.index("right/2")]
    found = solve(text, tmp_path / "part")
    assert found["forces"]["pull"][0] == pytest.approx(100.0 * middle.length)
    assert 3.0 < middle.length < 5.0
    assert any("load.pull acts on a length of" in text for text in found["warnings"])
    jumping = text.replace(load, 'traction = ["100.0 if abs(y) < 2 else 0", 0.0]').split("from = ")
    whole = jumping[0] + jumping[1].split("\n", 2)[2]
    assert solve(whole, tmp_path / "jump")["forces"]["pull"][0] == pytest.approx(400.0, rel=2e-3)


def test_a_pressure_and_a_contact_share_a_surface(tmp_path: Path) -> None:
    """What presses from above is shared by the contact and the pressure."""
    text = (
        HEAD
        + body("pad", "steel", 0.25, box([-1.0, 1.0], [0.0, 1.0]))
        + load("top", "pad.top", "pressure", pressure=10.0)
        + load("fluid", "pad.bottom", "pressure", pressure=4.0)
        + pin("pad", [0.0, 1.0], ux=0.0)
        + contact("foot", "pad.bottom", obstacle=plane([0.0, 0.0], [0.0, 1.0]))
    )
    found = solve(text, tmp_path / "pad")
    assert pressed(tmp_path / "pad", "foot")[1] == pytest.approx(6.0)
    assert found["forces"]["fluid"] == pytest.approx([0.0, 8.0])
    with pytest.raises(CaseError, match="acts on the contact surface"):
        solve(
            text.replace("near = [0.0, 1.0]", "").replace('body = "pad"', 'boundary = "pad.bottom"'),
            tmp_path / "no",
        )


@pytest.mark.parametrize("start", [0.0, 0.5 * np.pi])
def test_a_closed_curve_begins_at_its_top_wherever_its_points_do(start: float) -> None:
    """Without a node there the mirror image of a ring between plates was none, and the ring rolled away."""
    angle = start + np.linspace(0.0, 2.0 * np.pi, 25)
    points = [[float(x), float(y)] for x, y in zip(np.cos(angle), np.sin(angle), strict=True)]
    text = PARTS[: PARTS.index("[[support]]")].replace(
        'kind = "rectangle", x = [-2.0, 2.0], y = [-2.0, 0.0]',
        f'kind = "outline", sides = [{{ name = "skin", points = {points} }}]',
    )
    text += '[[support]]\nboundary = "block.skin"\nux = 0.0\nuy = 0.0\n'
    text += '[[load]]\nname = "own"\nbody = "block"\nkind = "body-force"\nbody-force = [0.0, -1.0]\n'
    shape = parse(text).case.body[0].shape
    assert isinstance(shape, OutlineShape)
    (curve,) = drawn(shape).curves
    assert curve.points(np.zeros(1))[0] == pytest.approx((0.0, 1.0))
    assert curve.closed


BLOCK = (
    head("strain")
    + material("a", E=1000.0, nu=0.0)
    + body("block", "a", 0.1, box([0.0, 2.0], [0.0, 1.0]))
    + load("press", "block.top", "platen", uy=-0.01, ux=0.0)
    + contact("c", "block.bottom", from_=[1.0, 0.0], to=[2.0, 0.0], obstacle=plane([0.0, 0.0], [0.0, 1.0]))
)
ROLLING = '[[support]]\nboundary = "block.bottom"\nfrom = [0.0, 0.0]\nto = [{}, 0.0]\nuy = 0.0\n'


@pytest.mark.parametrize("law", ["exact", "hyperbolic"])
def test_a_part_of_a_side_is_in_contact(law: str, tmp_path: Path) -> None:
    summary = solve(BLOCK + ROLLING.format(1.0), tmp_path / "run", f"contact.c.regularization.law={law}")
    assert summary["status"] == "done", summary
    # Pressed, the block does not see where it stands on what.
    contact = read_run(tmp_path / "run").contacts["c"]
    assert (contact.points[:, 0] >= 1.0).all()
    np.testing.assert_allclose(contact.pressure[-1], 10.0, rtol=1e-3)
    assert summary["contacts"]["c"]["force"][1] == pytest.approx(10.0, rel=1e-3)
    if law == "exact":
        # Pulled, it lifts off where nothing holds it.
        overrides = ("contact.c.regularization.law=exact", "load.press.uy=0.01")
        pulled = solve(BLOCK + ROLLING.format(1.0), tmp_path / "pulled", *overrides)
        assert pulled["status"] == "done", pulled
        assert pulled["contacts"]["c"]["force"] == pytest.approx([0.0, 0.0], abs=1e-9)
        assert pulled["forces"]["block.bottom from (0, 0) to (1, 0)"][1] < -5.0


def test_parts_of_contacts_meet_no_supports(tmp_path: Path) -> None:
    case = tmp_path / "case.toml"
    for text, words in (
        (BLOCK + ROLLING.format(1.2), "acts on a part of the contact surface"),
        (BLOCK.replace("to = [2.0, 0.0]\n", "") + ROLLING.format(1.0), 'contact.c.from: needs "to" too'),
        (
            BLOCK.replace("[2.0, 0.0]\nobst", "[2.0, 5.0]\nobst") + ROLLING.format(1.0),
            "contact.c.to: .* away",
        ),
    ):
        case.write_text(text)
        with pytest.raises(CaseError, match=words):
            check(case, console=Quiet())


def test_a_part_of_an_arc_touches_as_the_arc_does(hertz_run: Path, tmp_path: Path) -> None:
    whole = hertz()
    part = whole.replace(
        'slave = "cylinder.arc"', 'slave = "cylinder.arc"\nfrom = [-0.5, 0.15]\nto = [0.5, 0.15]'
    )
    assert part != whole
    found = solve(part, tmp_path / "part", "output.at=[0.3, 0.7, 1.0]", "solver.polish=false")
    peak = read_run(hertz_run).contacts["interface"].pressure[-1].max()
    assert found["status"] == "done", found
    assert found["contacts"]["interface"]["peak_pressure"] == pytest.approx(peak, rel=2e-3)


@pytest.mark.parametrize(("slope", "sharp"), [(0.1, True), (1.0, True), (3.0, False)])
def test_a_tip_that_touches_with_both_sides_needs_a_radius(slope: float, sharp: bool) -> None:
    """Only one of the sides had pressures: a wedge of 10 degrees pushed sideways with 18 % of its force."""
    points = [[0.0, 0.0], [4.0, 4.0 * slope], [4.0, 16.0], [-4.0, 16.0], [-4.0, 4.0 * slope]]
    case = parse(
        head("strain")
        + material("steel", E=210e3, nu=0.3)
        + body("wedge", "steel", shape=polygon(points, "one right back left other"))
        + body("block", "steel", shape=box([-8.0, 8.0], [-8.0, 0.0]))
        + support("block.bottom", ux=0.0, uy=0.0)
        + load("press", "wedge.back", "platen", ux=0.0, fy=-10.0)
        + contact("tip", slave=["wedge.other", "wedge.one"], master="block.top")
    ).case
    if not sharp:
        check_tips(case, tuple(pair(case, Boundaries.of(case), clouds(case))))
        return
    with pytest.raises(CaseError) as refused:
        check_tips(case, tuple(pair(case, Boundaries.of(case), clouds(case))))
    (problem,) = refused.value.problems
    assert "sharp corner at (0, 0)" in problem.message
    assert "contact.tip.slave" in problem.hint
