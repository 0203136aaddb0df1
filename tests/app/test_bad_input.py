"""What is wrong with a case or a call, in the words of who drew it: one message, exit code 2, nothing run."""

from __future__ import annotations

from collections.abc import Callable
from copy import deepcopy
from pathlib import Path

import pytest
import tomli_w

from benchmarks.forked import mlsanm, preload, run_all
from benchmarks.fuzz_cases import CASES, Trial, broken_case, damaged_run, faults
from benchmarks.scenes import random_friction
from mlsanm_cli.app.check import check
from mlsanm_cli.app.sweep import sweep
from mlsanm_cli.case.starters import starter
from mlsanm_cli.cli import main
from mlsanm_cli.errors import CaseError
from mlsanm_cli.io.run_reader import read_run
from tests.app.scenes import EXACT_LAW, Quiet, done, hertz, solve
from tests.case_text import annulus, contact, polyline, scene, support

FLOOR = support("block.bottom", uy=0.0)
ON_CONTACT, ON_LOAD = FLOOR.support("block.top", ux=0.0), FLOOR.support("cylinder.flat", uy=0.0)

# What is replaced in the sound case by what, what the message must name, and how the line told begins. Other
# faults of keys and values are those of tests/case.
BAD = {
    "misspelt key": ("nu = 0.3", "nuu = 0.3", ("material.steel.nuu", "nu"), "nuu"),
    "negative spacing": ("spacing = 0.25", "spacing = -0.25", ("spacing", "above 0"), "spacing = -"),
    "unknown boundary": ('"block.top"', '"block.topp"', ("topp", "block.top"), 'master = "block.topp'),
    "overlapping support and load": (FLOOR, ON_LOAD, ("cylinder.flat in y",), "[[load]]"),
    "support on a contact": (FLOOR, ON_CONTACT, ("contact surface block.top",), 'master = "block.top'),
    "a body free to drift": (FLOOR, "", ("load.press", "nothing resists", "uy"), "[[load]]"),
    "surfaces that overlap": (
        "y = [-2.0, 0.0]", "y = [-2.0, 0.4]", ("contact.interface", "overlap by 0.4"), "[[contact]]"
    ),
    "a contact that faces nothing": (
        'side = "lower"', 'side = "upper"', ("contact.interface", "faces block.top"), "[[contact]]"
    ),
    "a formula that does not fit": (
        '"hertz-line"', '"uniform-pressure"', ("reference.solution", "does not fit"), "solution ="
    ),
    "bad syntax": ("nu = 0.3", "nu = 0.3.1", ("(syntax)",), "nu ="),
}  # fmt: skip


@pytest.mark.parametrize("number", range(len(BAD)), ids=list(BAD))
def test_bad_case(
    number: int, tmp_path: Path, afterwards: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    old, new, told, place = list(BAD.values())[number]
    text = hertz().changed(old, new, 1)
    (tmp_path / "case.toml").write_text(text)
    afterwards.chdir(tmp_path)
    # Both commands read a case alike.
    assert main([("run", "check")[number % 2], "case.toml", "--quiet"]) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert all(part in err for part in told), err
    line = text[: text.index(place)].count("\n") + 1
    assert f"case.toml:{line}: " in err, err
    assert "Traceback" not in err
    assert "nothing was run" in err
    assert [path.name for path in tmp_path.iterdir()] == ["case.toml"]


@pytest.mark.parametrize("friction", [0.0, 0.3])
def test_a_load_of_the_wrong_sign_is_named(friction: float, tmp_path: Path) -> None:
    changes = ["load.press.force=[0.0, 10.0]", EXACT_LAW, f"contact.interface.friction={friction}"]
    summary = solve(starter("hertz").partition("[reference]")[0], tmp_path / "run", *changes)
    assert summary["status"] == "failed"
    assert summary["hint"] == "load press pulls cylinder away from contact interface: change its sign"
    assert any("which alone holds it" in warning for warning in summary["warnings"])


def test_surfaces_that_look_the_wrong_way(tmp_path: Path) -> None:
    text = starter("hertz").partition("[reference]")[0]
    with pytest.raises(CaseError, match=r"cylinder\.arc faces up and block\.top faces up, at least 1 apart"):
        solve(text, tmp_path / "run", 'body.cylinder.shape.side="upper"')
    downward = contact("interface", "cylinder.arc", obstacle=polyline([-1.0, 0.0], [1.0, 0.0]))
    with pytest.raises(CaseError, match="reverse the order"):
        solve(text.partition("[[contact]]")[0] + downward, tmp_path / "run")


def test_what_lies_outside_its_hole_or_overlaps_is_told_before_a_run(tmp_path: Path) -> None:
    pin = scene("strain", E=1.0).body("pin", "steel", 0.5, disk=([0.0, 0.0], 1.0))
    pin = pin.body("ring", "steel", 0.5, shape=annulus([0.0, 0.0], [1.0, 2.0]))
    case = pin.contact("fit", "pin.arc", "ring.inner").support("ring.outer", ux=0.0, uy=0.0)
    case = case.body_force("pull", "pin", [0.01, 0.0])
    (tmp_path / "case.toml").write_text(case)
    with pytest.raises(CaseError, match=r"pin.arc lies outside ring.inner, whose centre is \(0, 0\)"):
        check(tmp_path / "case.toml", overrides=("body.pin.shape.center=[4.0, 0.0]",), console=Quiet())
    for radius, told in ((1.0, 0), (1.001, 1)):
        override = f"body.pin.shape.radius={radius}"
        notes = check(tmp_path / "case.toml", overrides=(override,), console=Quiet())["notes"]
        assert len([note for note in notes if "overlap by 0.001" in note]) == told


def test_bodies_far_apart_and_mixed_units_are_warned_of(tmp_path: Path) -> None:
    apart = done(hertz(), tmp_path / "apart", "body.cylinder.shape.center=[0.0, 2.0]", EXACT_LAW)
    assert any("gap of 1 is 0.5 times the size" in warning for warning in apart["warnings"])
    soft = solve(hertz(), tmp_path / "soft", "material.steel.E=10.0", EXACT_LAW)
    (strained, *_) = [warning for warning in soft["warnings"] if "strained or rotated by" in warning]
    assert "check the units of material.steel" in strained


@pytest.mark.parametrize(
    ("varied", "words"),
    [
        ("solver.order=[10, 12]", r"--vary solver\.order=10,12"),
        ("load.press.force=[[0, -1],[0, -2]]", r"--vary load\.press\.force=\[0,-1\],\[0,-2\]"),
    ],
)
def test_values_that_vary_are_listed_without_brackets(varied: str, words: str, tmp_path: Path) -> None:
    (tmp_path / "case.toml").write_text(hertz())
    with pytest.raises(CaseError, match=rf"--vary: .*{words}"):
        sweep(tmp_path / "case.toml", [varied], out=tmp_path / "all", console=Quiet())


@pytest.mark.parametrize(("make", "count"), [(broken_case, 30), (damaged_run, 8)])
def test_broken_cases_and_damaged_runs_end_well_or_say_why(
    make: Callable[[int, int, Path], Trial], count: int, tmp_path: Path
) -> None:
    preload()
    trials = [make(0, number, tmp_path / str(number)) for number in range(count)]
    outcomes = run_all([trial.job for trial in trials], seconds=30.0)
    found = {trial.label: faults(trial, outcome) for trial, outcome in zip(trials, outcomes, strict=True)}
    assert {label: wrong for label, wrong in found.items() if wrong} == {}


def test_supports_of_a_coarse_plate_that_leave_it_free(tmp_path: Path) -> None:
    """Smooth loads that leave the same trace in the equations had ended the certificate as a bug."""
    case = deepcopy(CASES["cases/kirsch"])
    case["body"][0]["refine"][0]["spacing"] = 8.3
    # So far away that all nodes of the top are as near: the first of them is held.
    case["support"][0]["near"] = [0.0, 5e7]
    (tmp_path / "case.toml").write_text(tomli_w.dumps(case))
    outcome = mlsanm(["run", "case.toml"], tmp_path)
    assert outcome.sound, outcome.err


@pytest.mark.parametrize(("seed", "law"), [(28, "exact"), (4, "hyperbolic")])
def test_random_scenes_with_friction_end_well_or_say_why(tmp_path: Path, seed: int, law: str) -> None:
    options = ["output.vtu=false", "output.fields=[]"]
    options += ["contact.interface.accuracy=0.1"] if law == "exact" else []
    summary = solve(random_friction.scene(seed, law), tmp_path / "run", *options)
    ends = ("end of the last stage", "the contact slides as a whole", "body upper slides")
    assert summary["stop_reason"].startswith((*ends, "force imbalance on body"))
    assert random_friction.faults(summary, read_run(tmp_path / "run").contacts["interface"], law) == []
