"""Small parts of bodies that are loaded, held or hot have the nodes that they need."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from mlsanm_cli.app.scene import clouds
from tests.app.runs import warned
from tests.app.scenes import done, solve
from tests.case_text import Scene, item, load, scene

E, ALPHA, WIDTH = 1000.0, 1e-5, 0.5
HALF, DEPTHS = 0.2, (0.25, 0.5, 1.0)
STRIP: dict[str, Any] = {"from_": [-HALF, 0.0], "to": [HALF, 0.0]}
PART: dict[str, Any] = {"from_": [-0.3, 0.0], "to": [0.3, 0.0]}
BLOCK = scene("strain", "m", E=E).body("block", "m", box=([-10, 10], [-10, 0]), clamped="bottom")
"""A hundred times as wide as what is loaded."""


@pytest.mark.parametrize("strip", [{"pressure": 1.0, **STRIP}, {"pressure": f"1 if abs(x) < {HALF} else 0"}])
def test_a_pressure_ends_within_a_side(strip: dict[str, Any], tmp_path: Path) -> None:
    """Vertical stresses are those of a half-plane (Johnson, Contact Mechanics, 1985, equation 2.30)."""
    text = BLOCK.load("press", "block.top", "pressure", **strip)
    for number, depth in enumerate(DEPTHS):
        text = text.probe(f"p{number}", "block", [0.0, -depth * HALF])
    summary = done(text, tmp_path / "run")
    assert summary["forces"]["press"][1] == pytest.approx(-2.0 * HALF, rel=1e-9)
    assert summary["nodes"] < 800
    angles = [2.0 * math.atan(1.0 / depth) for depth in DEPTHS]
    exact = [-(angle + math.sin(angle)) / math.pi for angle in angles]
    found = [probe["stress"][1] for probe in summary["probes"].values()]
    assert found == pytest.approx(exact, abs=0.01)


def test_a_smooth_plate_on_a_part_of_a_side(tmp_path: Path) -> None:
    """The vertical stress beneath it is that in a half-plane under the pressures P / (pi sqrt(a^2 - x^2))
    (Johnson, Contact Mechanics, 1985, equation 2.64)."""
    angle = (np.arange(2000) + 0.5) * np.pi / 2000
    x, depth = 0.3 * np.cos(angle), 0.3
    exact = -float(np.mean(2.0 * depth**3 / (np.pi * (x**2 + depth**2) ** 2)))
    text = BLOCK.load("press", "block.top", "platen", fy=-1.0, **PART).probe("below", "block", [0.0, -depth])
    stress = done(text, tmp_path / "run")["probes"]["below"]["stress"]
    assert stress[1] == pytest.approx(exact, rel=0.015)


@pytest.mark.parametrize(("stiffness", "force"), [(100.0, 0.43627), (1000.0, 2.1238), (1e6, 3.8023)])
def test_springs_along_a_part_of_a_side_that_is_pulled(
    stiffness: float, force: float, tmp_path: Path
) -> None:
    """Forces by the block's compliance under 16 strips of the part, from runs with pressures on each."""
    springs = item("support", boundary="block.top", spring=[0.0, stiffness], **PART)
    pull = load("pull", "block.top", "pressure", pressure=-1.0)
    forces = done(BLOCK + springs + pull, tmp_path / "run")["forces"]
    assert forces["pull"][1] == pytest.approx(20.0, rel=1e-9)
    assert forces["block.top from (-0.3, 0) to (0.3, 0)"][1] == pytest.approx(-force, rel=0.015)


def hot_spot() -> Scene:
    return (
        scene("stress", "m", E=E, alpha=ALPHA)
        .body("plate", "m", box=([-10, 10], [-10, 10]))
        .support("plate.bottom", uy=0.0)
        .pin("plate", [0.0, -10.0], ux=0.0)
        .heat("heat", "plate", f"100*exp(-(x**2 + y**2)/{WIDTH}**2)")
        .probe("middle", "plate", [0.0, 0.0])
        .probe("beside", "plate", [WIDTH, 0.0])
    )


def stresses(r: float) -> tuple[float, float]:
    """Radial and hoop stress of a hot spot in an infinite plate (Timoshenko and Goodier, Theory of
    Elasticity, 1970, article 150)."""
    scale = 100.0 * E * ALPHA
    hot = math.exp(-((r / WIDTH) ** 2))
    mean = 0.5 * (WIDTH / r) ** 2 * (1.0 - hot) if r > 0.0 else 0.5
    return -scale * mean, scale * (mean - hot)


def test_a_hot_spot_has_the_nodes_it_needs(tmp_path: Path) -> None:
    summary = done(hot_spot(), tmp_path / "run")
    assert "load_resolution" not in warned(summary)
    assert summary["nodes"] < 1250
    for name, r in (("middle", 0.0), ("beside", WIDTH)):
        assert summary["probes"][name]["stress"][:2] == pytest.approx(stresses(r), abs=0.012)


def test_nodes_that_miss_a_hot_spot_are_warned_of(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    known = clouds.CONDITION_SOURCES
    sources = [source for source in known if source is not clouds.varying_fields]
    monkeypatch.setattr(clouds, "CONDITION_SOURCES", sources)
    summary = solve(hot_spot(), tmp_path / "run")
    assert summary["probes"]["middle"]["stress"][0] < 2.0 * stresses(0.0)[0]
    assert "load.heat varies faster" in summary["warnings"][0]
    # Nothing is hot on the boundary, and yet there are forces to compare with.
    assert summary["force_balance"] < 1e-9
