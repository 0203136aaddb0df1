"""What can be run: mlsanm and other programs, by catalogue.toml, and which programs are there."""

from __future__ import annotations

import importlib.util
import json
import shutil
import subprocess
import sys
import tomllib
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from meshes import load, vertices

HERE = Path(__file__).resolve().parent
CASES = HERE.parents[1] / "cases"
DEFAULT = "1e-3"
"""Accuracy of contact grids that nobody asks for."""


@dataclass(frozen=True)
class Job:
    """Commands, with the mesh ``given`` in a file and from the ``geometry`` on, and the file they leave."""

    commands: dict[str, list[str]]
    result: Path
    nodes: Callable[[], int]


@dataclass(frozen=True)
class Entry:
    """One point of a picture. ``needs`` is the package without which it is left out."""

    program: str
    label: str
    needs: str
    prepare: Callable[[Path], Job]


@cache
def getfem_python() -> str | None:
    """The interpreter GetFEM is installed for: this one, or the system's, where Debian puts it."""
    for interpreter in (sys.executable, "/usr/bin/python3"):
        command = [interpreter, "-c", "import getfem, triangle"]
        if Path(interpreter).exists() and not subprocess.run(command, capture_output=True).returncode:
            return interpreter
    return None


def missing() -> dict[str, str]:
    """Programs that cannot run here, and why."""
    if importlib.util.find_spec("triangle") is None:
        return dict.fromkeys(
            ("skfem", "getfem", "calculix"), "its meshes need triangle (pip install triangle)"
        )
    absent = {}
    if importlib.util.find_spec("skfem") is None:
        absent["skfem"] = "pip install scikit-fem"
    if getfem_python() is None:
        absent["getfem"] = "no interpreter with getfem and triangle (see benchmarks/peers/README.md)"
    if shutil.which("ccx") is None:
        absent["calculix"] = "no ccx on the path (Debian: calculix-ccx)"
    return absent


def mlsanm(label: str, case: str, settings: list[str]) -> Entry:
    """``mlsanm run`` without pictures, with the exact laws."""

    def prepare(stem: Path) -> Job:
        given = ["output.vtu=false", 'contact.interface.regularization.law="exact"', *settings]
        command = [sys.executable, "-m", "mlsanm_cli", "run", str(CASES / f"{case}.toml"), "--quiet"]
        command += ["--force", "--threads", "1", "--out", str(stem)]
        command += [part for text in given for part in ("--set", text)]
        summary = stem / "summary.json"
        return Job(
            {"geometry": command},
            stem / "interface.csv",
            lambda: int(json.loads(summary.read_text())["nodes"]),
        )

    return Entry("mlsanm", label, "mlsanm", prepare)


def peer(program: str, label: str, script: str, problem: str, mesh: str, options: list[str]) -> Entry:
    """A peer's script on a mesh of meshes.py."""

    def prepare(stem: Path) -> Job:
        file, out = stem.with_suffix(".npz"), stem.with_suffix(".csv")
        arrays = load(mesh)
        np.savez(file, **arrays)
        interpreter = getfem_python() if script == "getfem" else sys.executable
        command = [str(interpreter), str(HERE / f"{script}_peer.py"), problem]
        ways = {"given": str(file), "geometry": mesh}
        commands = {way: [*command, source, str(out), *options] for way, source in ways.items()}
        return Job(commands, out, lambda: vertices(arrays))

    return Entry(program, label, script, prepare)


def _ours(row: dict[str, Any]) -> Iterator[Entry]:
    settings = row.get("settings", [])
    if "levels" in row:
        stages = ", ".join(f"{{press={k / row['levels']}}}" for k in range(1, row["levels"] + 1))
        settings = [f"stage=[{stages}]"]
    for accuracy in row.get("accuracies", [""]):
        grid = [f"contact.interface.accuracy={accuracy}"] if accuracy not in ("", DEFAULT) else []
        label = f"defaults ({accuracy})" if accuracy == DEFAULT else accuracy
        yield mlsanm(label or f"cases/{row['case']}.toml", row["case"], [*settings, *grid])


def _theirs(row: dict[str, Any]) -> Iterator[Entry]:
    for size in row.get("sizes", [""]):
        size, _, levels = size.partition(":")
        label = row.get("label", "{}").format(size) + (f", {levels} levels" if levels else "")
        options = [*(["--levels", levels] if levels else []), *row.get("options", [])]
        problem = {"levels": "hertz"}.get(row["part"], row["part"])
        yield peer(row["program"], label, row["script"], problem, row["mesh"].format(size), options)


def parts() -> dict[str, list[Entry]]:
    """All entries of catalogue.toml by parts."""
    catalogue = tomllib.loads((HERE / "catalogue.toml").read_text())
    return {
        part: [
            *_ours(row),
            *(entry for other in catalogue["peer"] if other["part"] == part for entry in _theirs(other)),
        ]
        for part, row in catalogue["mlsanm"].items()
    }
