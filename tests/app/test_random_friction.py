"""A few of the random scenes with friction that benchmarks/random_friction.py runs by the hundred."""

from __future__ import annotations

from pathlib import Path

import pytest

from benchmarks.random_friction import faults, scene
from mlsanm_cli.app.run import run
from mlsanm_cli.io.run_reader import read_run
from tests.app.scenes import Quiet

EXPECTED = ("end of the last stage", "the contact slides as a whole", "force imbalance on body")


@pytest.mark.parametrize(("seed", "law"), [(28, "exact"), (56, "hyperbolic")])
def test_every_scene_ends_well_or_says_why(tmp_path: Path, seed: int, law: str) -> None:
    case = tmp_path / "case.toml"
    case.write_text(scene(seed, law))
    options = ["output.vtu=false", "output.fields=[]"]
    options += ["contact.interface.accuracy=0.1"] if law == "exact" else []
    summary = run(case, overrides=tuple(options), out=tmp_path / "run", console=Quiet())
    assert summary["stop_reason"].startswith(EXPECTED)
    assert faults(summary, read_run(tmp_path / "run").contacts["interface"]) == []
