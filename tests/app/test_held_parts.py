"""Parts of a side that are held in one direction, or by springs: stresses at their ends are singular."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from mlsanm_cli.mechanics import corners
from tests.app.scenes import solve
from tests.case_text import body, box, head, item, load, material, support

PART = {"from_": [-0.3, 0.0], "to": [0.3, 0.0]}


def block(directory: Path, *conditions: str) -> dict[str, Any]:
    text = (
        head("strain") + material("m", E=1000.0, nu=0.3) + body("block", "m", shape=box([-10, 10], [-10, 0]))
    )
    text += support("block.bottom", ux=0.0, uy=0.0) + "".join(conditions)
    text += item("probe", name="below", body="block", point=[0.0, -0.3])
    summary = solve(text, directory / "run")
    assert summary["status"] == "done", summary
    return dict(summary)


def under_plate(directory: Path) -> float:
    """The vertical stress under a smooth rigid plate on a part of a side, over that in a half-plane with the
    pressures P / (pi sqrt(a^2 - x^2)) (Johnson, Contact Mechanics, 1985, equation 2.64)."""
    press = load("press", "block.top", "platen", fy=-1.0, **PART)
    angle = (np.arange(2000) + 0.5) * np.pi / 2000
    x, depth = 0.3 * np.cos(angle), 0.3
    exact = -float(np.mean(2.0 * depth**3 / (np.pi * (x**2 + depth**2) ** 2)))
    return float(block(directory, press)["probes"]["below"]["stress"][1]) / exact


def test_a_smooth_plate_on_a_part_of_a_side(tmp_path: Path) -> None:
    assert under_plate(tmp_path) == pytest.approx(1.0, abs=0.015)


def test_rows_at_the_ends_need_their_weights(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(corners, "MAX_MIXED_ANGLE", -np.inf)
    with pytest.raises(AssertionError):
        assert under_plate(tmp_path) == pytest.approx(1.0, abs=0.1)


@pytest.mark.parametrize(
    ("stiffness", "force"), [(100.0, 0.43627), (1000.0, 2.1238), (5000.0, 3.2540), (1e6, 3.8023)]
)
def test_springs_along_a_part_of_a_side_that_is_pulled(
    stiffness: float, force: float, tmp_path: Path
) -> None:
    """Forces by the block's compliance under 16 strips of the part, from runs with pressures on each."""
    springs = item("support", boundary="block.top", spring=[0.0, stiffness], **PART)
    forces = block(tmp_path, springs, load("pull", "block.top", "pressure", pressure=-1.0))["forces"]
    assert forces["pull"][1] == pytest.approx(20.0, rel=1e-9)
    assert forces["block.top from (-0.3, 0) to (0.3, 0)"][1] == pytest.approx(-force, rel=0.015)
