"""Loads on a small part of a boundary have the nodes that they need, and their exact resultant."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from mlsanm_cli.app.scene import load_spacing
from mlsanm_cli.app.scene.load_spacing import resolved_sizes
from tests.app.scenes import solve
from tests.case_text import body, box, head, item, load, material, support

HALF, DEPTHS = 0.2, (0.25, 0.5, 1.0)


def off(directory: Path, pressure: float | str = 1.0, **part: list[float]) -> float:
    """How far vertical stresses under a strip of a block a hundred times as wide are from those of a
    half-plane (Johnson, Contact Mechanics, 1985, equation 2.30), as a part of the pressure; the resultant is
    exact."""
    text = (
        head("strain") + material("m", E=1000.0, nu=0.3) + body("block", "m", shape=box([-10, 10], [-10, 0]))
    )
    text += support("block.bottom", ux=0.0, uy=0.0)
    text += load("press", "block.top", "pressure", pressure=pressure, **part)
    for number, depth in enumerate(DEPTHS):
        text += item("probe", name=f"p{number}", body="block", point=[0.0, -depth * HALF])
    summary = solve(text, directory / "run")
    assert summary["status"] == "done", summary
    assert summary["forces"]["press"][1] == pytest.approx(-2.0 * HALF, rel=1e-9)
    assert summary["nodes"] < 800
    angles = [2.0 * math.atan(1.0 / depth) for depth in DEPTHS]
    exact = [-(angle + math.sin(angle)) / math.pi for angle in angles]
    found = [summary["probes"][f"p{number}"]["stress"][1] for number in range(len(DEPTHS))]
    return float(np.abs(np.subtract(found, exact)).max())


def test_a_pressure_on_a_part_of_a_side(tmp_path: Path) -> None:
    assert off(tmp_path, from_=[-HALF, 0.0], to=[HALF, 0.0]) < 0.01


def test_a_pressure_that_an_expression_ends(tmp_path: Path) -> None:
    assert off(tmp_path, f"1 if abs(x) < {HALF} else 0") < 0.01


def test_nodes_by_the_body_alone_are_not_enough(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(load_spacing, "PER_LENGTH", 1.0)
    monkeypatch.setattr(load_spacing, "PER_LENGTH_AT_ENDS", 2.0)
    with pytest.raises(AssertionError):
        assert off(tmp_path, from_=[-HALF, 0.0], to=[HALF, 0.0]) < 0.03


def test_spacings_resolve_what_is_not_linear() -> None:
    x = np.linspace(-1.0, 1.0, 129)
    assert (resolved_sizes(x[:, None], 2.0, 0.5) == 0.5).all()
    sizes = resolved_sizes(np.exp(-((x / 0.1) ** 2))[:, None], 2.0, 0.5)
    assert sizes[[0, -1]].tolist() == [0.5, 0.5]
    assert 0.01 < sizes.min() < 0.03
