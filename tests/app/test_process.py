"""Runs as processes of their own: signals, and a kernel cache that cannot be written."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from mlsanm_cli.app.info import info
from mlsanm_cli.app.plot import plot
from mlsanm_cli.io.run_reader import read_run
from tests.app.scenes import BAR, hertz

ROOT = Path(__file__).parents[2]
PATIENCE = 120.0


def start(directory: Path, text: str, *arguments: str, **environment: str) -> subprocess.Popen[str]:
    (directory / "case.toml").write_text(text)
    command = [sys.executable, "-m", "mlsanm_cli.cli", "run", "case.toml", "--out", "run", *arguments]
    return subprocess.Popen(
        command,
        cwd=directory,
        env={**os.environ, "PYTHONPATH": str(ROOT), **environment},
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


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_leaves_a_readable_run(number: signal.Signals, tmp_path: Path) -> None:
    # Thousands of saved states: the run would go on for a minute.
    positions = ", ".join(str(0.2 + 0.0002 * k) for k in range(4001))
    process = start(tmp_path, hertz() + f"\n[output]\nvtu = false\nat = [{positions}]\n")
    wait_for_steps(tmp_path, 5, process)
    process.send_signal(number)
    _, err = process.communicate(timeout=PATIENCE)
    assert process.returncode == 75
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
    assert len(plot(tmp_path / "run")) >= 3


def test_a_cache_that_cannot_be_written_costs_one_warning(tmp_path: Path) -> None:
    process = start(tmp_path, BAR, "--json", MLSANM_CACHE_DIR="/proc/mlsanm")
    out, err = process.communicate(timeout=PATIENCE)
    assert process.returncode == 0
    warnings = [line for line in err.splitlines() if "warning" in line]
    assert len(warnings) == 1
    assert "cannot be kept" in warnings[0]
    assert "MLSANM_CACHE_DIR" in warnings[0]
    assert json.loads(out)["status"] == "done"
