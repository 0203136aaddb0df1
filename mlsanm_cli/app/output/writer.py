"""The files that are common to all runs, and the provenance of a result: versions, machine, command."""

from __future__ import annotations

import platform
import re
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from copy import copy
from functools import lru_cache
from importlib.metadata import distribution
from pathlib import Path
from typing import Any, ClassVar, Protocol

import numpy as np

from mlsanm_cli import __version__
from mlsanm_cli.app.checks.check import Check, Verdicts
from mlsanm_cli.app.context import RunContext
from mlsanm_cli.app.output.checkpoint import EarlierRun
from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.case import LoadedCase, resolved_mapping
from mlsanm_cli.closing import Closing
from mlsanm_cli.cloud.cloud import Cloud
from mlsanm_cli.commit import commit
from mlsanm_cli.io import run_dir
from mlsanm_cli.io.atomic import write_text
from mlsanm_cli.io.records import place
from mlsanm_cli.io.run_file import Attribute, RunFile, Value
from mlsanm_cli.io.summary import EventLog, toml_text, write_csv, write_json_atomic
from mlsanm_cli.io.vtu import LinesWriter, StateWriter
from mlsanm_cli.system import host


class StepCounts(Protocol):
    """The counts that steps of all paths have."""

    @property
    def length(self) -> float: ...
    @property
    def order(self) -> int: ...
    @property
    def iterations(self) -> int: ...
    @property
    def factorizations(self) -> int: ...
    @property
    def solves(self) -> int: ...


class RecordedState(Protocol):
    """The quantities that states of all paths have."""

    @property
    def position(self) -> float: ...
    @property
    def residual(self) -> float: ...


class RunWriter(Closing):
    """run.h5, events.jsonl, resolved.toml and VTU files of a run, and its warnings; a context manager."""

    tallies: ClassVar[tuple[str, ...]]
    """Attributes with counts and maxima along the path, which a resumed run continues."""

    def __init__(
        self,
        directory: Path,
        loaded: LoadedCase,
        attributes: Mapping[str, str | int | float],
        context: RunContext,
        earlier: EarlierRun | None = None,
    ) -> None:
        """Creates the files, or opens those of an ``earlier`` run. Raises RunError."""
        rows = None if earlier is None else earlier.rows
        self.directory = directory
        self._clock, self._console, self._memo = context.clock, context.console, context.memo
        file = directory / run_dir.RUN_FILE
        with context.phase("output"):
            resolved = toml_text(resolved_mapping(loaded.case))
            self._file = (
                RunFile.create(file, attributes) if rows is None else RunFile.reopen(file, attributes)
            )
            try:
                self._file.confirm({"case/raw": loaded.raw, "case/resolved": resolved})
                self._file.save()
                self._events = EventLog(directory / run_dir.EVENTS_FILE, rows)
                if rows is None:
                    start = {"case": str(loaded.path), "case_hash": loaded.case_hash}
                    self._events.write("start", **start, threads=attributes.get("threads", 1))
                else:
                    self._events.write("resume", steps=max(rows - 1, 0))
                write_text(directory / run_dir.RESOLVED_FILE, resolved)
            except BaseException:
                self._file.close()
                raise
        self._states, self._lines = StateWriter(directory), LinesWriter(directory)
        self._vtu = loaded.case.output.vtu
        self._rows = self._saved = 0
        # /path/seconds continue.
        self._started = time.monotonic() - (earlier.seconds if earlier else 0.0)
        self.warnings: list[str] = []
        self.verdicts = Verdicts(self.warn)
        self.iterations = self.factorizations = self.solves = 0
        self.residual = 0.0

    def warn(self, check: Check) -> None:
        """Issues the warning of a check on the console, in the events and in the summary."""
        self.warnings.append(check.text)
        self._events.write_once("warning", check=check.name, message=check.text)
        self._console.warning(f"{check.text} [{check.name}]")

    def count(self, step: StepCounts, residuals: Iterable[float]) -> None:
        """Adds the counts of a step and the ``residuals`` of its states to the totals."""
        self.iterations += step.iterations
        self.factorizations += step.factorizations
        self.solves += step.solves
        self.residual = max(self.residual, *residuals)

    def path_figures(self, step: StepCounts, state: RecordedState) -> dict[str, float]:
        """The common columns of the path in a state at the end of a step."""
        return {
            "position": state.position,
            "step_length": step.length,
            "residual": state.residual,
            "order": step.order,
            "factorizations": step.factorizations,
            "solves": step.solves,
            "seconds": time.monotonic() - self._started,
        }

    def tallied(self) -> dict[str, Any]:
        """The counts and maxima so far, from which `take_up` continues."""
        return {name: copy(getattr(self, name)) for name in self.tallies} | {"checks": self.verdicts.plain}

    def take_up(self, rows: int, figures: Mapping[str, Any], bodies: Iterable[str]) -> None:
        """Restores the counts after the last recorded of the ``rows``, and the lists of VTU files."""
        self._rows = rows
        for name in self.tallies:
            setattr(self, name, figures[name])
        self.warnings += self.verdicts.take_up(figures["checks"])
        positions = self._file.saved_positions()
        self._saved = len(positions)
        for position in positions if self._vtu else ():
            self._states.keep(position, tuple(bodies))
            self._lines.keep(position)

    def add_step(
        self,
        step: StepCounts,
        state: RecordedState,
        rows: Sequence[Mapping[str, Any]],
        datasets: Mapping[str, Value],
        attributes: Mapping[str, Mapping[str, Attribute]],
        latest: Callable[[], Mapping[str, Value]],
    ) -> None:
        """Adds the rows, datasets and attributes of a step to run.h5, and the step to the events."""
        # Before the rows: a resumed run drops the events of steps that are not in its file.
        event = {"index": self._rows - 1, "position": state.position, "residual": state.residual}
        self._events.write("step", **event, length=step.length)
        self._file.add(rows, datasets, attributes, latest)
        self._file.save_if_due()

    def write_path(self) -> None:
        """Writes path.csv."""
        write_csv(self.directory / run_dir.PATH_FILE, self._file.path_table())

    def finish(self, summary: Mapping[str, Any]) -> None:
        """Closes all files; summary.json is written last, so that its presence means that the run is over."""
        self._events.write("end", status=summary["status"], reason=summary["stop_reason"])
        self._file.set_status(str(summary["status"]))
        self.close()
        write_json_atomic(self.directory / run_dir.SUMMARY_FILE, summary)

    def close(self) -> None:
        """Closes the files; may be called twice."""
        try:
            self._file.close()
        finally:
            self._events.close()


def body_datasets(name: str, cloud: Cloud, degree: int) -> dict[str, Value]:
    """The datasets of a body, with the ``degree`` of its local polynomials."""
    boundary, (index, normal, names) = ("bodies", name, "boundary"), cloud.boundary
    return {
        place("bodies", name, "points"): cloud.points,
        place("bodies", name, "degree"): np.array(degree),
        place(*boundary, "index"): index,
        place(*boundary, "normal"): normal,
        place(*boundary, "name"): list(names),
    }


def contact_datasets(
    name: str, points: FloatArray, normal: FloatArray, arc: FloatArray, weight: FloatArray
) -> dict[str, Value]:
    """The datasets of a contact before loading: its nodes, their normals, arc lengths and lengths."""
    geometry = {"points": points, "normal": normal, "arc_length": arc, "weight": weight}
    return {place("contacts", name, key): array for key, array in geometry.items()}


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
