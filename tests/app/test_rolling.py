"""Round bodies that contacts alone hold: where loads roll them, and how far they turn."""

from __future__ import annotations

import re
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.mechanics.near_field import ComplexArray
from mlsanm_cli.solve.direction_updates import STRAIGHTNESS, _seen
from tests.app.scenes import solve
from tests.case_text import body, contact, disk, half_disk, head, item, material, plane

FLOOR = plane([0.0, 0.0], [0.0, 1.0])


def weighed(shape: dict[str, Any], along: float) -> str:
    """A body of one material and weight on a rough floor, pushed along it."""
    return (
        head("strain")
        + material("soft", E=1e3, nu=0.3)
        + body("round", "soft", shape=shape)
        + item("load", name="weight", kind="body-force", body="round", body_force=[0.0, -0.05])
        + item("load", name="push", kind="body-force", body="round", body_force=[along * 0.05, 0.0])
        + contact("floor", "round.arc", obstacle=FLOOR, friction=0.3, accuracy=0.1)
        + item("stage", weight=1.0)
        + item("stage", push=1.0)
    )


@pytest.mark.parametrize(("along", "rolls"), [(0.1, True), (0.0, False)])
def test_a_disk_on_a_floor_is_rolled_by_any_push(tmp_path: Path, along: float, rolls: bool) -> None:
    """Its weight seemed to turn it back, so that the run was done with a rotation of a tenth."""
    summary = solve(weighed(disk([0.0, 5.0], 5.0), along), tmp_path / "run")
    assert (summary["status"] == "failed") == rolls
    assert ("rolls" in summary["stop_reason"]) == rolls


def test_how_far_a_rocker_turns_is_told(tmp_path: Path) -> None:
    """A half-disk turns back by its weight at the radius less the height of its middle, not at the radius."""
    summary = solve(weighed(half_disk([0.0, 5.0], 5.0), 0.02), tmp_path / "run")
    assert summary["status"] == "done"
    told = re.search(r"would rotate ([0-9.]+) times as far", " ".join(summary["warnings"]))
    assert told
    assert float(told[1]) == pytest.approx(3.0 * np.pi / 4.0, rel=0.05)


@pytest.mark.parametrize("mu", [0.15, 0.3])
def test_a_disk_settles_and_turns_in_a_rough_groove(tmp_path: Path, mu: float) -> None:
    """As it settles all nodes slip on both sides, which counted as sliding as a whole. A moment turns it from
    mu W R sqrt(2)/(1 + mu^2) on; at small strain contacts stay where they were, which carries more."""
    moment = 1.4
    bodies = (
        head("strain")
        + material("soft", E=300.0, nu=0.3)
        + body("round", "soft", shape=disk([0.0, 1.0], 1.0))
    )
    loads = item("load", name="weight", kind="body-force", body="round", body_force=[0.0, -1.0]) + item(
        "load",
        name="turn",
        kind="body-force",
        body="round",
        body_force=[f"{2.0 * moment / np.pi}*(1 - y)", f"{2.0 * moment / np.pi}*x"],
    )
    walls = "".join(
        contact(
            name,
            "round.arc",
            obstacle=plane([0.0, 1.0 - np.sqrt(2.0)], [side, 1.0]),
            friction=mu,
            accuracy=0.1,
        )
        for name, side in (("left", 1.0), ("right", -1.0))
    )
    stages = item("stage", weight=1.0) + item("stage", turn=1.0)
    summary = solve(bodies + loads + walls + stages, tmp_path / "run")
    assert summary["status"] == "failed"
    limit = mu * np.pi * np.sqrt(2.0) / (1.0 + mu**2) / moment
    excess = (summary["position"] - 1.0) / limit - 1.0
    told = re.search(r"([0-9.]+) % too large", " ".join(summary["warnings"]))
    assert told
    assert 0.01 < excess < 0.01 * float(told[1]) < 4.0 * excess


@pytest.mark.parametrize("noise", [0.0, 1e-16])
def test_a_straight_side_has_one_normal_in_any_frame(noise: float) -> None:
    """Turned by some angle its computed normals differ by round-off: that counted as a curve."""

    def side(s: FloatArray, slave: bool) -> tuple[ComplexArray, ComplexArray]:
        if slave:
            inward: ComplexArray = np.exp(1j * (s / 4.0 - 0.3))
            return np.asarray(-4.0 * inward), inward
        outward: ComplexArray = np.asarray(1.0 + 1j * noise * np.sign(s - 0.2))
        place: ComplexArray = np.asarray(s, dtype=np.complex128)
        return place, outward

    facing: Any = SimpleNamespace(slave_first=True, obstacle=object(), side=side)
    grid: Any = SimpleNamespace(first=-0.5, last=0.5, facing=facing)
    _, (round_, flat) = _seen(grid, 0.2, np.linspace(0.1, 0.3, 3), np.ones(3))
    assert flat <= STRAIGHTNESS * round_
