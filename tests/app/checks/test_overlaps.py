"""Boundaries inside other bodies, obstacles or their own body: told with place and depth, or let be."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.app.runs import warned
from tests.app.scenes import done, solve
from tests.case_text import EXACT, FLOOR, Scene, body, contact, load, polygon, scene

SOLID = scene("strain", "solid", E=1000.0, alpha=0.001)
CORNERS = [[-2.0, 0.0], [2.0, 0.0], [2.0, 3.0], [-2.0, 3.0]]
PRESS = load("press", "pad.top", "platen", uy=-0.15, ux=0.0)


def pad(radius: float, **shape: Any) -> Scene:
    """A pad with two rounded corners."""
    shape = polygon(CORNERS, "face right top left", rounding=[radius, radius, 0.0, 0.0], **shape)
    return SOLID.body("pad", "solid", 0.3, shape) + PRESS


PAD = pad(0.8)
ANGLES = np.linspace(0.0, 0.5 * np.pi, 13)
"""Curves that are no arcs are no rounded corners: a contact does not take them in by itself."""


def curve(name: str, x: float, turned: float) -> dict[str, Any]:
    """A quarter of a circle about (x, 0.8) as a side through points, from an angle on."""
    places = np.stack([x + 0.8 * np.cos(ANGLES + turned), 0.8 + 0.8 * np.sin(ANGLES + turned)], axis=1)
    return {"name": name, "points": places.tolist()}


SIDES = [
    {"name": "face", "to": [1.2, 0.0]},
    curve("corner2", 1.2, -0.5 * np.pi),
    {"name": "right", "to": [2.0, 3.0]},
    {"name": "top", "to": [-2.0, 3.0]},
    {"name": "left", "to": [-2.0, 0.8]},
    curve("corner1", -1.2, np.pi),
]
CURVED = SOLID.body("pad", "solid", 0.3, {"kind": "outline", "sides": SIDES}) + PRESS
BASE = body("block", "solid", 0.3, box=([-5.0, 5.0], [-4.0, 0.0])).support("block.bottom", ux=0.0, uy=0.0)
COARSE: dict[str, Any] = {"regularization": EXACT, "accuracy": 0.1}
BLOCK = BASE.contact("face", "pad.face", "block.top", **COARSE)
PLANE = contact("face", "pad.face", obstacle=FLOOR, **COARSE)
WHOLE = 'contact.face.slave=["pad.face", "pad.corner1", "pad.corner2"]'
BARS = (
    SOLID.body("hot", "solid", 0.5, box=([0.0, 4.0], [0.0, 1.0]))
    .body("cold", "solid", 0.5, box=([4.1, 6.0], [-0.5, 1.5]))
    .support("hot.left", ux=0.0)
    .pin("hot", [0.0, 0.0], uy=0.0)
    .support("cold.right", ux=0.0, uy=0.0)
    .heat("heat", "hot", 50.0)
    .table("output", at=[0.25, 1.0])
)
OPEN = [[0.0, 0.0], [6.0, 0.0], [6.0, 1.0], [1.0, 1.0], [1.0, 1.15], [6.0, 1.15], [6.0, 2.15], [0.0, 2.15]]
SLIT = (
    SOLID.body("clip", "solid", 0.08, polygon=(OPEN, "lower l inner root outer u upper back"))
    .support("clip.lower", ux=0.0, uy=0.0)
    .load("squeeze", "clip.upper", "pressure", pressure=0.2)
)


@pytest.mark.parametrize(("base", "whom"), [(BLOCK, "block.top"), (PLANE, "the obstacle of contact face")])
def test_a_curve_beside_its_contact_is_told(tmp_path: Path, base: str, whom: str) -> None:
    summary = solve(CURVED + base, tmp_path / "face")
    assert summary["status"] == "failed"
    assert f"lies inside {whom} by 0.0" in summary["stop_reason"]
    assert summary["stop_reason"].startswith("pad.corner")
    hinted = summary["hint"].partition("as in ")[2].partition(", or draw")[0].replace(" = ", "=")
    assert {"pad.face", "pad.corner1", "pad.corner2"} == set(hinted.split('"')[1::2])
    done(CURVED + base, tmp_path / "whole", hinted)


def test_rounded_corners_belong_to_the_face_between_them(tmp_path: Path) -> None:
    face, whole = solve(PAD + BLOCK, tmp_path / "face"), solve(PAD + BLOCK, tmp_path / "whole", WHOLE)
    assert face["status"] == "done"
    assert face["contacts"]["face"]["force"] == whole["contacts"]["face"]["force"]
    # As masters too, and both of one name.
    named = pad(0.8, corners=["c", "c", "", ""])
    swapped = named.add(BASE).contact("face", "block.top", "pad.face", **COARSE)
    found = solve(swapped, tmp_path / "named")["contacts"]["face"]["force"][1]
    assert found == pytest.approx(-face["contacts"]["face"]["force"][1], rel=0.01)


def test_a_rounded_corner_with_a_condition_of_its_own_is_no_part_of_the_face(tmp_path: Path) -> None:
    text = (PAD + BLOCK).support("pad.corner1", ux=0.0)
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
    done(BARS, tmp_path / "cooler", "load.heat.temperature=15.0")


def test_tips_that_cross_between_their_nodes_are_told(tmp_path: Path) -> None:
    text = SOLID.heat("heat", "left", 1e-3)
    for name, points in (
        ("left", [[0.0, 0.0], [4.15, 0.0], [3.0, 1.0], [0.0, 1.0]]),
        ("right", [[3.85, 0.0], [8.0, 0.0], [8.0, 1.0], [5.0, 1.0]]),
    ):
        text = text.body(name, "solid", 0.5, polygon=(points, "bottom r top l"))
        text = text.support(f"{name}.top", ux=0.0, uy=0.0)
    assert " lies inside " in solve(text, tmp_path / "run")["stop_reason"]


def test_a_slit_that_closes_too_far_is_told(tmp_path: Path) -> None:
    summary = done(SLIT, tmp_path / "run")
    assert sum("body clip overlaps itself near (" in text for text in summary["warnings"]) == 1
    summary = solve(SLIT, tmp_path / "open", "load.squeeze.pressure=0.02")
    assert "self_overlap" not in warned(summary)


def test_sharp_corners_that_slide_a_little_are_let_be(tmp_path: Path) -> None:
    done(pad(0.0) + BLOCK, tmp_path / "punch")


def test_a_contact_pressed_up_to_a_smooth_end_is_told(tmp_path: Path) -> None:
    # So lightly that the corner's overlap is within the displacements' error.
    light = "load.press.uy=-1e-3"
    summary = done(CURVED + PLANE, tmp_path / "face", light)
    told = [text for text in summary["warnings"] if "continues without a corner" in text]
    assert len(told) == 2
    assert 'contact.face.slave = ["pad.face", "pad.corner1"]' in told[0]
    summary = solve(CURVED + PLANE, tmp_path / "whole", light, WHOLE)
    assert "contact_end" not in warned(summary)


@pytest.mark.usefixtures("by_nodes")
def test_one_plane_may_be_the_obstacle_of_several_contacts(tmp_path: Path) -> None:
    feet = [[-3, 0], [-1, 0], [-1, 1], [1, 1], [1, 0], [3, 0], [3, 3], [-3, 3]]
    text = SOLID.body("pad", "solid", 0.3, polygon=(feet, "left l2 arch r2 right r1 top l1")) + PRESS
    both = [PLANE.changed("face", side) for side in ("left", "right")]
    summary = done(text + "".join(both), tmp_path / "both", "load.press.uy=-0.01")
    summary = solve(text + both[0], tmp_path / "one", "load.press.uy=-0.01")
    assert summary["stop_reason"].startswith("pad.right lies inside the obstacle of contact left")


def test_what_from_and_to_leave_out_is_named(tmp_path: Path) -> None:
    part = ("contact.face.from=[-0.6, 0.0]", "contact.face.to=[0.6, 0.0]")
    summary = solve(pad(0.0) + BLOCK, tmp_path / "run", *part)
    assert summary["stop_reason"].startswith("pad.face lies inside block.top")
    assert summary["hint"].startswith("contact.face.from and to exclude it: remove them")
