"""What a run may import: modules counted, not seconds, so that a slow start cannot creep back."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
UNUSED = frozenset(
    {
        "concurrent.futures",
        *("numba", "meshio", "matplotlib", "rich", "distributed", "click.testing", "unittest"),
        *(
            "scipy.fft",
            "scipy.interpolate",
            "scipy.optimize",
            "scipy.optimize._zeros_py",
            "scipy.spatial",
            "scipy.special",
            "scipy.stats",
        ),
        *("scipy.sparse.linalg", "scipy.sparse.csgraph"),
        *("numpy.f2py.crackfortran", "numpy.testing._private", "numpy.ctypeslib._ctypeslib"),
    }
)
"""Packages that no run of the smallest case has a use for."""


def imported(tmp_path: Path, *arguments: str) -> set[str]:
    """Modules after a command of its own process."""
    code = (
        "import sys; from mlsanm_cli.cli import main; code = main(sys.argv[1:]);"
        "print(code, *sys.modules, file=sys.stderr)"
    )
    command = [sys.executable, "-c", code, *arguments, "--quiet"]
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    done = subprocess.run(command, capture_output=True, text=True, check=True, env=environment, cwd=tmp_path)
    code, *modules = done.stderr.splitlines()[-1].split()
    assert code == "0", done.stderr
    return set(modules)


@pytest.mark.parametrize("command", ["run", "check"])
def test_a_small_case_imports_nothing_that_it_does_not_use(command: str, tmp_path: Path) -> None:
    modules = imported(tmp_path, command, str(ROOT / "cases" / "patch.toml"))
    assert modules & UNUSED == set()
