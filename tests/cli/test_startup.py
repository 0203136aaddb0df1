"""The command as the shell sees it: a process of its own."""

from __future__ import annotations

import os
import subprocess
import sys
import tomllib
from pathlib import Path

ROOT = Path(__file__).parents[2]
HEAVY = ("numpy", "scipy", "numba", "pydantic", "h5py", "meshio", "matplotlib")


def mlsanm(*arguments: str, code: str = "") -> subprocess.CompletedProcess[str]:
    program = ["-c", code] if code else ["-m", "mlsanm_cli.cli"]
    command = [sys.executable, *program, *arguments]
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    return subprocess.run(command, capture_output=True, text=True, env=environment, check=False, cwd=ROOT)


def test_nothing_heavy_is_imported_for_help() -> None:
    """What a shell asks for with every completion comes at once."""
    code = (
        "import sys; from mlsanm_cli.cli import main;"
        "[main(words.split()) for words in ('--help', '--version', 'run --help', 'probe --help')];"
        f"print([name for name in {HEAVY} if name in sys.modules], file=sys.stderr)"
    )
    assert mlsanm(code=code).stderr.splitlines()[-1] == "[]"


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


def test_the_entry_point_of_the_package() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    assert project["scripts"] == {"mlsanm": "mlsanm_cli.cli:main"}
