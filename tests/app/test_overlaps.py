"""Boundaries inside other bodies, obstacles or their own body: told with place and depth, or let be."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from tests.app.scenes import solve
from tests.case_text import EXACT, body, box, contact, head, item, load, material, pin, plane, support, table

SOLID = head("strain") + material("solid", E=1000.0, nu=0.3, alpha=0.001)
PAD = (
    SOLID
    + body("pad", "solid", 0.3)
    + table(
        "body.shape",
        kind="polygon",
        points=[[-2.0, 0.0], [2.0, 0.0], [2.0, 3.0], [-2.0, 3.0]],
        names=["face", "right", "top", "left"],
        rounding=[0.8, 0.8, 0.0, 0.0],
    )
    + load("press", "pad.top", "platen", uy=-0.15, ux=0.0)
)
ANGLES = np.linspace(0.0, 0.5 * np.pi, 13)
"""Curves that are no arcs are no rounded corners: a contact does not take them in by itself."""


def curve(name: str, x: float, turned: float) -> str:
    """A quarter of a circle about (x, 0.8) as a side through points, from an angle on."""
    places = [[x + 0.8 * np.cos(a + turned), 0.8 + 0.8 * np.sin(a + turned)] for a in ANGLES]
    return f'[[body.shape.sides]]\nname = "{name}"\npoints = {[[float(v) for v in p] for p in places]}\n'


def side(name: str, x: float, y: float) -> str:
    return f'[[body.shape.sides]]\nname = "{name}"\nto = [{x}, {y}]\n'


SIDES = (
    side("face", 1.2, 0.0)
    + curve("corner2", 1.2, -0.5 * np.pi)
    + side("right", 2.0, 3.0)
    + side("top", -2.0, 3.0)
    + side("left", -2.0, 0.8)
    + curve("corner1", -1.2, np.pi)
)
CURVED = PAD.partition('kind = "polygon"')[0] + 'kind = "outline"\n' + SIDES + PAD[PAD.index("[[load]]") :]
BLOCK = (
    body("block", "solid", 0.3, box([-5.0, 5.0], [-4.0, 0.0]))
    + support("block.bottom", ux=0.0, uy=0.0)
    + contact("face", "pad.face", "block.top", regularization=EXACT, accuracy=0.1)
)
PLANE = contact(
    "face", "pad.face", obstacle=plane([0.0, 0.0], [0.0, 1.0]), regularization=EXACT, accuracy=0.1
)
WHOLE = 'contact.face.slave=["pad.face", "pad.corner1", "pad.corner2"]'
BARS = (
    SOLID
    + body("hot", "solid", 0.5, box([0.0, 4.0], [0.0, 1.0]))
    + body("cold", "solid", 0.5, box([4.1, 6.0], [-0.5, 1.5]))
    + support("hot.left", ux=0.0)
    + pin("hot", [0.0, 0.0], uy=0.0)
    + support("cold.right", ux=0.0, uy=0.0)
    + item("load", name="heat", kind="temperature", body="hot", temperature=50.0)
    + table("output", at=[0.25, 1.0])
)
SLIT = (
    SOLID
    + body("clip", "solid", 0.05)
    + table(
        "body.shape",
        kind="polygon",
        points=[
            [0.0, 0.0],
            [6.0, 0.0],
            [6.0, 1.0],
            [1.0, 1.0],
            [1.0, 1.15],
            [6.0, 1.15],
            [6.0, 2.15],
            [0.0, 2.15],
        ],
        names=["lower", "l", "inner", "root", "outer", "u", "upper", "back"],
    )
    + support("clip.lower", ux=0.0, uy=0.0)
    + load("squeeze", "clip.upper", "pressure", pressure=0.2)
)


@pytest.mark.parametrize(("base", "whom"), [(BLOCK, "block.top"), (PLANE, "the obstacle of contact face")])
def test_a_curve_beside_its_contact_is_told(tmp_path: Path, base: str, whom: str) -> None:
    summary = solve(CURVED + base, tmp_path / "face")
    assert summary["status"] == "failed"
    assert f"lies inside {whom} by 0.0" in summary["stop_reason"]
    assert summary["stop_reason"].startswith("pad.corner")
    hinted = summary["hint"].partition("as in ")[2].partition(", or draw")[0].replace(" = ", "=")
    assert {"pad.face", "pad.corner1", "pad.corner2"} == set(hinted.split('"')[1::2])
    assert solve(CURVED + base, tmp_path / "whole", hinted)["status"] == "done"


def test_rounded_corners_belong_to_the_face_between_them(tmp_path: Path) -> None:
    face, whole = solve(PAD + BLOCK, tmp_path / "face"), solve(PAD + BLOCK, tmp_path / "whole", WHOLE)
    assert face["status"] == "done"
    assert face["contacts"]["face"]["force"] == whole["contacts"]["face"]["force"]
    # As masters too, and both of one name.
    named = PAD.replace("[[load]]", 'corners = ["c", "c", "", ""]\n[[load]]') + BLOCK
    swapped = named.replace(
        'slave = "pad.face"\nmaster = "block.top"', 'slave = "block.top"\nmaster = "pad.face"'
    )
    found = solve(swapped, tmp_path / "named")["contacts"]["face"]["force"][1]
    assert found == pytest.approx(-face["contacts"]["face"]["force"][1], rel=0.01)


def test_a_rounded_corner_with_a_condition_of_its_own_is_no_part_of_the_face(tmp_path: Path) -> None:
    text = PAD + BLOCK + '[[support]]\nboundary = "pad.corner1"\nux = 0.0\n'
    summary = solve(text, tmp_path / "run")
    assert "pad.corner1 lies inside block.top" in summary["stop_reason"]


def test_bodies_without_a_contact_are_told_how_deep_one_lies_in_the_other(tmp_path: Path) -> None:
    summary = solve(BARS, tmp_path / "run")
    assert summary["status"] == "failed"
    # Plane strain: (1 + nu) alpha T l, less the gap.
    depth = 1.3 * 1e-3 * 50.0 * 4.0 - 0.1
    words = summary["stop_reason"].split()
    assert float(words[words.index("by") + 1]) == pytest.approx(depth, rel=0.01)
    assert {words[0].partition(".")[0], words[3].partition(".")[0]} == {"hot", "cold"}
    assert summary["position"] == pytest.approx(0.25)
    assert "[[contact]] of its own" in summary["hint"]
    # Where the last state has no fields, it is looked at all the same.
    assert solve(BARS, tmp_path / "bare", "output.fields=[]")["status"] == "failed"
    assert solve(BARS, tmp_path / "cooler", "load.heat.temperature=15.0")["status"] == "done"


def test_tips_that_cross_between_their_nodes_are_told(tmp_path: Path) -> None:
    text = SOLID + item("load", name="heat", kind="temperature", body="left", temperature=1e-3)
    for name, points in (
        ("left", [[0.0, 0.0], [4.15, 0.0], [3.0, 1.0], [0.0, 1.0]]),
        ("right", [[3.85, 0.0], [8.0, 0.0], [8.0, 1.0], [5.0, 1.0]]),
    ):
        shape = {"kind": "polygon", "points": points, "names": ["bottom", "r", "top", "l"]}
        text += body(name, "solid", 0.5) + table("body.shape", **shape)
        text += support(f"{name}.top", ux=0.0, uy=0.0)
    assert " lies inside " in solve(text, tmp_path / "run")["stop_reason"]


def test_a_slit_that_closes_too_far_is_told(tmp_path: Path) -> None:
    summary = solve(SLIT, tmp_path / "run")
    assert summary["status"] == "done"
    assert sum("body clip overlaps itself near (" in text for text in summary["warnings"]) == 1
    summary = solve(SLIT, tmp_path / "open", "load.squeeze.pressure=0.02")
    assert not [text for text in summary["warnings"] if "overlaps itself" in text]


def test_sharp_corners_that_slide_a_little_are_let_be(tmp_path: Path) -> None:
    punch = (PAD + BLOCK).replace("rounding = [0.8, 0.8, 0.0, 0.0]", "rounding = [0.0, 0.0, 0.0, 0.0]")
    assert solve(punch, tmp_path / "punch")["status"] == "done"


def test_a_contact_pressed_up_to_a_smooth_end_is_told(tmp_path: Path) -> None:
    # So lightly that the corner's overlap is within the displacements' error.
    light = "load.press.uy=-1e-3"
    summary = solve(CURVED + PLANE, tmp_path / "face", light)
    assert summary["status"] == "done"
    told = [text for text in summary["warnings"] if "continues without a corner" in text]
    assert len(told) == 2
    assert 'contact.face.slave = ["pad.face", "pad.corner1"]' in told[0]
    summary = solve(CURVED + PLANE, tmp_path / "whole", light, WHOLE)
    assert not [text for text in summary["warnings"] if "continues without a corner" in text]


@pytest.mark.usefixtures("by_nodes")
def test_one_plane_may_be_the_obstacle_of_several_contacts(tmp_path: Path) -> None:
    feet = """points = [[-3, 0], [-1, 0], [-1, 1], [1, 1], [1, 0], [3, 0], [3, 3], [-3, 3]]
names = ["left", "l2", "arch", "r2", "right", "r1", "top", "l1"]
rounding = [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]"""
    start, _, rest = PAD.partition("points = ")
    text = start + feet + "\n" + rest[rest.index("[[load]]") :]
    both = [PLANE.replace("face", side) for side in ("left", "right")]
    summary = solve(text + "".join(both), tmp_path / "both", "load.press.uy=-0.01")
    assert summary["status"] == "done", summary["stop_reason"]
    summary = solve(text + both[0], tmp_path / "one", "load.press.uy=-0.01")
    assert summary["stop_reason"].startswith("pad.right lies inside the obstacle of contact left")


def test_what_from_and_to_leave_out_is_named(tmp_path: Path) -> None:
    ends = "from = [-0.6, 0.0]\nto = [0.6, 0.0]\nregularization"
    sharp = PAD.replace("rounding = [0.8, 0.8, 0.0, 0.0]", "rounding = [0.0, 0.0, 0.0, 0.0]")
    text = sharp + BLOCK.replace("regularization", ends)
    summary = solve(text, tmp_path / "run")
    assert summary["stop_reason"].startswith("pad.face lies inside block.top")
    assert summary["hint"].startswith("contact.face.from and to exclude it: remove them")
