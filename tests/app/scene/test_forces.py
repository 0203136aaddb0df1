"""Forces and moments that are spread over bodies and boundaries."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from tests.app.scenes import solve
from tests.case_text import Scene, box, head

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
