"""Checks of runs: which values pass, warn and fail, and scenes that are warned of by every one."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from mlsanm_cli.app.checks import quality
from mlsanm_cli.app.checks.check import LIMITS, Check, Verdicts
from mlsanm_cli.app.finite.checks import overlap
from mlsanm_cli.cloud.curves import rectangle
from mlsanm_cli.cloud.spacing import Spacing, build_cloud
from mlsanm_cli.errors import NumericalError
from tests.app.runs import warned
from tests.app.scenes import BAR, COARSE, EXACT_LAW, FAST, NODAL, done, hertz
from tests.case_text import head, item, scene

FINE = item("body.refine", at=[0.0, 0.0], spacing=0.05, radius=0.1, growth=0.4)
DISK = (
    scene("strain", E=1000.0)
    .body("disk", "steel", 0.2, disk=([0.0, 0.0], 1.0))
    .pin("disk", [0.0, -1.0], ux=0.0, uy=0.0)
    .pin("disk", [0.0, 1.0], ux=0.0)
    .body_force("weight", "disk", [0.0, -1.0])
)
RUBBER = (
    head("strain", strain="finite")
    .material("rubber", E=2.6, nu=0.3, law="neo-hookean")
    .body("block", "rubber", 0.25, box=([0.0, 2.0], [0.0, 1.0]), clamped="bottom")
)
PUNCHED = RUBBER.pushed("press", "c", uy=-0.2).contact("c", "block.top", disk=([1.0, 2.0], 1.0))
PULLED = RUBBER.load("press", "block.top", "traction", traction=[0.0, -0.5])
DRAGGED = (
    scene("strain", E=1e4)
    .body("base", "steel", 2.0, box=([-8.0, 8.0], [-4.0, 0.0]))
    .body("plate", "steel", 1.0, box=([-4.0, 4.0], [0.0, 2.0]))
    .body("top", "steel", 1.0, box=([-3.0, 3.0], [2.0, 6.0]))
    .support("base.bottom", ux=0.0, uy=0.0)
    .load("press", "top.top", "platen", fy=-1.0)
    .load("drag", "top.top", "platen", ux=0.01)
    .contact("lower", "plate.bottom", master="base.top", friction=0.3, accuracy=0.1)
    .contact("upper", "top.bottom", master="plate.top", friction=0.3, accuracy=0.1)
    .stages("press", "drag")
)

# Scenes, their overrides, and the checks that warn. Others are those of the tests of what they judge.
WARNED: dict[str, tuple[str, tuple[str, ...], set[str]]] = {
    "friction of forty": (hertz(), (FAST, "contact.interface.friction=40"), {"friction_coefficient"}),
    "far apart": (hertz(), (FAST, "body.cylinder.shape.center=[0.0, 2.0]"), {"initial_gap"}),
    "soft": (hertz(), (FAST, "material.steel.E=10"), {"strain", "sliding_distance", "displacement_error"}),
    "steep spacing": (BAR.changed("[[support]]", f"{FINE}[[support]]", 1), (), {"spacing_growth"}),
    "coarse": (NODAL, (EXACT_LAW, *COARSE), {"energy_error", "displacement_error", "rough_pressure_error"}),
    "on one node": (DISK, (), {"single_nodes", "peak_stress", "displacement_error"}),
    "dragged": (DRAGGED, (), {"uniqueness"}),
    "rubber, punched": (PUNCHED, (), {"finite_force_error", "rough_pressure_error"}),
    "rubber, pulled": (PULLED, (), {"displacement_error", "series_energy_error"}),
}


@pytest.mark.parametrize("name", WARNED)
def test_scenes_are_warned_of(name: str, tmp_path: Path) -> None:
    text, overrides, expected = WARNED[name]
    assert expected <= set(warned(done(text, tmp_path / "run", *overrides)))


def test_coarse_meshes_are_warned_of() -> None:
    body = SimpleNamespace(name="arm", has_nodes=True, refine=())
    cloud = {"closest": 0.8, "hole": 1.1, "growth": 0.7}
    prepared: Any = SimpleNamespace(case=SimpleNamespace(body=[body]), bodies={"arm": cloud})
    assert [check.name for check in quality.clouds(prepared) if check.outcome != "passed"] == ["mesh_growth"]


def twisted(angle: float) -> Iterable[Check]:
    """A square whose top is turned over: at pi it is a bow tie."""
    cloud = build_cloud(rectangle((-1.0, 1.0), (-1.0, 1.0)), Spacing(0.4), 0)
    x, y = cloud.points.T
    moved = np.stack([x * (np.cos(angle * (0.5 + 0.5 * y)) - 1.0), np.zeros_like(x)], axis=1)
    body = SimpleNamespace(elastic=SimpleNamespace(model=SimpleNamespace(cloud=cloud)))
    scene: Any = SimpleNamespace(
        in_increments=True,
        shown=lambda state: moved.ravel(),
        parts=lambda values: {"arm": values},
        bodies={"arm": body},
        contacts=SimpleNamespace(pairs=[]),
    )
    last: Any = SimpleNamespace(position=0.5, driven=None)
    return overlap(scene, last)


@pytest.mark.parametrize(("angle", "outcome"), [(0.5, "passed"), (3.0, "failed")])
def test_a_body_that_touches_itself(angle: float, outcome: str) -> None:
    (check,) = [check for check in twisted(angle) if check.name == "self_overlap"]
    assert check.outcome == outcome


@pytest.mark.parametrize("name", LIMITS)
def test_outcomes(name: str) -> None:
    limit = LIMITS[name]
    beyond = -1.0 if limit.lower else 1.0
    for level, outcome in ((limit.warns, "warned"), (limit.fails, "failed")):
        if level is not None:
            past = Check(name, level + 0.01 * beyond * max(level, 1.0), "")
            assert past.judged == (outcome, level)
            assert Check(name, level, "").outcome != outcome
    assert Check(name, np.nan, "", fails=1.0).outcome == "failed"


def test_verdicts_keep_the_worst_warn_once_and_fail() -> None:
    told: list[str] = []
    verdicts = Verdicts(lambda check: told.append(check.text))

    def balance(error: float, place: str) -> Check:
        return Check("force_balance", error, f"{place} {error}", "finer nodes", place)

    verdicts.judge(balance(*one) for one in ((0.01, "arm"), (0.05, "arm"), (0.04, "arm"), (0.02, "leg")))
    assert told == ["arm 0.05; finer nodes"]
    with pytest.raises(NumericalError, match=r"leg 0\.2"):
        verdicts.judge([balance(0.2, "leg"), balance(0.3, "leg")])
    assert verdicts.rows == [
        {"name": "force_balance", "place": "arm", "value": 0.05, "limit": 0.03, "outcome": "warned"},
        {"name": "force_balance", "place": "leg", "value": 0.2, "limit": 0.1, "outcome": "failed"},
    ]
    resumed = Verdicts(lambda check: told.append(check.text))
    resumed.judge([balance(0.01, "leg")])
    assert resumed.take_up(verdicts.plain[:1]) == ["arm 0.05; finer nodes"]
    resumed.judge([balance(0.05, "arm")])
    assert len(told) == 1
