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
            "scipy.linalg",
            "scipy.optimize",
            "scipy.optimize._zeros_py",
            "scipy.spatial",
            "scipy.special",
            "scipy.stats",
        ),
        *("scipy.sparse.linalg", "scipy.sparse.csgraph"),
        *("numpy.f2py.crackfortran", "numpy.testing._private", "numpy.ctypeslib._ctypeslib"),
        *("email.message", "importlib.metadata._adapters", "socket"),
        *("mlsanm_cli.app.scene.geometry_files", "mlsanm_cli.cloud.loops", "mlsanm_cli.io.meshes"),
        *("mlsanm_cli.solve.event_driven", "mlsanm_cli.solve.regularized", "mlsanm_cli.solve.series"),
        *(
            "mlsanm_cli.contact.laws.event_driven",
            "mlsanm_cli.contact.laws.regularized_friction",
            "mlsanm_cli.continuation",
        ),
        *(
            "mlsanm_cli.solve.polish",
            "mlsanm_cli.cli.authoring",
            "mlsanm_cli.cli.batch",
            "mlsanm_cli.cli.probe",
        ),
    }
)
"""Packages that no run of the smallest case has a use for."""


CODE = """
import sys
started = []
sys.addaudithook(lambda event, values: started.append(values[0]) if event == "subprocess.Popen" else None)
from mlsanm_cli.cli import main
code = main(sys.argv[1:])
loaded = [name for name, module in sys.modules.items() if type(module).__name__ != "_Waiting"]
print(code, ",".join(started), *loaded, file=sys.stderr)
"""


def imported(tmp_path: Path, *arguments: str) -> tuple[set[str], set[str]]:
    """Processes that a command has started, and the modules that it has loaded."""
    command = [sys.executable, "-c", CODE, *arguments, "--quiet"]
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    done = subprocess.run(command, capture_output=True, text=True, check=True, env=environment, cwd=tmp_path)
    code, started, *modules = done.stderr.splitlines()[-1].split(" ")
    assert code == "0", done.stderr
    return set(started.split(",")) - {""}, set(modules)


@pytest.mark.parametrize("command", ["run", "check"])
def test_a_small_case_imports_nothing_that_it_does_not_use(command: str, tmp_path: Path) -> None:
    started, modules = imported(tmp_path, command, str(ROOT / "cases" / "patch.toml"))
    assert modules & UNUSED == set()
    # For the state of the sources; an installed package has none.
    assert started <= {"git"}
