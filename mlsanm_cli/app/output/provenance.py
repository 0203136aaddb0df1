"""The provenance of a result: versions, machine, command."""

from __future__ import annotations

import os
import platform
import sys
from functools import lru_cache
from pathlib import Path

from mlsanm_cli import __version__
from mlsanm_cli.case import LoadedCase
from mlsanm_cli.commit import commit
from mlsanm_cli.system import host

PACKAGES = ("numpy", "scipy", "numba", "h5py", "meshio", "pydantic")


def attributes(loaded: LoadedCase, argv: tuple[str, ...], threads: int) -> dict[str, str | int | float]:
    """Root attributes of run.h5."""
    return {
        "git": commit(),
        "argv": " ".join(argv),
        "case_hash": loaded.case_hash,
        "case_path": str(loaded.path),
        "versions": _versions(),
        "cpu": cpu(),
        "host": host(),
        "threads": threads,
        "mlsanm": __version__,
        **({"strain": "finite"} if loaded.case.model.strain == "finite" else {}),
    }


@lru_cache(maxsize=1)
def cpu() -> str:
    """The name of the processor if the system reports it, else its architecture."""
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        lines = []
    names = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return names[0] if names else platform.processor() or platform.machine()


@lru_cache(maxsize=1)
def _versions() -> str:
    """Versions of Python and of the packages, from the names of their metadata directories: importing
    ``importlib.metadata``, or the packages, takes longer."""
    names = [name for folder in reversed(sys.path) if os.path.isdir(folder) for name in os.listdir(folder)]
    found = [name.removesuffix(".dist-info").partition("-") for name in names if name.endswith(".dist-info")]
    versions = {package: version for package, _, version in found}
    return " ".join(
        [f"python {platform.python_version()}", *(f"{name} {versions.get(name, '?')}" for name in PACKAGES)]
    )
