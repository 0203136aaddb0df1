"""The command as the shell sees it: a process of its own."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parents[2]


def mlsanm(*arguments: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "mlsanm_cli", *arguments]
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    return subprocess.run(command, capture_output=True, text=True, env=environment, check=False, cwd=ROOT)


def test_exit_code_and_streams() -> None:
    done = mlsanm("resume", "nowhere")
    assert (done.returncode, done.stdout) == (2, "")
    assert "nowhere is not a run" in done.stderr


def test_a_reader_that_leaves_is_no_error() -> None:
    # It waits for the reader to be gone.
    code = "import sys, time; time.sleep(0.2); from mlsanm_cli.cli import main; sys.exit(main(['--help']))"
    command = f'{sys.executable} -c "{code}" | true; exit ${{PIPESTATUS[0]}}'
    done = subprocess.run(["bash", "-c", command], capture_output=True, text=True, cwd=ROOT, check=False)
    assert (done.returncode, done.stderr) == (0, "")
