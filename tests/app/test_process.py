"""Runs as processes: signals, which end them in order, at once only when asked twice, and locks."""

from __future__ import annotations

import multiprocessing
import os
import signal
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

from mlsanm_cli.app.results.choice import Choice
from mlsanm_cli.app.results.info import info
from mlsanm_cli.app.results.plot import plot
from mlsanm_cli.app.run import resume
from mlsanm_cli.app.sweep import SweepPoint, solve_point
from mlsanm_cli.io.run_reader import read_run
from mlsanm_cli.stopping import Stopper
from mlsanm_cli.system import STOPPING
from tests.app.processes import CLI, LONG, PATIENCE, wait_for_steps
from tests.app.runs import resumed_differences, summary_of
from tests.app.scenes import FAST, SHEARED, Quiet, solve
from tests.processes import ENVIRONMENT


def start(
    directory: Path, text: str, *arguments: str, program: tuple[str, ...] = CLI
) -> subprocess.Popen[str]:
    (directory / "case.toml").write_text(text)
    return subprocess.Popen(
        [sys.executable, *program, "run", "case.toml", "--out", "run", *arguments],
        cwd=directory,
        env=ENVIRONMENT,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


def test_a_second_run_is_refused_and_a_signal_leaves_a_readable_one(tmp_path: Path) -> None:
    process = start(tmp_path, LONG)
    wait_for_steps(tmp_path / "run", 5, lambda: process.poll() is None)
    told = info(tmp_path / "run")
    assert (told["status"], f"process {process.pid} on" in told["stop_reason"]) == ("running", True)
    other = start(tmp_path, LONG, "--force")
    _, err = other.communicate(timeout=PATIENCE)
    assert other.returncode == 2
    assert f"run is being written by process {process.pid}" in err
    process.send_signal(signal.SIGTERM)
    out, err = process.communicate(timeout=PATIENCE)
    assert (process.returncode, "SIGTERM" in out) == (75, True)
    assert "Traceback" not in err
    summary = summary_of(tmp_path / "run")
    assert summary["status"] == "stopped"
    assert "signal" in summary["stop_reason"]
    run = read_run(tmp_path / "run")
    assert run.status == "stopped"
    assert run.rows == summary["steps"] + 1 >= 5
    assert 0.0 < run.path.position[-1] == summary["position"] < 1.0
    assert summary["contacts"]["interface"]["peak_pressure"] > 0.0
    assert (tmp_path / "run" / "interface.csv").is_file()
    assert info(tmp_path / "run")["status"] == "stopped"
    assert len(plot(tmp_path / "run", choice=Choice(("pressure",)))) == 1


def test_a_killed_process_is_resumed(tmp_path: Path) -> None:
    solve(SHEARED, tmp_path / "case", FAST)
    # Files of a run as short as this one would be written at its beginning and its end only.
    always = "run_file.SAVE_INTERVAL = run_file.MIN_INTERVAL_RATIO = 0.0; "
    eager = "import sys; from mlsanm_cli.io import run_file; " + always
    program = ("-c", eager + "from mlsanm_cli.cli import main; main()")
    process = start(tmp_path, SHEARED, "--quiet", "--set", FAST, program=program)
    wait_for_steps(tmp_path / "run", 20, lambda: process.poll() is None)
    process.kill()
    process.communicate()
    assert read_run(tmp_path / "run").rows >= 19
    assert "killed" in info(tmp_path / "run")["stop_reason"]
    assert resume(tmp_path / "run", console=Quiet())["status"] == "done"
    assert resumed_differences(tmp_path / "case", tmp_path / "run") == []


def test_a_process_of_a_pool_ends_at_once(tmp_path: Path) -> None:
    """Its pool terminates it and waits: an orderly end would leave it waiting for points for good."""
    case, run = tmp_path / "case.toml", tmp_path / "run"
    case.write_text(LONG)
    point = SweepPoint(case, (), run, "run", threads=1, memory=1, argv=(), done=False)
    process = multiprocessing.get_context("spawn").Process(target=solve_point, args=(point,))
    process.start()
    wait_for_steps(run, 3, process.is_alive)
    process.terminate()
    process.join(PATIENCE)
    assert process.exitcode == -signal.SIGTERM
    # What was done since run.h5 was last written is lost; the file is whole.
    read_run(run)


@pytest.mark.parametrize("number", STOPPING)
def test_the_first_signal_waits_and_the_second_does_not(number: signal.Signals) -> None:
    with Stopper() as stopper:
        stopper.gentle = True
        stopper.check()
        os.kill(os.getpid(), number)
        assert number.name in stopper.reason
        with pytest.raises(KeyboardInterrupt):
            stopper.check()
        with pytest.raises(KeyboardInterrupt):
            os.kill(os.getpid(), number)


def test_a_step_that_goes_on_is_stopped_soon() -> None:
    with Stopper() as stopper:
        stopper.gentle, stopper.grace = True, 0.05
        os.kill(os.getpid(), signal.SIGINT)
        with pytest.raises(KeyboardInterrupt, match="SIGINT"):
            time.sleep(2.0)
        stopper.finish()
        # What is being written is not stopped.
        time.sleep(0.1)


def test_an_ungentle_one_is_raised_and_remembered() -> None:
    before = [signal.getsignal(number) for number in STOPPING]
    with Stopper() as stopper:
        with pytest.raises(KeyboardInterrupt):
            os.kill(os.getpid(), signal.SIGTERM)
        with pytest.raises(KeyboardInterrupt):
            stopper.check()
    assert [signal.getsignal(number) for number in STOPPING] == before


def waited() -> str:
    """What a gentle stop says after its wall time."""
    with Stopper(max_wall=0.05) as stopper:
        stopper.gentle = True
        stopper.check()
        time.sleep(0.1)
        try:
            stopper.check()
        except KeyboardInterrupt as stop:
            return str(stop)
    return ""


def test_the_wall_time_comes_as_a_signal_and_holds_in_a_thread() -> None:
    assert waited() == "the wall time of 0.05 s is over"
    assert signal.getitimer(signal.ITIMER_REAL) == (0.0, 0.0)
    with Stopper(max_wall=0.05), pytest.raises(KeyboardInterrupt, match="wall time"):
        time.sleep(1.0)
    with ThreadPoolExecutor(1) as pool:
        assert pool.submit(waited).result() == "the wall time of 0.05 s is over"
