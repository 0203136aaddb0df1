"""Directions in which surfaces press that turn with their bodies."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.app.scenes import solve
from tests.case_text import body, box, contact, disk, head, material, pushed, support

BEAM = (
    head("stress")
    + material("alloy", E=70e3, nu=0.33)
    + body("beam", "alloy", shape=box([0.0, 20.0], [0.0, 2.0]))
    + support("beam.left", ux=0.0, uy=0.0)
    + pushed("press", "nose", uy=-0.3)
)
ROUND = [[17.0 + 2.0 * np.cos(a), 4.0 + 2.0 * np.sin(a)] for a in np.linspace(np.pi, 2.0 * np.pi, 61)]
SAMPLES = {"kind": "polyline", "points": ROUND}


@pytest.mark.parametrize("nose", [disk([17.0, 4.0], 2.0), SAMPLES], ids=["disk", "samples"])
def test_a_round_obstacle_presses_perpendicular_to_a_flat_body(nose: dict[str, Any], tmp_path: Path) -> None:
    """Along the obstacle's normals at the places drawn, it pressed to the side by half as much again."""
    found = solve(BEAM + contact("nose", "beam.top", obstacle=nose), tmp_path / "run")
    across, along = found["contacts"]["nose"]["force"]
    # The slope of a cantilever under its load, with shear, which takes part of the deflection.
    shear = 0.3 * 70e3 / (70e3 / 2.66 * 5.0 / 6.0) * (2.0 / 17.0) ** 2 / 4.0 * 3.0
    assert across / along == pytest.approx(1.5 * 0.3 / 17.0 / (1.0 + shear), rel=0.02)
