"""What is wrong with a scene is told as who drew it would say it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from mlsanm_cli.app.scene.causes import strain_of
from mlsanm_cli.app.sweep.run_sweep import SweepOptions, sweep
from mlsanm_cli.case.starters import starter
from mlsanm_cli.errors import CaseError
from tests.app.scenes import Quiet, hertz, solve
from tests.case_text import contact

EXACT = 'contact.interface.regularization.law="exact"'


@pytest.mark.parametrize("friction", [0.0, 0.3])
def test_a_load_of_the_wrong_sign_is_named(friction: float, tmp_path: Path) -> None:
    changes = ["load.press.force=[0.0, 10.0]", EXACT, f"contact.interface.friction={friction}"]
    summary = solve(starter("hertz").partition("[reference]")[0], tmp_path / "run", *changes)
    assert summary["status"] == "failed"
    assert summary["hint"] == "load press pulls cylinder away from contact interface: change its sign"


OBSTACLE = contact(
    "interface", "cylinder.arc", obstacle={"kind": "polyline", "points": [[-1.0, 0.0], [1.0, 0.0]]}
)


def test_surfaces_that_look_the_wrong_way(tmp_path: Path) -> None:
    text = starter("hertz").partition("[reference]")[0]
    with pytest.raises(CaseError, match=r"cylinder\.arc faces up and block\.top faces up, at least 1 apart"):
        solve(text, tmp_path / "run", 'body.cylinder.shape.side="upper"')
    text = text.partition("[[contact]]")[0] + OBSTACLE
    with pytest.raises(CaseError, match="reverse the order"):
        solve(text, tmp_path / "run")


def test_bodies_far_apart_and_mixed_units_are_warned_of(tmp_path: Path) -> None:
    text = hertz()
    apart = solve(text, tmp_path / "apart", "body.cylinder.shape.center=[0.0, 2.0]", EXACT)
    assert any("gap of 1 is 0.5 times the size" in warning for warning in apart["warnings"])
    soft = solve(text, tmp_path / "soft", "material.steel.E=10.0", EXACT)
    (strained, *_) = [warning for warning in soft["warnings"] if "strained or rotated by" in warning]
    assert "check the units of material.steel" in strained


def test_strains() -> None:
    points = np.array([[0.0, 0.0], [2.0, 0.0], [0.0, 1.0]])
    moved = np.array([[5.0, 0.0], [5.4, 0.0], [5.0, 0.1]])
    stress = np.array([1.0, 2.0, 2.0])
    # A body that only travels is not strained.
    assert strain_of(points, moved, stress, 100.0) == pytest.approx(0.2)
    assert strain_of(points, moved * 0.0 + 9.0, stress, 100.0) == pytest.approx(0.02)


def test_values_that_vary_are_listed_without_brackets(tmp_path: Path) -> None:
    case = tmp_path / "case.toml"
    case.write_text(hertz())
    for varied, words in (
        ("solver.order=[10, 12]", r"--vary solver\.order=10,12"),
        ("load.press.force=[[0, -1],[0, -2]]", r"--vary load\.press\.force=\[0,-1\],\[0,-2\]"),
    ):
        with pytest.raises(CaseError, match=rf"--vary: .*{words}"):
            sweep(case, [varied], SweepOptions(), out=tmp_path / "all", console=Quiet())
