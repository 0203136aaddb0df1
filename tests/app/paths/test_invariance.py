"""Results do not depend on how a scene is written: order of contacts and bodies, slave and master, units."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pytest

from tests.app.scenes import solve
from tests.case_text import Scene, body, contact, scene


def feet(length: float = 1.0, stress: float = 1.0, swapped: bool = False, backwards: bool = False) -> Scene:
    """A plate on two half-disks of other heights, on a block, pressed until both touch and then dragged."""
    force = [-400.0 * stress * length, 0.02 * length]
    text = scene("strain", E=210e3 * stress)
    text = text.load("press", ["left.flat", "right.flat"], "platen", fy=force[0])
    text = text.load("drag", ["left.flat", "right.flat"], "platen", ux=force[1])
    parts, pairs = [], []
    for name, x, low in (("left", -20.0, 0.0), ("right", 25.0, 1e-3)):
        center = [x * length, (15.0 + low) * length]
        parts.append(body(name, "steel", half_disk=(center, 15.0 * length)))
        sides = ("base.top", f"{name}.arc") if swapped else (f"{name}.arc", "base.top")
        pairs.append(contact(f"under-{name}", *sides, friction=0.3, accuracy=0.05))
    corners = ([-60.0 * length, 60.0 * length], [-40.0 * length, 0.0])
    parts.append(body("base", "steel", box=corners, clamped="bottom"))
    if backwards:
        parts, pairs = parts[::-1], pairs[::-1]
    return text.add(*parts, *pairs).stages("press", "drag")


def figures(
    summary: Mapping[str, Any], length: float = 1.0, stress: float = 1.0, side: float = 1.0
) -> list[float]:
    """Forces, dissipated work and widths in the units of the first scene."""
    found = []
    for name in ("under-left", "under-right"):
        one = summary["contacts"][name]
        found += [side * value / (length * stress) for value in one["force"]]
        found += [one["dissipated_work"] / (length**2 * stress), one["half_width"] / length]
        found.append(one["peak_pressure"] / stress)
    return found


@pytest.fixture(scope="module")
def drawn(tmp_path_factory: pytest.TempPathFactory) -> Mapping[str, Any]:
    summary = solve(feet(), tmp_path_factory.mktemp("feet") / "run")
    assert summary["status"] == "done"
    return summary


@pytest.mark.usefixtures("monkeypatch")  # grids must not begin with those of other tests
@pytest.mark.parametrize(
    ("given", "units", "bound"),
    [
        ({"backwards": True}, {}, 1e-8),
        ({"swapped": True}, {"side": -1.0}, 1e-8),
        ({"length": 1e-3, "stress": 1e6}, {"length": 1e-3, "stress": 1e6}, 1e-8),
    ],
    ids=["order", "slave and master", "units"],
)
def test_results_do_not_depend_on_how_a_scene_is_written(
    given: dict[str, Any], units: dict[str, float], bound: float, drawn: Mapping[str, Any], tmp_path: Path
) -> None:
    summary = solve(feet(**given), tmp_path / "run")
    assert summary["status"] == "done"
    found, expected = figures(summary, **units), figures(drawn)
    for name in ("under-left", "under-right"):
        for count in ("closed_nodes", "stick_nodes"):
            assert summary["contacts"][name][count] == drawn["contacts"][name][count]
    largest = max(map(abs, expected))
    assert found == pytest.approx(expected, rel=bound, abs=bound * largest)
