"""What can be run: a program on a mesh, and which programs are there."""

from __future__ import annotations

import importlib.util
import shutil
import subprocess
import sys
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np
from meshes import load, vertices

HERE = Path(__file__).resolve().parent


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
    absent = {}
    if importlib.util.find_spec("triangle") is None:
        return dict.fromkeys(
            ("skfem", "getfem", "calculix"), "its meshes need triangle (pip install triangle)"
        )
    if importlib.util.find_spec("skfem") is None:
        absent["skfem"] = "pip install scikit-fem"
    if getfem_python() is None:
        absent["getfem"] = "no interpreter with getfem and triangle (see benchmarks/peers/README.md)"
    if shutil.which("ccx") is None:
        absent["calculix"] = "no ccx on the path (Debian: calculix-ccx)"
    return absent


def peer(program: str, label: str, script: str, problem: str, mesh: str, *options: str) -> Entry:
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
