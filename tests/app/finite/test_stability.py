"""Stability of equilibrium at finite strain: Euler's loads, and states that are not stable."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.app.runs import warned
from tests.app.scenes import done
from tests.case_text import body, box, contact, head, item, load, material, support

LENGTH = 8.0
COLUMN = (
    head("strain", strain="finite")
    + material("steel", E=1000.0, nu=0.0, law="saint-venant-kirchhoff")
    + body("column", "steel", 0.25, box([-0.5, 0.5], [0.0, LENGTH]))
    + support("column.bottom", ux=0.0, uy=0.0)
    + item("probe", name="top", body="column", point=[0.0, LENGTH])
)
FREE, GUIDED = 3.16779, 0.0123908
"""Critical force of the column with a free top, and critical strain with a top that moves without turning:
6 x 24 nine-node finite elements. Euler's load for the first is 3.213, without shear and shortening."""


@pytest.mark.parametrize("method", ["anm", "newton"])
def test_a_straight_column_buckles(tmp_path: Path, method: str) -> None:
    """It went on straight to any load, and so may a path whose equations know no other branch."""
    pressed = load("press", "column.top", "traction", traction=[0.0, -1.1 * FREE])
    summary = done(COLUMN + pressed, tmp_path / "run", f'solver.method="{method}"')
    (found,) = summary["finite_strain"]["bifurcations"]
    assert found["position"] * 1.1 == pytest.approx(1.0, rel=2e-3)
    assert abs(found["direction"][0]) > 0.99
    assert found["point"][1] == LENGTH
    assert warned(summary) == ["bifurcation"]
    assert abs(summary["probes"]["top"]["displacement"][0]) > 0.3 * LENGTH


def test_a_pulled_column_stays_straight(tmp_path: Path) -> None:
    pulled = load("pull", "column.top", "traction", traction=[0.0, 1.1 * FREE])
    summary = done(COLUMN + pulled, tmp_path / "run")
    assert not summary["finite_strain"]["bifurcations"]
    assert not warned(summary)


def test_a_column_buckles_against_walls(tmp_path: Path) -> None:
    """The end goes down by far more than Euler's shortening, without turning. Increments of a quarter of that
    led onto the straight branch, with 24 times the force."""
    gap = 0.2
    text = COLUMN + load("press", "column.top", "displacement", uy=-0.2)
    for name, side in (("left", -1.0), ("right", 1.0)):
        wall = {"kind": "plane", "point": [side * (0.5 + gap), 0.0], "normal": [-side, 0.0]}
        text += contact(name, f"column.{name}", obstacle=wall)
    summary = done(text, tmp_path / "run")
    (found,) = summary["finite_strain"]["bifurcations"]
    assert found["position"] * 0.2 / LENGTH == pytest.approx(GUIDED, rel=2e-3)
    assert abs(summary["probes"]["top"]["displacement"][0]) == pytest.approx(gap, rel=0.01)
    assert "bifurcation" in warned(summary)
    assert "equilibrium" not in warned(summary)
