"""Supports of single nodes, on contact surfaces too: the point stays, and its force is listed."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.app.scenes import solve
from tests.case_text import FLOOR, Scene, contact, load, pin, probe, scene

BLOCK = scene("strain", "soft", E=1000.0).body("b", "soft", box=([-2.0, 2.0], [0.0, 1.0]))
ON_FLOOR = load("p", "b.top", "pressure", pressure="10 if 0 < x < 1 else 0") + contact(
    "c", "b.bottom", obstacle=FLOOR
)


@pytest.mark.parametrize(
    "place", [[1.0, 0.0], [0.3, 0.0], [-2.0, 1.0]], ids=["load", "contact", "free corner"]
)
def test_the_point_stays(place: list[float], tmp_path: Path) -> None:
    """Wherever the point is that is held sideways, others move alike relative to it."""
    probes = Scene().add(probe("pin", "b", place), probe("a", "b", [2.0, 0.5]), probe("b", "b", [-2.0, 0.5]))
    found = solve(BLOCK + pin("b", place, ux=0.0) + ON_FLOOR + probes, tmp_path / "run")
    moved = {name: one["displacement"][0] for name, one in found["probes"].items()}
    assert abs(moved["pin"]) <= 5e-6
    assert moved["a"] - moved["b"] == pytest.approx(3.996e-3, rel=5e-3)
    if place == [1.0, 0.0]:
        assert moved["b"] == pytest.approx(-4.106e-3, rel=2e-3)
        assert moved["a"] == pytest.approx(-1.10e-4, abs=5e-6)


def test_forces_of_single_nodes_follow_from_statics(tmp_path: Path) -> None:
    """A beam on two points: the one at a quarter of the span carries three quarters of the load."""
    supports = pin("b", [-2.0, 0.0], ux=0.0, uy=0.0) + pin("b", [2.0, 0.0], uy=0.0)
    loads = load("down", "b.top", "traction", traction=["1.0", "-4 if -2 < x < 0 else 0"])
    forces = solve(BLOCK + supports + loads, tmp_path / "run")["forces"]
    # Moments about the left point: 8 at 1 from it, and the shear of 4 at height 1.
    assert forces["b near (2, 0)"] == pytest.approx([0.0, (8.0 * 1.0 + 4.0 * 1.0) / 4.0], abs=1e-8)
    assert forces["b near (-2, 0)"] == pytest.approx([-4.0, 5.0], abs=1e-8)
