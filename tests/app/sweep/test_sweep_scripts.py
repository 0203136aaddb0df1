"""The scripts in cases/sweeps call mlsanm as it wants to be called, and continue past a run that fails."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from itertools import pairwise
from pathlib import Path

import pytest

from mlsanm_cli.case import load_case

SCRIPTS = Path(__file__).parents[3] / "cases" / "sweeps"
CASE = SCRIPTS.parent / "cattaneo_mindlin.toml"
FAKE = """#!{python}
import os, sys
with open(os.environ["CALLS"], "a") as calls:
    calls.write("\\t".join(sys.argv[1:]) + "\\n")
sys.exit(3 if "contact.interface.friction=0.3" in sys.argv else 0)
"""


def calls(tmp_path: Path, script: str, *arguments: str, **variables: str) -> tuple[int, list[list[str]]]:
    """The exit code of a script, and what it called mlsanm with; the run with friction 0.3 fails."""
    fake = tmp_path / "bin" / "mlsanm"
    fake.parent.mkdir()
    fake.write_text(FAKE.format(python=sys.executable))
    fake.chmod(0o755)
    log = tmp_path / "calls"
    environment = os.environ | {"PATH": f"{fake.parent}:{os.environ['PATH']}", "CALLS": str(log)} | variables
    command = ["sh", str(SCRIPTS / script), *arguments]
    done = subprocess.run(command, env=environment, cwd=tmp_path, check=False, timeout=60)
    return done.returncode, [line.split("\t") for line in log.read_text().splitlines()]


def check_run(call: list[str]) -> str:
    """The directory of a run, whose changes fit the case."""
    assert call[:2] == ["run", str(CASE)]
    assert {"--skip-done", "--force", "--quiet"} <= set(call)
    load_case(CASE, [value for name, value in pairwise(call) if name == "--set"])
    return call[call.index("--out") + 1]


@pytest.mark.parametrize("script", ["loop.sh", "xargs.sh", "parallel.sh"])
def test_every_run_is_made_and_collected(tmp_path: Path, script: str) -> None:
    if script == "parallel.sh" and shutil.which("parallel") is None:
        pytest.skip("GNU parallel is not installed")
    code, made = calls(tmp_path, script, str(CASE), "out", *([] if script == "loop.sh" else ["2"]))
    assert code == 3
    *runs, collected = made
    assert len({check_run(call) for call in runs}) == len(runs) == (10 if script == "parallel.sh" else 5)
    assert collected[0] == "collect"
    assert collected[-2:] == ["--out", "out/table.csv"]


def test_every_job_of_the_array_makes_its_own_run(tmp_path: Path) -> None:
    places = []
    for task in range(5):
        (tmp_path / str(task)).mkdir()
        variables = {"SLURM_ARRAY_TASK_ID": str(task), "case": str(CASE), "out": "out"}
        code, (call,) = calls(tmp_path / str(task), "slurm.sh", **variables)
        places.append(check_run(call))
        assert code == (3 if places[-1].endswith("friction-0.3") else 0)
    assert len(set(places)) == 5
