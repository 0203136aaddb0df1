"""The checkpoint of a run, as datasets of /checkpoint in run.h5, and the provenance of a result: versions,
machine, command."""

from __future__ import annotations

import json
import os
import platform
import sys
from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any, NamedTuple, TypeVar

import numpy as np

from mlsanm_cli import __version__
from mlsanm_cli.app.scene.refinement import Refinement
from mlsanm_cli.case import LoadedCase
from mlsanm_cli.commit import commit
from mlsanm_cli.errors import RunError
from mlsanm_cli.io.run_file import Value
from mlsanm_cli.io.run_reader import RunData
from mlsanm_cli.solve.state import Checkpoint, State

REFINEMENT = "checkpoint/refinement"

Record = TypeVar("Record", State, Checkpoint)


class EarlierRun(NamedTuple):
    """An interrupted run: the rows of its path, the seconds that they took, and the ``figures`` counted so
    far; if there are any rows, the state of the ``last`` one and the checkpoint from which the path
    continues; the ``refinement`` of its clouds, if that was complete."""

    rows: int
    seconds: float
    figures: Mapping[str, Any]
    last: State | None
    checkpoint: Checkpoint | None
    refinement: Refinement | None


def interrupted_run(origin: RunData) -> EarlierRun:
    """The stored data of an interrupted run. Raises RunError if they are damaged or of another version."""
    stored = origin.checkpoint
    try:
        refined = "refinement" in stored
        refinement = Refinement.read(json.loads(stored["refinement"])) if refined else None
        figures, last, checkpoint = {}, None, None
        # Without rows there may be no checkpoint.
        if origin.rows > 0 or "last" in stored:
            path, figures = stored["path"], json.loads(stored["figures"])
            last = restored(State, stored["last"])
            checkpoint = restored(Checkpoint, {**path, "state": restored(State, path["state"])})
        return EarlierRun(origin.rows, origin.seconds, figures, last, checkpoint, refinement)
    except (LookupError, AttributeError, TypeError, ValueError) as error:
        raise RunError(
            f"the checkpoint of the run cannot be read: {error!r}",
            "it is damaged or from another version of mlsanm; run the case again with --force",
        ) from error


def as_text(value: Any) -> str:
    # Unlike in summary.json, nan is kept.
    return json.dumps(value, default=lambda array: array.tolist())


def flattened(name: str, value: Any) -> dict[str, Value]:
    """All numbers and arrays of a record or a mapping and those nested in it, by path; None is omitted."""
    if value is None:
        return {}
    if is_dataclass(value):
        value = {one.name: getattr(value, one.name) for one in fields(value)}
    if not isinstance(value, Mapping):
        return {name: np.asarray(value)}
    parts = [flattened(f"{name}/{key}", part) for key, part in value.items()]
    return {key: array for part in parts for key, array in part.items()}


def restored(kind: type[Record], stored: Mapping[str, Any]) -> Record:
    """A record from its stored numbers, arrays and mappings of arrays."""
    plain = {key: one.item() if getattr(one, "ndim", 1) == 0 else one for key, one in stored.items()}
    return kind(**plain)


PACKAGES = ("numpy", "scipy", "numba", "h5py", "meshio", "pydantic")


def attributes(loaded: LoadedCase, argv: tuple[str, ...], threads: int) -> dict[str, str | int | float]:
    return {
        "git": commit(),
        "argv": " ".join(argv),
        "case_hash": loaded.case_hash,
        "case_path": str(loaded.path),
        "versions": _versions(),
        "cpu": cpu(),
        "host": platform.node(),
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
    versions = {"python": platform.python_version()} | {package: version for package, _, version in found}
    return " ".join(f"{name} {versions.get(name, '?')}" for name in ("python", *PACKAGES))
