"""Recording of a run in its directory: its files, the checkpoint (datasets of /checkpoint in run.h5), the
provenance of a result (versions, machine, command), and the content of summary.json."""

from __future__ import annotations

import json
import math
import os
import platform
import sys
import time
from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any, NamedTuple, TypeVar

import numpy as np

from mlsanm_cli import __version__
from mlsanm_cli.app.checks.check import Check, Verdicts
from mlsanm_cli.app.context import RunContext
from mlsanm_cli.app.output.analysis import Analysis, Ending
from mlsanm_cli.app.output.parts import vtu_states
from mlsanm_cli.app.scene.build import Refinement
from mlsanm_cli.case import LoadedCase, resolved_mapping
from mlsanm_cli.commit import commit
from mlsanm_cli.errors import NumericalError, RunError, UnstableError
from mlsanm_cli.io import run_dir
from mlsanm_cli.io.files import EventLog, toml_text, write_csv, write_json_atomic, write_text
from mlsanm_cli.io.run_file import Attribute, RunFile, Value
from mlsanm_cli.io.run_reader import RunData
from mlsanm_cli.io.schema import INTERFACE_COLUMNS, place, row
from mlsanm_cli.io.vtu import StateWriter, write_parts
from mlsanm_cli.records import Closing
from mlsanm_cli.solve.state import Checkpoint, PathStep, State
from mlsanm_cli.system import peak_memory_mb

ESTIMATE_AFTER = 2.0
"""Seconds after which the remaining time of a path is shown."""
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
        hint = "it is damaged or from another version of mlsanm; run the case again with --force"
        raise RunError(f"the checkpoint of the run cannot be read: {error!r}", hint) from error


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


class Recorder(Closing):
    """Writes run.h5, events.jsonl, resolved.toml, VTU and CSV files of a run; a context manager. With
    ``earlier`` it continues the files of an interrupted run after their last step.

    ``last`` is the state of the last row, ``checked`` the one that was checked last. ``tally`` are the totals
    of the path so far: plain values, with which a resumed run continues, as with the ``warnings``.
    """

    def __init__(
        self,
        directory: Path,
        loaded: LoadedCase,
        attributes: Mapping[str, Attribute],
        context: RunContext,
        earlier: EarlierRun | None = None,
    ) -> None:
        """Creates the files, or opens those of an ``earlier`` run. Raises RunError."""
        self.directory, self._case, self._earlier = directory, loaded.case, earlier
        self._clock, self._console = context.clock, context.console
        rows, case = None if earlier is None else earlier.rows, resolved_mapping(loaded.case)
        file, resolved = directory / run_dir.RUN_FILE, toml_text(case)
        with context.phase("output"):
            opened = RunFile.create if rows is None else RunFile.reopen
            self._file = opened(file, attributes)
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
        self._states = StateWriter(directory)
        self._rows = self._saved = 0
        self._has_maps = False
        # /path/seconds continue.
        self._started = time.monotonic() - (earlier.seconds if earlier else 0.0)
        self._pace: tuple[float, float] | None = None
        self.warnings: list[str] = []
        self.verdicts = Verdicts(self._warn)
        self.last: State | None = None
        self.checked: State | None = None
        self.tally: dict[str, Any] = {
            **dict.fromkeys(("steps", "iterations", "factorizations", "solves"), 0),
            "residual": 0.0,
        }
        self.failed_at: Mapping[str, Any] = {}

    def _warn(self, check: Check) -> None:
        """Issues the warning of a check on the console, in the events and in the summary."""
        self.warnings.append(check.text)
        self._events.write_once("warning", check=check.name, message=check.text)
        self._console.warning(f"{check.text} [{check.name}]")

    def start(self, analysis: Analysis[Any]) -> Checkpoint | None:
        """Stores the model; returns the checkpoint from which the path continues, None for a new path."""
        with self._clock.phase("output"):
            datasets, attributes = analysis.model()
            self._file.confirm(datasets)
            refined = {REFINEMENT: as_text(analysis.refinement)} if analysis.refinement else {}
            self._file.add(datasets=refined, attributes={"": attributes})
            self._file.save_if_due()
            before = self._earlier
            if before is None or before.last is None:
                return None
            # The totals after the last recorded row, and the lists of VTU files.
            figures = dict(before.figures)
            self.warnings += self.verdicts.take_up(figures.pop("checks"))
            self.last, self.tally, self._rows = before.last, figures, before.rows
            positions = self._file.saved_positions()
            self._saved = len(positions)
            for position in positions if self._case.output.vtu else ():
                self._states.keep(position, tuple(analysis.clouds))
            return before.checkpoint

    def step(self, analysis: Analysis[Any], step: PathStep) -> None:
        """Adds a finished step: its rows, its series, the fields saved within it, and the checkpoint. All of
        it is written together, some time later. Raises NumericalError for a saved state that is not
        admissible."""
        state = step.state
        with self._clock.phase("output"):
            rows, datasets = [], dict[str, Value]()
            for one in analysis.row_states(step):
                # Counts of a step belong to its end.
                ends = one is step.state
                path = {
                    "position": one.position,
                    "step_length": step.length if ends else 0.0,
                    "residual": one.residual,
                    "order": step.order,
                    "factorizations": step.factorizations if ends else 0,
                    "solves": step.solves if ends else 0,
                    "seconds": time.monotonic() - self._started,
                }
                rows.append(row(path, analysis.quantities(one)))
            count = len(rows)
            attributes: dict[str, Mapping[str, Attribute]] = {}
            if step.series:
                series = place("series", str(self._rows))
                datasets = {} if self._has_maps else analysis.series_maps()
                datasets |= {f"{series}/{name}": array for name, array in step.series.items()}
                attributes[series], self._has_maps = step.series_attributes, True
            saved = step.saved if self._case.output.fields else ()
            for one, (fields, figures) in zip(saved, analysis.fields(saved), strict=True):
                number, written = str(self._saved), analysis.fields_written
                datasets |= {
                    place("fields", number, body, name): np.ascontiguousarray(values[name])
                    for body, values in fields.items()
                    for name in written
                }
                attributes[place("fields", number)] = figures
                rows.append({"fields/position": one.position})
                self.checked = one
                for name, figure in figures.items():
                    # numpy's maximum, unlike max, propagates nan.
                    self.tally[name] = float(np.maximum(self.tally.get(name, 0.0), figure))
                self.verdicts.judge(analysis.field_checks(one, fields))
                if self._case.output.vtu:
                    parts = vtu_states(analysis.clouds, fields, written)
                    self._states.write(one.position, parts, *analysis.lines(one, fields))
                self._saved += 1
            self._count(analysis, step)
            self._rows += count
            # Before the rows: a resumed run drops the events of steps that are not in its file.
            event = {"index": self._rows - 1, "position": state.position, "residual": state.residual}
            self._events.write("step", **event, length=step.length)
            totals = {**self.tally, "checks": self.verdicts.plain}

            def checkpoint() -> dict[str, Value]:
                last = {"last": state, "path": step.checkpoint}
                return {**flattened("checkpoint", last), "checkpoint/figures": as_text(totals)}

            self._file.add(rows, datasets, attributes, checkpoint)
            self._file.save_if_due()
        texts = [*analysis.progress(step), *self._progress(state.position)]
        self._console.step(self.tally["steps"], state.position, state.residual, "  ".join(texts).rstrip())

    def _count(self, analysis: Analysis[Any], step: PathStep) -> None:
        tally = self.tally
        names = ("iterations", "factorizations", "solves")
        counts = {name: tally[name] + getattr(step, name) for name in names}
        residual = max(tally["residual"], *(state.residual for state in (step.state, *step.saved)))
        steps = tally["steps"] + (self.last is not None)
        self.tally = {**tally, **counts, "residual": residual, "steps": steps}
        self.tally |= analysis.tallied(self.tally, self.last, step)
        self.last = step.state
        if step.warning:
            where = f"position {step.state.position:.6g}"
            self.verdicts.judge([Check("snap", 1.0, step.warning, place=where)])

    def _progress(self, position: float) -> list[str]:
        """Progress of the path, elapsed and estimated remaining time; empty during the first seconds."""
        now, stages = time.monotonic(), len(self._case.stage)
        self._pace = self._pace or (now, position)
        begun, first = self._pace
        if now - begun < ESTIMATE_AFTER or not first < position < stages:
            return []
        left = (now - begun) * (stages - position) / (position - first)
        number = math.floor(position)
        names = ", ".join(list(self._case.stage[number])[:2])
        stage = f"stage {number + 1} of {stages} ({names}), " if stages > 1 else ""
        passed = self._clock.wall_seconds
        return [f"{stage}{100.0 * position / stages:.0f} %", f"{passed:.0f} s, {left:.0f} s left"]

    def failure(self, analysis: Analysis[Any], error: NumericalError) -> None:
        """Records a failure, and writes failure.vtu: the state that was checked last, or the last good one if
        the path ended there or the other is not finite; the model if there is no state."""
        state = self.checked if self.checked is not None and self.checked.is_finite else self.last
        self._console.phase("writing the failed state")
        with self._clock.phase("output"):
            parts, self.failed_at = analysis.diagnosis(state)
            write_parts(self.directory / run_dir.FAILURE_FILE, "body", parts)
            self._events.write("failure", reason=error.message, hint=error.hint, **self.failed_at)

    def finish(self, analysis: Analysis[Any], summary: Mapping[str, Any]) -> None:
        """Writes the tables of the path and of all contacts, and the status; summary.json is written last, so
        that its presence means that the run is over."""
        if self.last is not None:
            write_csv(self.directory / run_dir.PATH_FILE, self._file.path_table())
            tables = analysis.quantities(self.last)["contacts"]
            for name, values in tables.items():
                nodes = analysis.contacts[name]
                places = dict(zip("xy", nodes.points.T, strict=True)) | {"arc_length": nodes.arc_length}
                columns = {column: {**places, **values}[column] for column in INTERFACE_COLUMNS}
                write_csv(self.directory / run_dir.interface_name(name, len(tables)), columns)
        self._events.write("end", status=summary["status"], reason=summary["stop_reason"])
        self._file.set_status(str(summary["status"]))
        write_json_atomic(self.directory / run_dir.SUMMARY_FILE, summary)

    def close(self) -> None:
        try:
            self._file.close()
        finally:
            self._events.close()


def summarise(analysis: Analysis[Any], ending: Ending, recorder: Recorder) -> dict[str, Any]:
    """The content of summary.json, as far as known when the run ended."""
    state, tally, context = recorder.last, recorder.tally, analysis.context
    summary: dict[str, Any] = {
        "status": ending.status,
        "stop_reason": ending.reason,
        "position": state.position if state else None,
        **{name: tally[name] for name in ("steps", "iterations", "factorizations", "solves")},
    }
    if ending.stopped_by and state is not None:
        factors = dict(zip(analysis.case.moved, state.factors.tolist(), strict=True))
        summary |= {"stopped_at": state.position, "stopped_by": ending.stopped_by, "factors": factors}
    if ending.hint:
        summary["hint"] = ending.hint
    if recorder.failed_at:
        summary["failure"] = recorder.failed_at
    summary |= {"contacts": {}, "residual": tally["residual"], **analysis.sizes(tally)}
    if state is not None:
        quantities = analysis.quantities(state)
        summary["forces"] = {name: force.tolist() for name, force in quantities["resultants"].items()}
        if quantities["probes"]:
            summary["probes"] = {
                name: values | {key: values[key].tolist() for key in ("displacement", "stress")}
                for name, values in quantities["probes"].items()
            }
        summary |= analysis.figures(state, tally)
    if isinstance(ending.error, UnstableError) and summary.get("stability") is None:
        summary["stability"] = ending.error.stability
    return summary | {
        "quality": analysis.quality.figures(analysis.models),
        "limits": analysis.limits(),
        "seconds": context.clock.seconds,
        "wall_seconds": context.clock.wall_seconds,
        "peak_memory_mb": peak_memory_mb(),
        "warnings": recorder.warnings,
        "checks": recorder.verdicts.rows,
        "cache": context.memo.figures,
    }
