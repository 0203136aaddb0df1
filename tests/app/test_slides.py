"""Surfaces that slide along each other further than small strain allows are told."""

from __future__ import annotations

from pathlib import Path

from tests.app.scenes import solve
from tests.app.test_finite_bodies import DISK


def test_dragging_at_small_strain_is_warned_of(tmp_path: Path) -> None:
    """Half a disk dragged by its radius leaves its pressure behind."""
    text = DISK.replace('strain = "finite"', "").replace('law = "neo-hookean"', "")
    text = text.replace("[0.0, -0.3]", "[0.0, -0.03]")
    text = text[: text.index("[output]")] + '[[load]]\nname = "drag"\nboundary = "disk.flat"\n'
    text += (
        'kind = "displacement"\ndisplacement = [0.8, 0.0]\n[[stage]]\npress = 1.0\n[[stage]]\ndrag = 1.0\n'
    )
    summary = solve(text, tmp_path / "run")
    (told,) = [one for one in summary["warnings"] if "slide along each other" in one]
    assert "contact touch" in told
    assert 'strain = "finite"' in told
    still = solve(text, tmp_path / "still", "load.drag.displacement=[0.01, 0.0]")
    assert not any("slide along" in one for one in still["warnings"])
