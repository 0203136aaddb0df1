"""Surfaces that slide along each other further than small strain allows are told."""

from __future__ import annotations

from pathlib import Path

from tests.app.scenes import solve
from tests.app.test_finite_bodies import disk_on_block
from tests.case_text import item, load


def test_dragging_at_small_strain_is_warned_of(tmp_path: Path) -> None:
    """Half a disk dragged by its radius leaves its pressure behind."""
    text = disk_on_block(0.03, 0.5, {"at": [0.0, 2.0], "spacing": 0.05, "radius": 0.5})
    text = text.replace('strain = "finite"', "").replace('law = "neo-hookean"', "")
    text += load("drag", "disk.flat", "displacement", displacement=[0.8, 0.0])
    text += item("stage", press=1.0) + item("stage", drag=1.0)
    summary = solve(text, tmp_path / "run")
    (told,) = [one for one in summary["warnings"] if "slide along each other" in one]
    assert "contact touch" in told
    assert 'strain = "finite"' in told
    still = solve(text, tmp_path / "still", "load.drag.displacement=[0.01, 0.0]")
    assert not any("slide along" in one for one in still["warnings"])
