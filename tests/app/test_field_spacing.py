"""Temperatures and body forces that vary within a few spacings."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import pytest

from mlsanm_cli.app.scene import clouds
from tests.app.scenes import solve
from tests.case_text import body, box, head, item, material, pin, support

E, ALPHA, WIDTH = 1000.0, 1e-5, 0.5


def plate(directory: Path, temperature: str, spacing: float | None = None) -> dict[str, Any]:
    text = head("stress") + material("m", E=E, nu=0.3, alpha=ALPHA)
    text += body("plate", "m", spacing, box([-10, 10], [-10, 10]))
    text += support("plate.bottom", uy=0.0) + pin("plate", [0.0, -10.0], ux=0.0)
    text += item("load", name="heat", kind="temperature", body="plate", temperature=temperature)
    text += item("probe", name="middle", body="plate", point=[0.0, 0.0])
    text += item("probe", name="beside", body="plate", point=[WIDTH, 0.0])
    return dict(solve(text, directory / "run"))


SPOT = f"100*exp(-(x**2 + y**2)/{WIDTH}**2)"


def stresses(r: float) -> tuple[float, float]:
    """Radial and hoop stress of a hot spot in an infinite plate (Timoshenko and Goodier, Theory of
    Elasticity, 1970, article 150)."""
    scale = 100.0 * E * ALPHA
    hot, mean = math.exp(-((r / WIDTH) ** 2)), 0.5
    if r > 0.0:
        mean = 0.5 * (WIDTH / r) ** 2 * (1.0 - hot)
    return -scale * mean, scale * (mean - hot)


def test_a_hot_spot_has_the_nodes_it_needs(tmp_path: Path) -> None:
    summary = plate(tmp_path, SPOT)
    assert summary["status"] == "done", summary
    assert not any("varies faster" in warning for warning in summary["warnings"])
    assert summary["nodes"] < 1200
    for name, r in (("middle", 0.0), ("beside", WIDTH)):
        radial, hoop = stresses(r)
        assert summary["probes"][name]["stress"][:2] == pytest.approx((radial, hoop), abs=0.012)


def test_nodes_that_miss_a_hot_spot_are_warned_of(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(clouds, "field_zones", lambda *_: ())
    summary = plate(tmp_path, SPOT)
    assert summary["probes"]["middle"]["stress"][0] < 2.0 * stresses(0.0)[0]
    assert "load.heat varies faster" in summary["warnings"][0]
    # Nothing is hot on the boundary, and yet there are forces to compare with.
    assert summary["force_balance"] < 1e-9
