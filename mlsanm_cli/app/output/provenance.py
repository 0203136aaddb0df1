"""The provenance of a result: versions, machine, command."""

from __future__ import annotations

import platform
import re
from functools import lru_cache
from importlib.metadata import distribution
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
    return " ".join(
        [f"python {platform.python_version()}", *(f"{name} {_version(name)}" for name in PACKAGES)]
    )


def _version(package: str) -> str:
    """The version of an installed package, without importing it."""
    found = distribution(package)
    # importlib.metadata would parse the whole file, which has thousands of lines of licences for numpy.
    named = re.search(r"^Version: *(\S+)", found.read_text("METADATA") or "", re.MULTILINE)
    return named[1] if named else found.version
