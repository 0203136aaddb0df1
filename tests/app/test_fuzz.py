"""A few of the broken cases, damaged runs and random scenes that benchmarks make by the thousand."""

from __future__ import annotations

from copy import deepcopy
from pathlib import Path

import pytest
import tomli_w

from benchmarks import random_friction
from benchmarks.forked import mlsanm, preload, run_all
from benchmarks.fuzz_cases import CASES, Trial, broken_case, damaged_run, faults
from mlsanm_cli.io.run_reader import read_run
from tests.app.scenes import solve

BROKEN, DAMAGED = 30, 8


def trouble(trials: list[Trial]) -> list[str]:
    """What went wrong with each of them."""
    preload()
    outcomes = run_all([trial.job for trial in trials], seconds=30.0)
    found = [(trial.label, faults(trial, outcome)) for trial, outcome in zip(trials, outcomes, strict=True)]
    return [f"{label}: {wrong}" for label, wrong in found if wrong]


def test_broken_cases_end_well_or_say_why(tmp_path: Path) -> None:
    assert trouble([broken_case(0, number, tmp_path / str(number)) for number in range(BROKEN)]) == []


def test_damaged_runs_are_read_or_refused(tmp_path: Path) -> None:
    assert trouble([damaged_run(0, number, tmp_path / str(number)) for number in range(DAMAGED)]) == []


def test_supports_of_a_coarse_plate_that_leave_it_free(tmp_path: Path) -> None:
    """Smooth loads that leave the same trace in the equations had ended the certificate as a bug."""
    case = deepcopy(CASES["cases/kirsch"])
    case["body"][0]["refine"][0]["spacing"] = 8.3
    # So far away that all nodes of the top are as near: the first of them is held.
    case["support"][0]["near"] = [0.0, 5e7]
    (tmp_path / "case.toml").write_text(tomli_w.dumps(case))
    outcome = mlsanm(["run", "case.toml"], tmp_path)
    assert outcome.sound, outcome.err


@pytest.mark.parametrize(("seed", "law"), [(28, "exact"), (56, "hyperbolic")])
def test_random_scenes_with_friction_end_well_or_say_why(tmp_path: Path, seed: int, law: str) -> None:
    options = ["output.vtu=false", "output.fields=[]"]
    options += ["contact.interface.accuracy=0.1"] if law == "exact" else []
    summary = solve(random_friction.scene(seed, law), tmp_path / "run", *options)
    ends = (
        "end of the last stage",
        "the contact slides as a whole",
        "body upper slides",
        "force imbalance on body",
    )
    assert summary["stop_reason"].startswith(ends)
    assert random_friction.faults(summary, read_run(tmp_path / "run").contacts["interface"], law) == []
