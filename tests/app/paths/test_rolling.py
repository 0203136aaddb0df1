"""Round bodies that contacts alone hold: where loads roll them, and how far they turn."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.app.runs import warned
from tests.app.scenes import done, solve
from tests.case_text import EXACT, FLOOR, Scene, disk, half_disk, scene


def weighed(shape: dict[str, Any], along: float) -> Scene:
    """A body of one material and weight on a rough floor, pushed along it."""
    return (
        scene("strain", "soft", E=1e3, nu=0.3)
        .body("round", "soft", shape=shape)
        .body_force("weight", "round", [0.0, -0.05])
        .body_force("push", "round", [along * 0.05, 0.0])
        .contact("floor", "round.arc", obstacle=FLOOR, friction=0.3, accuracy=0.1)
        .stages("weight", "push")
    )


@pytest.mark.parametrize(("along", "rolls"), [(0.1, True), (0.0, False)])
def test_a_disk_on_a_floor_is_rolled_by_any_push(tmp_path: Path, along: float, rolls: bool) -> None:
    """Its weight seemed to turn it back, so that the run was done with a rotation of a tenth."""
    summary = solve(weighed(disk([0.0, 5.0], 5.0), along), tmp_path / "run")
    assert (summary["status"] == "failed") == rolls
    assert ("rolls" in summary["stop_reason"]) == rolls


def test_how_far_a_rocker_turns_is_told(tmp_path: Path) -> None:
    """A half-disk turns back by its weight at the radius less the height of its middle, not at the radius."""
    summary = done(weighed(half_disk([0.0, 5.0], 5.0), 0.02), tmp_path / "run")
    told = re.search(r"would rotate ([0-9.]+) times as far", " ".join(summary["warnings"]))
    assert told
    assert float(told[1]) == pytest.approx(3.0 * np.pi / 4.0, rel=0.05)


@pytest.mark.parametrize("mu", [0.15, 0.3])
def test_a_disk_settles_and_turns_in_a_rough_groove(tmp_path: Path, mu: float) -> None:
    """A moment turns it from mu W R sqrt(2)/(1 + mu^2) on; small strain carries a little more."""
    moment = 1.4
    turn = 2.0 * moment / np.pi
    text = (
        scene("strain", "soft", E=300.0)
        .body("round", "soft", disk=([0.0, 1.0], 1.0))
        .body_force("weight", "round", [0.0, -1.0])
        .body_force("turn", "round", [f"{turn}*(1 - y)", f"{turn}*x"])
        .stages("weight", "turn")
    )
    for name, side in (("left", 1.0), ("right", -1.0)):
        wall = ([0.0, 1.0 - np.sqrt(2.0)], [side, 1.0])
        text = text.contact(name, "round.arc", plane=wall, friction=mu, accuracy=0.1)
    summary = solve(text, tmp_path / "run")
    assert summary["status"] == "failed"
    limit = mu * np.pi * np.sqrt(2.0) / (1.0 + mu**2) / moment
    excess = (summary["position"] - 1.0) / limit - 1.0
    told = re.search(r"([0-9.]+) % too large", " ".join(summary["warnings"]))
    assert told
    assert 0.01 < excess < 0.01 * float(told[1]) < 4.0 * excess


def test_dragging_at_small_strain_is_warned_of(tmp_path: Path) -> None:
    """Half a disk dragged by its radius leaves its pressure behind."""
    text = (
        scene("strain")
        .body("disk", "steel", half_disk=([0.0, 1.0], 1.0))
        .body("block", "steel", box=([-2.0, 2.0], [-2.0, 0.0]), clamped="bottom")
        .load("press", "disk.flat", "displacement", displacement=[0.0, -0.03])
        .load("drag", "disk.flat", "displacement", displacement=[0.8, 0.0])
        .contact("touch", "disk.arc", "block.top", regularization=EXACT, accuracy=0.1)
        .stages("press", "drag")
    )
    (told,) = [one for one in solve(text, tmp_path / "run")["warnings"] if "slide along each other" in one]
    assert "contact touch" in told
    assert 'strain = "finite"' in told
    still = solve(text, tmp_path / "still", "load.drag.displacement=[0.01, 0.0]")
    assert "sliding_distance" not in warned(still)
