"""Sweeps: every point the same as a run of its own, nothing done twice, failures told and survived."""

from __future__ import annotations

import csv
import multiprocessing
import os
import signal
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

from mlsanm_cli.app import sweep as engines
from mlsanm_cli.app.results.info import as_csv, collect
from mlsanm_cli.app.run import run
from mlsanm_cli.app.sweep import SweepPoint, point_name, sweep
from mlsanm_cli.case.reading.overrides import parse_vary, points
from mlsanm_cli.cli import main
from mlsanm_cli.contact.response import condensation
from mlsanm_cli.errors import CaseError, RunError
from mlsanm_cli.mechanics.body_model import BodyModel
from tests.app.runs import assert_same_results, summary_of
from tests.app.scenes import ANM, BAR, Quiet, hertz
from tests.case_text import item, probe

ETA = "contact.interface.regularization.eta"
FORCE = "load.press.fy"
FINE = "body.*.refine=[{at=[0.0, 0.0], spacing=0.02, radius=0.06, growth=0.2}]"
"""Nodes for the nodal pressures of the regularised law."""
PRESSED = hertz().changed("accuracy = 0.01", "accuracy = 0.1").table("output", vtu=False, fields=[])
PROBE = probe("tip", "block", [0.0, -0.5])
ROUGH = PRESSED.changed("accuracy", "friction = 0.3\nregularization.law = 'exact'\naccuracy") + PROBE

SEEN = ROUGH.changed("fields = []", "fields = ['von_mises']")


@pytest.fixture(autouse=True)
def _nothing_kept() -> None:
    engines.process_memo.cache_clear()


@pytest.fixture
def bar(tmp_path: Path) -> Path:
    """What takes least."""
    path = tmp_path / "bar.toml"
    path.write_text(BAR)
    return path


@pytest.fixture
def case(tmp_path: Path) -> Path:
    path = tmp_path / "hertz.toml"
    path.write_text(PRESSED)
    return path


def swept(case: Path, out: Path, *varied: str, console: Quiet | None = None, **wishes: Any) -> Any:
    """What a sweep returns."""
    return sweep(case, varied, **wishes, out=out, console=console or Quiet())


def assert_same_points(directory: Path, result: Mapping[str, Any]) -> None:
    """The runs of a sweep are those of another one."""
    runs = [path.parent for path in Path(result["directory"]).glob("*/run.h5")]
    assert len(runs) == result["points"]
    for one in runs:
        assert_same_results(one, directory / one.name)


def counts(result: Mapping[str, Any]) -> list[int]:
    """Done, skipped, failed, stopped."""
    return [result[key] for key in ("done", "skipped", "failed", "stopped")]


def test_points_are_the_runs_that_they_stand_for(
    tmp_path: Path, case: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Operators are made once for each geometry."""
    made: list[str] = []
    build = BodyModel.build

    def counted(name: str, *arguments: Any) -> BodyModel:
        made.append(name)
        return build(name, *arguments)

    with monkeypatch.context() as patch:
        patch.setattr(BodyModel, "build", counted)
        result = swept(case, tmp_path / "all", f"{FORCE}=-113.0,-226.0", "body.block.spacing=0.25,0.2")
    assert counts(result) == [4, 0, 0, 0]
    assert sorted(made) == ["block", "block", "cylinder"]
    for force, spacing in (("-113.0", "0.2"), ("-226.0", "0.25")):
        values = (f"{FORCE}={force}", f"body.block.spacing={spacing}")
        run(case, overrides=values, out=tmp_path / "one", force=True, console=Quiet())
        assert_same_results(tmp_path / "one", tmp_path / "all" / point_name(values))
    with (tmp_path / "all" / "sweep.csv").open() as stream:
        rows = list(csv.DictReader(stream))
    # Points of one geometry stand together.
    assert [row["body.block.spacing"] for row in rows] == ["0.25", "0.25", "0.2", "0.2"]
    assert {row["status"] for row in rows} == {"done"}
    for row in rows:
        assert float(row["contacts.interface.force_y"]) == pytest.approx(-float(row[FORCE]))


@pytest.mark.parametrize(
    ("text", "varied"),
    [
        (BAR + PROBE.changed("block", "bar"), ("body.bar.seed=0,1", "probe.tip.point=[0.5, 0.5],[1.0, 0.5]")),
        (ROUGH, ("probe.tip.point=[0.0, -0.5],[0.5, -0.5]", "contact.interface.friction=0.3,0.0")),
        # The points that fields are written at are kept for what touches over the same intervals.
        (SEEN, ("load.press.fy=-226.0,-40.0", "contact.interface.friction=0.3,0.6")),
    ],
    ids=["body", "contact", "fields"],
)
def test_what_a_process_keeps_serves_only_what_it_was_made_from(
    text: str, varied: tuple[str, str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    # With monkeypatch, so that runs alone share nothing with other tests (tests/conftest.py).
    case = tmp_path / "case.toml"
    case.write_text(text)
    assert counts(swept(case, tmp_path / "all", *varied)) == [4, 0, 0, 0]
    for values in points([parse_vary(one) for one in varied])[1:3]:
        run(case, overrides=values, out=tmp_path / "one", force=True, console=Quiet())
        assert_same_results(tmp_path / "one", tmp_path / "all" / point_name(values))


def test_contact_grids_begin_with_those_of_the_point_before(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Points agree with runs of their own to the accuracy of the grids."""
    made: list[int] = []
    condensed = condensation._condensed

    def counted(*arguments: Any) -> Any:
        found = condensed(*arguments)
        made.append(len(found.weight))
        return found

    monkeypatch.setattr(condensation, "_condensed", counted)
    case = tmp_path / "case.toml"
    case.write_text(ROUGH.changed("accuracy = 0.1", "accuracy = 0.01"))
    key = "contact.interface.friction"
    run(case, overrides=(f"{key}=0.4",), out=tmp_path / "one", console=Quiet())
    alone = len(made)
    swept(case, tmp_path / "all", f"{key}=0.3,0.4")
    again = len(made) - 2 * alone
    assert again < 0.4 * alone
    one, other = map(summary_of, (tmp_path / "one", tmp_path / "all" / point_name([f"{key}=0.4"])))
    for name in ("peak_pressure", "half_width", "dissipated_work"):
        assert other["contacts"]["interface"][name] == pytest.approx(
            one["contacts"]["interface"][name], rel=0.01
        )


def test_what_is_done_is_not_done_again(tmp_path: Path, bar: Path) -> None:
    out, key = tmp_path / "all", "load.squeeze.pressure"
    assert counts(swept(bar, out, f"{key}=1,2")) == [2, 0, 0, 0]
    before = (out / point_name([f"{key}=2"]) / "run.h5").stat().st_mtime_ns
    assert counts(swept(bar, out, f"{key}=2,3")) == [1, 1, 0, 0]
    assert (out / point_name([f"{key}=2"]) / "run.h5").stat().st_mtime_ns == before
    assert counts(swept(bar, out, f"{key}=2,3", force=True)) == [2, 0, 0, 0]
    # A run that was cut short is done again, whatever is left of it.
    (out / point_name([f"{key}=2"]) / "summary.json").unlink()
    assert counts(swept(bar, out, f"{key}=2,3")) == [1, 1, 0, 0]
    bar.write_text(BAR.changed("30.0", "20.0"))
    with pytest.raises(RunError, match="another case"):
        swept(bar, out, f"{key}=2")


def test_a_point_that_fails_is_told_and_the_others_go_on(tmp_path: Path, case: Path) -> None:
    arguments = ["sweep", str(case), "--vary", "solver.max_steps=1,2000", "--out", str(tmp_path / "all")]
    assert main([*arguments, "--quiet", "--set", ANM, "--set", f"{ETA}=1e-2", "--set", FINE]) == 3
    rows = collect([tmp_path / "all" / f"solver.max_steps={n}" for n in (1, 2000)])
    assert [row["status"] for row in rows] == ["failed", "done"]
    assert [row["solver.max_steps"] for row in rows] == [1, 2000]
    assert rows[0]["stop_reason"]


def test_everything_wrong_is_told_before_anything_is_run(tmp_path: Path, case: Path) -> None:
    with pytest.raises(CaseError) as error:
        swept(case, tmp_path / "all", f"{ETA}=1e-4,-1.0", "solver.order=1,20")
    assert {problem.key for problem in error.value.problems} == {ETA, "solver.order"}
    assert not (tmp_path / "all").exists()
    with pytest.raises(RunError, match="nothing varies"):
        swept(case, tmp_path / "all")


class Killer(Quiet):
    """Kills a process of the sweep when the first point is told of."""

    killed = 0

    def note(self, text: str) -> None:
        """Kill once."""
        if not self.killed:
            child = multiprocessing.active_children()[0]
            assert child.pid is not None
            self.killed = child.pid
            os.kill(child.pid, signal.SIGKILL)


def test_a_process_lost_is_a_point_repeated(tmp_path: Path, bar: Path) -> None:
    console = Killer()
    varied = ("load.squeeze.pressure=1,2,3",)
    result = swept(bar, tmp_path / "there", *varied, jobs=2, console=console)
    assert console.killed
    assert counts(result) == [3, 0, 0, 0]
    assert_same_points(tmp_path / "there", swept(bar, tmp_path / "here", *varied))


def _dies(one: SweepPoint) -> Mapping[str, Any]:
    os.kill(os.getpid(), signal.SIGKILL)
    raise AssertionError


def test_a_point_that_kills_its_process_is_given_up(
    tmp_path: Path, case: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(engines, "solve_point", _dies)
    monkeypatch.setattr(engines, "MAX_ATTEMPTS", 2)
    deadly = SweepPoint(case, (), tmp_path / "x", "x", 1, 0, (), False)
    (row,) = engines.in_pool([deadly], 1)
    assert row["status"] == "failed"
    assert row["stop_reason"] == "its process died 2 times"


def test_run_skips_what_is_done(tmp_path: Path, bar: Path) -> None:
    arguments = ["run", str(bar), "--out", str(tmp_path / "one"), "--quiet"]
    assert main([*arguments, "--skip-done"]) == 0
    before = (tmp_path / "one" / "run.h5").stat().st_mtime_ns
    assert main([*arguments, "--skip-done", "--force"]) == 0
    assert (tmp_path / "one" / "run.h5").stat().st_mtime_ns == before
    # Another case, and without the option, the old rules hold.
    assert main([*arguments, "--skip-done", "--set", "solver.order=12"]) == 2
    assert main(arguments) == 2
    assert main([*arguments, "--skip-done", "--force", "--set", "solver.order=12"]) == 0
    assert (tmp_path / "one" / "run.h5").stat().st_mtime_ns != before


def test_collect_has_a_row_for_every_directory(
    tmp_path: Path, case: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    swept(case, tmp_path / "all", "solver.order=12,20")
    (tmp_path / "empty").mkdir()
    going = tmp_path / "all" / "solver.order=20"
    (going / "summary.json").unlink()
    places = [str(tmp_path / "all" / "solver.order=12"), str(going), str(tmp_path / "empty")]
    assert main(["collect", *places, "--out", str(tmp_path / "t.csv")]) == 0
    out, err = capsys.readouterr()
    assert out == ""
    assert err.startswith(f"warning: {tmp_path / 'empty'}: ")
    assert main(["collect", str(tmp_path / "no*")]) == 2
    assert "hint: name run directories" in capsys.readouterr().err
    with (tmp_path / "t.csv").open() as stream:
        rows = list(csv.DictReader(stream))
    assert [row["status"] for row in rows] == ["done", "done", "unreadable"]
    assert [row["solver.order"] for row in rows] == ["12", "20", ""]
    assert "title" not in rows[0]
    assert "killed" in rows[1]["stop_reason"]
    assert "run.h5" in rows[2]["stop_reason"]
    summary = summary_of(tmp_path / "all" / "solver.order=12")
    force = summary["contacts"]["interface"]["force"]
    assert [float(rows[0][f"contacts.interface.force_{axis}"]) for axis in "xy"] == force
    assert [float(rows[0][f"forces.press_{axis}"]) for axis in "xy"] == summary["forces"]["press"]
    # A file that stands next to the directories is no run, as with `mlsanm collect all/*`.
    assert main(["collect", *places, str(tmp_path / "all" / "sweep.csv")]) == 0
    assert capsys.readouterr().out == (tmp_path / "t.csv").read_text()


@pytest.mark.parametrize("value", ["=1+1", "+A1", "@sum", "-1", "a", -1.5])
def test_cells_of_a_table_are_no_formulas(value: object) -> None:
    cell = as_csv([{"title": value}]).splitlines()[1]
    assert cell == (f"'{value}" if value in ("=1+1", "+A1", "@sum", "-1") else str(value))


def test_warnings_are_told(tmp_path: Path) -> None:
    case, console = tmp_path / "bar.toml", Quiet()
    refined = item("body.refine", at=[0.0, 0.0], spacing=0.05, radius=0.1)
    case.write_text(BAR.changed("[[support]]", f"{refined}[[support]]", 1))
    result = swept(case, tmp_path / "all", "body.bar.refine.0.growth=0.08,0.4", console=console)
    assert (result["done"], result["with_warnings"]) == (2, 1)
    assert ["done, " in note for note in console.notes] == [False, True]
    rows = collect([tmp_path / "all" / f"body.bar.refine.0.growth={growth}" for growth in (0.08, 0.4)])
    assert rows[0]["warnings"] is None
    assert "growth" in rows[1]["warnings"][0]
    assert rows[0]["error_estimate.displacement"] >= 0.0


@contextmanager
def cluster() -> Iterator[Any]:
    """Two worker processes."""
    distributed = pytest.importorskip("distributed")
    with distributed.LocalCluster(
        n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None, silence_logs=50
    ) as local:
        yield local


@pytest.mark.filterwarnings("ignore")
def test_a_dask_cluster_that_loses_a_worker_finds_the_same(tmp_path: Path, case: Path) -> None:
    values = f"{ETA}=1e-5:1e-3:6"
    with cluster() as local:

        class Hunter(Quiet):
            def note(self, text: str) -> None:
                if len(self.notes) == 1:
                    os.kill(next(iter(local.workers.values())).pid, signal.SIGKILL)
                super().note(text)

        console = Hunter()
        result = swept(case, tmp_path / "dask", values, console=console, scheduler=local.scheduler_address)
    assert len(console.notes) == 6
    assert counts(result) == [6, 0, 0, 0]
    assert_same_points(tmp_path / "dask", swept(case, tmp_path / "here", values))
