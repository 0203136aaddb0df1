"""The command as the shell sees it: a process of its own."""

from __future__ import annotations

import os
import resource
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
HEAVY = ("numpy", "scipy", "numba", "pydantic", "h5py", "meshio", "matplotlib")


def mlsanm(*arguments: str, code: str = "") -> subprocess.CompletedProcess[str]:
    program = ["-c", code] if code else ["-m", "mlsanm_cli.cli"]
    command = [sys.executable, *program, *arguments]
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    return subprocess.run(command, capture_output=True, text=True, env=environment, check=False, cwd=ROOT)


@pytest.mark.parametrize(
    "arguments",
    [["--help"], ["--version"], ["run", "--help"], ["compare", "--help"], ["probe", "--help"]],
)
def test_nothing_heavy_is_imported(arguments: list[str]) -> None:
    code = (
        "import sys; from mlsanm_cli.cli import main; main(sys.argv[1:]);"
        f"print([name for name in {HEAVY} if name in sys.modules], file=sys.stderr)"
    )
    assert mlsanm(*arguments, code=code).stderr.splitlines()[-1] == "[]"


@pytest.mark.parametrize("arguments", [["schema"], ["explain", "solver.order"], ["new", "--list"]])
def test_commands_for_writing_a_case_do_without_numerics(arguments: list[str]) -> None:
    heavy = tuple(name for name in HEAVY if name != "pydantic")
    code = (
        "import sys; from mlsanm_cli.cli import main; code = main(sys.argv[1:]);"
        f"print(code, [name for name in {heavy} if name in sys.modules], file=sys.stderr)"
    )
    assert mlsanm(*arguments, code=code).stderr.splitlines()[-1] == "0 []"


def test_help_is_instant() -> None:
    """CPU time, the best of three: other work on the machine does not count."""
    times = []
    for _ in range(3):
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        assert mlsanm("--help").returncode == 0
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        times.append(after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime)
    assert min(times) <= 0.15


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
