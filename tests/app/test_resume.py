"""Runs cut short at some step and resumed give what they would have given."""

from __future__ import annotations

import os
import signal
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest

from mlsanm_cli.app.results.info import info
from mlsanm_cli.app.run import resume, run
from mlsanm_cli.errors import NumericalError, RunError
from mlsanm_cli.io.run_dir import locked
from mlsanm_cli.io.run_reader import read_run
from mlsanm_cli.io.vtu import StateWriter
from mlsanm_cli.solve.paths import load_path
from mlsanm_cli.solve.state import PathStep
from tests.app.runs import events_of, resumed_differences, summary_of
from tests.app.scenes import ANM, BAR, EXACT_LAW, FAST, NEWTON, SHEARED, SMOOTH, Quiet, built, hertz, solve
from tests.case_text import head


class Killed(BaseException):
    """Stands for the end of the process."""


class Deadly(Quiet):
    """A console that does something at a step."""

    def __init__(self, index: int, number: int | None = None) -> None:
        super().__init__()
        self._index, self._number = index, number

    def step(self, index: int, position: float, residual: float, text: str) -> None:
        """Die, or send this process a signal."""
        super().step(index, position, residual, text)
        if index == self._index:
            if self._number is None:
                raise Killed
            os.kill(os.getpid(), self._number)


INSIDE = "output.at=[0.3, 0.7, 1.0]"
# A softer law takes half the steps.
COARSE = hertz().changed("accuracy = 0.01", "accuracy = 0.1")
SNAP = (Path(__file__).parents[2] / "cases" / "snap_through.toml").read_text()
SLID = (
    head("strain", strain="finite")
    .material("rubber", E=2.6, nu=0.3, law="neo-hookean")
    .body("block", "rubber", 0.25, box=([0.0, 3.0], [0.0, 1.0]), clamped="bottom")
    .contact("c", "block.top", obstacle={"kind": "disk", "center": [1.0, 2.0], "radius": 1.0}, friction=0.3)
    .pushed("press", "c", uy=-0.25)
    .pushed("drag", "c", ux=0.3)
    .stages("press", "drag")
    .table("output", at=[1.0, 1.5, 2.0])
)
# Stages that move nothing, and states asked for within steps.
HISTORY = ("stage=[{press=1.0}, {shear=1.0}, {shear=1.0}, {shear=0.3}]", "output.at=[0.5, 1.5, 4.0]")
SHEARED_ONCE = ("stage=[{press=1.0}, {shear=0.5}]", "output.at=[0.5, 2.0]", "solver.tolerance=1e-10")
PRESSED_ON = ("stage=[{press=0.6}, {press=0.6}, {press=1.0}]", "output.at=[0.3, 2.5, 3.0]")
PATHS = {
    "linear": (BAR, ()),
    "exact": (hertz(), (EXACT_LAW, FAST, "output.at=[0.25, 0.5, 1.0]")),
    "exact friction": (SHEARED, (EXACT_LAW, FAST, *HISTORY)),
    "stopped": (hertz().item("stop", what="pressure", of="interface", above=1500.0), (FAST,)),
    "series": (hertz(), (*SMOOTH, *PRESSED_ON)),
    "newton": (hertz(), (*SMOOTH, NEWTON, INSIDE)),
    "friction by series": (SHEARED, (*SMOOTH, *SHEARED_ONCE)),
    "adapted": (BAR, ("adapt.passes=1",)),
    "finite strain, equations renewed": (SLID, ()),
    "finite strain, past limit points": (
        SNAP,
        ("body.arch.spacing=0.125", "mls.degree=2", "output.at=[0.3, 1.0]"),
    ),
}


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run that nothing has cut short; its case lies next to it."""
    directory = tmp_path_factory.mktemp("whole") / "case"
    solve(COARSE + f"[output]\n{INSIDE.removeprefix('output.')}\n", directory)
    return directory


def again(whole: Path, out: Path, console: Quiet, **more: Any) -> Mapping[str, Any]:
    """The same case run elsewhere."""
    return run(whole.with_suffix(".toml"), out=out, console=console, **more)


@pytest.mark.usefixtures("alone")
@pytest.mark.parametrize("name", PATHS)
def test_a_run_cut_short_is_resumed_to_the_same_result(name: str, tmp_path: Path) -> None:
    text, settings = PATHS[name]
    whole, cut = tmp_path / "case", tmp_path / "cut"
    solve(text, whole, *settings)
    summary, finite = summary_of(whole), "finite" in name
    kept = max(summary["steps"] * 2 // 3, 1)
    with pytest.raises(Killed):
        run(tmp_path / "case.toml", overrides=settings, out=cut, console=Deadly(kept))
    assert read_run(cut).status == "running"
    # At finite strain saved states within a step have rows too.
    assert read_run(cut).rows >= kept + 1 if finite else read_run(cut).rows == kept + 1
    assert "mlsanm resume" in info(cut)["hint"]
    console = Quiet()
    resumed = resume(cut, console=console)
    assert (resumed["status"], resumed["warnings"]) == ("done", summary["warnings"])
    # Newton's increments begin anew with short ones.
    assert abs(len(console.steps) - (summary["steps"] - kept)) <= (5 if name == "newton" else 2)
    if finite:
        # The direction past limit points and renewed equations are taken up again.
        same = ("steps", "factorizations", "iterations")
        assert [resumed[key] for key in same] == [summary[key] for key in same]
        one, other = (each["finite_strain"] for each in (resumed, summary))
        assert one["equations_renewed"] == other["equations_renewed"]
        assert len(one["limit_points"]) == len(other["limit_points"])
    # Rows of states within a step have no event.
    different = resumed_differences(whole, cut, 1e-7 if finite else 1e-6)
    assert not [text for text in different if not (finite and "events" in text)]
    assert (np.diff(read_run(cut).path.seconds) > 0.0).all()
    with h5py.File(cut / "run.h5") as file:
        assert file.attrs["resumed"] == 1


def test_a_run_killed_while_it_saves_a_state(
    whole: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    calls: list[Any] = []

    def die(*arguments: Any) -> None:
        calls.append(arguments)
        if len(calls) == 2:
            raise Killed
        kept(*arguments)

    kept = StateWriter.write
    with monkeypatch.context() as patch:
        patch.setattr(StateWriter, "write", die)
        with pytest.raises(Killed):
            again(whole, tmp_path / "cut", Quiet())
    assert len(read_run(tmp_path / "cut").states) == 1
    written = (tmp_path / "cut" / "fields_0001.vtu").rename(tmp_path / "lost.vtu")
    with pytest.raises(RunError, match=r"fields_0001\.vtu is missing"):
        resume(tmp_path / "cut", console=Quiet())
    written.rename(tmp_path / "cut" / "fields_0001.vtu")
    resume(tmp_path / "cut", console=Quiet())
    # One of these two came to nothing.
    with h5py.File(tmp_path / "cut" / "run.h5", "r+") as file:
        assert file.attrs["resumed"] == 2
    assert resumed_differences(whole, tmp_path / "cut") == []


def test_a_signal_ends_after_the_step_and_twice_is_fine(whole: Path, tmp_path: Path) -> None:
    number = signal.SIGUSR1
    summary = again(whole, tmp_path / "cut", Deadly(7, number))
    assert (summary["status"], summary["steps"]) == ("stopped", 7)
    assert signal.Signals(number).name in summary["stop_reason"]
    assert "mlsanm resume" in summary["hint"]
    summary = resume(tmp_path / "cut", console=Deadly(11, number))
    assert (summary["status"], summary["steps"]) == ("stopped", 11)
    assert resume(tmp_path / "cut", console=Quiet())["status"] == "done"
    assert resumed_differences(whole, tmp_path / "cut") == []


def test_the_wall_time_ends_a_run(whole: Path, tmp_path: Path) -> None:
    console = Deadly(7, signal.SIGALRM)
    summary = again(whole, tmp_path / "cut", console, max_wall=500.0)
    assert (summary["status"], summary["steps"]) == ("stopped", 7)
    assert summary["stop_reason"] == "the wall time of 500 s is over"
    assert resume(tmp_path / "cut", max_wall=500.0, console=Deadly(9, signal.SIGALRM))["steps"] == 9
    assert console.warnings == []
    # Steps that are done are not followed again: they need none of the wall time.
    console = Deadly(-1)
    assert resume(tmp_path / "cut", console=console)["status"] == "done"
    assert abs(len(console.steps) - (read_run(whole).rows - 10)) <= 2
    assert resumed_differences(whole, tmp_path / "cut") == []


def test_nothing_is_resumed_that_is_done_failed_or_held(hertz_run: Path, tmp_path: Path) -> None:
    console = Quiet()
    before = (hertz_run / "run.h5").read_bytes()
    assert resume(hertz_run, console=console)["status"] == "done"
    assert "nothing to resume" in console.notes[0]
    assert (hertz_run / "run.h5").read_bytes() == before
    assert solve(hertz(), tmp_path / "failed", "solver.max_steps=3", ANM)["status"] == "failed"
    with pytest.raises(RunError, match="repeat the failure"):
        resume(tmp_path / "failed", console=console)
    with locked(hertz_run), pytest.raises(RunError, match=f"process {os.getpid()} on"):
        resume(hertz_run, console=console)
    with pytest.raises(RunError, match="no such directory"):
        resume(tmp_path / "none", console=console)
    assert not (tmp_path / "none").exists()


def test_a_model_that_does_not_come_out_again_is_told(tmp_path: Path) -> None:
    cut = tmp_path / "cut"
    (tmp_path / "case.toml").write_text(COARSE)
    with pytest.raises(Killed):
        run(tmp_path / "case.toml", out=cut, console=Deadly(9))

    def refused_after(change: Callable[[Any], object], words: str) -> None:
        with h5py.File(cut / "run.h5", "r+") as file:
            change(file)
        with pytest.raises(RunError, match=words):
            resume(cut, console=Quiet())

    def heavier(file: Any) -> None:
        file["contacts/interface/weight"][3] *= 1.001

    def loaded_otherwise(file: Any) -> None:
        resolved = file["case/resolved"].asstr()[()]
        del file["case/resolved"]
        file["case/resolved"] = resolved.replace("-226.0", "-227.0")

    refused_after(heavier, "contacts/interface/weight is not reproduced")
    assert read_run(cut).rows == 10
    state, damaged = "checkpoint/path/state", "checkpoint of the run cannot be read"
    refused_after(lambda file: file.move(f"{state}/pressure", f"{state}/stress"), damaged)
    refused_after(lambda file: file.pop("checkpoint"), damaged)
    refused_after(loaded_otherwise, "is not the one of the run")
    refused_after(lambda file: file.pop("case/resolved"), "before its first step")


def test_events_are_complete(tmp_path: Path) -> None:
    (tmp_path / "case.toml").write_text(COARSE)
    with pytest.raises(Killed):
        run(tmp_path / "case.toml", out=tmp_path / "cut", console=Deadly(9))
    # As a kill inside an event leaves it, some steps behind the last one that was written.
    log = tmp_path / "cut" / "events.jsonl"
    last = log.read_text().splitlines(keepends=True)[-1]
    log.write_text(f"{log.read_text()}{last.replace('9', '10', 1)}{last[:20]}")
    resume(tmp_path / "cut", console=Quiet())
    rows = read_run(tmp_path / "cut").rows
    assert [one["index"] for one in events_of(tmp_path / "cut", "step")] == list(range(rows))
    others = events_of(tmp_path / "cut", "start", "resume", "end", "failure")
    assert [one["event"] for one in others] == ["start", "resume", "end"]


def test_a_kill_loses_what_was_not_written_yet(
    whole: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The file as it was some steps before the kill, next to VTU files and events that are further."""
    cut = tmp_path / "cut"
    kept: list[bytes] = []

    class Behind(Quiet):
        def step(self, index: int, position: float, residual: float, text: str) -> None:
            super().step(index, position, residual, text)
            kept.append((cut / "run.h5").read_bytes())

    with monkeypatch.context() as patch:
        patch.setattr("mlsanm_cli.io.run_file.SAVE_INTERVAL", 0.0)
        patch.setattr("mlsanm_cli.io.run_file.MIN_INTERVAL_RATIO", 0.0)
        again(whole, cut, Behind())
    for rows in (0, len(kept) // 2):
        (cut / "summary.json").unlink()
        (cut / "run.h5").write_bytes(kept[rows])
        resume(cut, console=Quiet())
        assert resumed_differences(whole, cut) == []


def test_what_is_saved_leaves_the_path_alone(tmp_path: Path) -> None:
    """States within steps have tangents of their own, from which the path must not continue."""
    few, many = "output.at=[1.0]", f"output.at={[k / 10 for k in range(1, 11)]}"
    one, other = (built(hertz(), tmp_path, *SMOOTH, FAST, "solver.tolerance=1e-10", at) for at in (few, many))
    paths = [load_path(replace(one, case=two.case)) for two in (one, other)]
    ends = [[step.state.position for step in path] for path in paths]
    assert ends[0] == pytest.approx(ends[1], rel=1e-12)


def test_a_path_that_ended_ends_there_again(tmp_path: Path) -> None:
    """Also where the last step's event left no state to continue from."""
    sliding = ("stage=[{press=1.0}, {shear=3.0}]", "output.at=[2.0]")
    scene = built(SHEARED, tmp_path, EXACT_LAW, FAST, *sliding)
    steps: list[PathStep] = []
    with pytest.raises(NumericalError, match="slides as a whole"):
        steps.extend(load_path(scene))
    rest: list[PathStep] = []
    with pytest.raises(NumericalError, match="slides as a whole"):
        rest.extend(load_path(scene, steps[-1].checkpoint))
    assert all(abs(step.state.position - steps[-1].state.position) < 1e-9 for step in rest)
