"""Runs as processes of their own: signals and locks."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

from mlsanm_cli.app.results.info import info
from mlsanm_cli.app.results.plot import plot
from mlsanm_cli.app.results.views import Choice
from mlsanm_cli.app.resume import resume
from mlsanm_cli.io.run_reader import read_run
from tests.app.runs import resumed_differences
from tests.app.scenes import Quiet, hertz, solve
from tests.app.test_friction import SHEARED

ROOT = Path(__file__).parents[2]
PATIENCE = 120.0


QUICK = hertz().replace("accuracy = 0.01", "accuracy = 0.1")


def start(
    directory: Path, text: str, *arguments: str, program: tuple[str, ...] = ("-m", "mlsanm_cli.cli")
) -> subprocess.Popen[str]:
    (directory / "case.toml").write_text(text)
    return subprocess.Popen(
        [sys.executable, *program, "run", "case.toml", "--out", "run", *arguments],
        cwd=directory,
        env={**os.environ, "PYTHONPATH": str(ROOT)},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


def wait_for_steps(directory: Path, steps: int, process: subprocess.Popen[str]) -> None:
    events = directory / "run" / "events.jsonl"
    end = time.monotonic() + PATIENCE
    while not events.is_file() or events.read_text().count('"step"') < steps:
        assert process.poll() is None, process.communicate()
        assert time.monotonic() < end
        time.sleep(0.02)


def test_a_second_run_is_refused_and_a_signal_leaves_a_readable_one(tmp_path: Path) -> None:
    # Thousands of saved states: the run would continue for a minute.
    positions = ", ".join(str(0.2 + 0.0002 * k) for k in range(4001))
    text = QUICK + f"\n[output]\nvtu = false\nat = [{positions}]\n"
    process = start(tmp_path, text)
    wait_for_steps(tmp_path, 5, process)
    told = info(tmp_path / "run")
    assert (told["status"], f"process {process.pid} on" in told["stop_reason"]) == ("running", True)
    other = start(tmp_path, text, "--force")
    _, err = other.communicate(timeout=PATIENCE)
    assert other.returncode == 2
    assert f"run is being written by process {process.pid}" in err
    process.send_signal(signal.SIGTERM)
    out, err = process.communicate(timeout=PATIENCE)
    assert (process.returncode, "SIGTERM" in out) == (75, True)
    assert "Traceback" not in err
    summary = json.loads((tmp_path / "run" / "summary.json").read_text())
    assert summary["status"] == "stopped"
    assert "signal" in summary["stop_reason"]
    run = read_run(tmp_path / "run")
    assert run.status == "stopped"
    assert run.path.rows == summary["steps"] + 1 >= 5
    assert 0.0 < run.path.position[-1] == summary["position"] < 1.0
    assert summary["contacts"]["interface"]["peak_pressure"] > 0.0
    assert (tmp_path / "run" / "interface.csv").is_file()
    assert info(tmp_path / "run")["status"] == "stopped"
    assert len(plot(tmp_path / "run", choice=Choice(("pressure",)))) == 1


def test_a_killed_process_is_resumed(tmp_path: Path) -> None:
    solve(SHEARED, tmp_path / "case")
    # Files of a run as short as this one would be written at its beginning and its end only.
    always = "run_file.SAVE_INTERVAL = run_file.MIN_INTERVAL_RATIO = 0.0; "
    eager = "import sys; from mlsanm_cli.io import run_file; " + always
    process = start(
        tmp_path, SHEARED, "--quiet", program=("-c", eager + "from mlsanm_cli.cli import main; main()")
    )
    wait_for_steps(tmp_path, 20, process)
    process.kill()
    process.communicate()
    assert read_run(tmp_path / "run").path.rows >= 19
    assert "killed" in info(tmp_path / "run")["stop_reason"]
    assert resume(tmp_path / "run", console=Quiet())["status"] == "done"
    assert resumed_differences(tmp_path / "case", tmp_path / "run") == []
