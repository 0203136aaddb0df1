"""Loads that contacts cannot carry: what slides, tips or comes off is named, with the part that can be."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from mlsanm_cli.solve.direction_updates import Turned
from tests.app.runs import warned
from tests.app.scenes import EXACT_LAW, done, solve
from tests.case_text import FLOOR, Scene, body, contact, scene

BRICK = (
    scene("strain", "stone", E=20e3, nu=0.2)
    .body("brick", "stone", box=([0.0, 2.0], [0.0, 3.0]))
    .body_force("weight", "brick", [0.0, -1.0])
    .body_force("quake", "brick", [1.0, 0.0])
    .contact("floor", "brick.bottom", obstacle=FLOOR, friction=0.9, accuracy=0.05)
    .stages("weight", "quake")
)
UP = "load.quake.body-force=[0.0, 2.5]"


@pytest.mark.parametrize("angle", [0.1, 1e9])
def test_loads_that_turn_a_body_round_and_round_may_have_other_units(angle: float) -> None:
    error = Turned(("pin",), angle, 1e9).error
    assert error is not None
    assert ("check the units" in error.hint) == (angle > 1.0)


@pytest.mark.parametrize(
    ("settings", "how", "position"),
    [
        ([], "tips over", 1.0 + 2.0 / 3.0),
        ([EXACT_LAW, UP], "loses contact", 1.4),
        ([EXACT_LAW, UP, "contact.floor.friction=0.0"], "loses contact", 1.4),
    ],
)
def test_limit_loads_are_named(tmp_path: Path, settings: list[str], how: str, position: float) -> None:
    summary = solve(BRICK, tmp_path / "run", *settings)
    assert summary["status"] == "failed"
    found = re.match(rf"body brick {how} at position ([0-9.]+): ", summary["stop_reason"])
    assert found, summary["stop_reason"]
    # The pressures' grid tells the edge that the brick turns about to a few percent.
    assert float(found[1]) == pytest.approx(position, rel=0.02)
    hint = re.match(r"apply at most ([0-9.]+) % .*quake", summary["hint"])
    assert hint
    assert float(hint[1]) == pytest.approx(100.0 * (position - 1.0), rel=0.04)
    if settings == [EXACT_LAW, UP, "contact.floor.friction=0.0"]:
        assert float(summary["position"]) == pytest.approx(position, rel=1e-3)
    if settings:
        less = f"stage=[{{weight=1.0}},{{quake={0.0097 * float(hint[1])!r}}}]"
        done(BRICK, tmp_path / "less", *settings, less)


def feet(hinge: float, on_block: bool) -> Scene:
    """A plate on two half-disks, on a block or on a rigid floor, pushed at its hinge."""
    under = {"master": "base.top"} if on_block else {"obstacle": FLOOR}
    plate = {"ux": 0.0, "fy": -500.0, "hinge": [hinge, 15.0]}
    text = scene("strain").load("plate", ["a.flat", "b.flat"], "platen", **plate)
    for name, x in (("a", -20.0), ("b", 20.0)):
        text = text.body(name, "steel", half_disk=([x, 15.0], 15.0))
        text = text.contact(f"under-{name}", f"{name}.arc", **under)
    base = body("base", "steel", box=([-60.0, 60.0], [-40.0, 0.0])).support("base.bottom", ux=0.0, uy=0.0)
    return text + base if on_block else text


@pytest.mark.parametrize(("hinge", "on_block"), [(23.0, True), (27.5, False)])
def test_a_plate_pressed_beside_its_feet_tips_over(hinge: float, on_block: bool, tmp_path: Path) -> None:
    """No stage has a state, though a coarse grid finds one."""
    summary = solve(feet(hinge, on_block), tmp_path / "run")
    assert re.match("body a and body b .*tip over: ", summary["stop_reason"])


def test_a_body_slides_until_a_wall_stops_it(tmp_path: Path) -> None:
    # All of the floor slips from the first load on, which was taken for a limit load.
    wall = contact("wall", "brick.left", plane=([0.0, 0.0], [1.0, 0.0]))
    settings = ["contact.floor.friction=0.2", "load.quake.body-force=[-0.5, 0.0]"]
    once = "stage=[{weight=1.0, quake=1.0}]"
    contacts = solve(BRICK + wall, tmp_path / "run", once, *settings)["contacts"]
    (along, down), (against, _) = (contacts[name]["force"] for name in ("floor", "wall"))
    assert down == pytest.approx(6.0, rel=1e-6)
    assert along + against == pytest.approx(3.0, rel=1e-6)
    assert against >= 3.0 - 0.2 * 6.0 - 1e-6


@pytest.mark.parametrize("friction", [0.0, 0.3])
def test_a_contact_that_stays_open_limits_nothing(tmp_path: Path, friction: float) -> None:
    # The smooth law has no scale then, and had refused to start.
    bar = (
        scene("strain", "stone", E=20e3, nu=0.0)
        .body("bar", "stone", box=([0.0, 2.0], [0.0, 1.0]), clamped="top")
        .body_force("weight", "bar", [0.0, -1.0])
        .contact("floor", "bar.bottom", plane=([0.0, -0.1], [0.0, 1.0]), friction=friction)
        .probe("end", "bar", [1.0, 0.0])
    )
    summary = done(bar, tmp_path / "run")
    assert summary["probes"]["end"]["displacement"] == pytest.approx([0.0, -2.5e-5], abs=1e-9)
    assert "no_pressure" in warned(summary)


def test_round_bodies_that_slide_far_along_each_other_are_refused(tmp_path: Path) -> None:
    """A disk on two others spreads them; with a low friction it took minutes, without a cause."""
    text, places = scene("strain", "soft", E=1e3), {"left": [-1.0, 1.0], "right": [1.0, 1.0]}
    for name, center in (places | {"top": [0.0, 1.0 + np.sqrt(3.0)]}).items():
        text = text.body(name, "soft", disk=(center, 1.0)).body_force(f"on-{name}", name, [0.0, -0.05])
    for name in places:
        text = text.contact(f"under-{name}", f"{name}.arc", obstacle=FLOOR, friction=0.05, accuracy=0.1)
        text = text.contact(f"on-{name}", "top.arc", f"{name}.arc", friction=0.05, accuracy=0.1)
    summary = solve(text.stages("on-left on-right on-top"), tmp_path / "run")
    assert "does not hold the bodies in their drawn position" in summary["stop_reason"]
