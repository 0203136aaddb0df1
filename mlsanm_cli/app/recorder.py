"""The run directory while a run goes on: every finished step is on disk before the next one begins."""

from __future__ import annotations

import time
from collections.abc import Mapping
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import numpy as np

from mlsanm_cli.app import recording
from mlsanm_cli.app.build import Built
from mlsanm_cli.app.clock import Clock
from mlsanm_cli.app.console import Console
from mlsanm_cli.app.states import PathStep, Polish, State
from mlsanm_cli.case import LoadedCase, resolved_mapping
from mlsanm_cli.io import run_dir
from mlsanm_cli.io.run_file import RunFile
from mlsanm_cli.io.summary import EventLog, toml_text, write_interface_csv, write_json_atomic, write_toml
from mlsanm_cli.io.vtu import StateWriter, write_single


class Recorder:
    """Writes run.h5, events.jsonl, VTU and CSV files; use as a context manager."""

    def __init__(
        self,
        directory: Path,
        loaded: LoadedCase,
        attributes: Mapping[str, str | int | float],
        clock: Clock,
        console: Console,
    ) -> None:
        self._directory = directory
        self._case = loaded.case
        self._clock = clock
        self._console = console
        with clock.phase("output"):
            resolved = resolved_mapping(loaded.case)
            self._file = RunFile.create(directory / run_dir.RUN_FILE, attributes)
            self._file.write_case(loaded.raw, toml_text(resolved))
            self._events = EventLog(directory / run_dir.EVENTS_FILE)
            self._events.write("start", case=str(loaded.path), case_hash=loaded.case_hash)
            write_toml(directory / run_dir.RESOLVED_FILE, resolved)
        self._states = StateWriter(directory)
        self._started = time.monotonic()
        self.last: State | None = None
        self.steps = self.iterations = self.factorizations = self.solves = 0
        self.residual = 0.0
        self.linear_residual: float | None = None
        self.warnings: list[str] = []
        self.cone: dict[str, float] = {}
        self.polished: list[Polish] = []
        self._mapped = False

    def start(self, built: Built) -> None:
        """Store the model."""
        with self._clock.phase("output"):
            recording.write_model(self._file, built)

    def step(self, built: Built, step: PathStep) -> None:
        """Store one finished step: its series first, then its row, then the fields wanted within it."""
        with self._clock.phase("output"):
            state = step.state
            index = self.steps if self.last is None else self.steps + 1
            if step.series:
                if not self._mapped:
                    recording.write_maps(self._file, built)
                    self._mapped = True
                self._file.write_series(index, step.series, step.series_attributes)
            self._file.append_step(recording.step_record(built, step, time.monotonic() - self._started))
            self._events.write(
                "step", index=index, position=state.position, residual=state.residual, length=step.length
            )
            self.last, self.steps = state, index
            self.iterations += step.iterations
            self.factorizations += step.factorizations
            self.solves += step.solves
            self.residual = max(self.residual, state.residual, *(s.residual for s in step.saved), 0.0)
            for saved in step.saved:
                self._save_fields(built, saved)
        for name in built.condensed.tangential:
            ratios = [recording.cone_ratio(built, name, s) for s in (state, *step.saved)]
            self.cone[name] = max(self.cone.get(name, 0.0), *ratios)
        if step.polish is not None:
            self.polished.append(step.polish)
        if step.warning:
            self.warn(step.warning)
        peak = float(state.pressure.max(initial=0.0))
        text = f"closed {int(state.closed.sum())}  peak pressure {peak:.6g}" if len(state.pressure) else ""
        self._console.step(index, state.position, state.residual, text)

    def _save_fields(self, built: Built, state: State) -> None:
        wanted = tuple(dict.fromkeys(self._case.output.fields))
        if not wanted:
            return
        fields, residual = recording.fields_of(
            built, state, stress=bool({"stress", "von_mises"} & set(wanted))
        )
        self.linear_residual = max(self.linear_residual or 0.0, residual)
        self._file.write_fields(state.position, recording.stored_fields(fields, wanted))
        if self._case.output.vtu:
            self._states.write(state.position, recording.vtu_states(built, fields, wanted))

    def check_linear(self, built: Built) -> float:
        """Largest residual of the linear systems over the saved states, or of the last if none was saved."""
        if self.linear_residual is None and self.last is not None:
            _, self.linear_residual = recording.fields_of(built, self.last, stress=False)
        return self.linear_residual or 0.0

    def warn(self, message: str) -> None:
        """A warning on the console, in the events and in the summary."""
        self.warnings.append(message)
        self._events.write("warning", message=message)
        self._console.warning(message)

    def failure(self, built: Built | None) -> None:
        """Write the last good state as failure.vtu."""
        if built is None or self.last is None:
            return
        with self._clock.phase("output"):
            fields, _ = recording.fields_of(built, self.last, stress=True)
            states = recording.vtu_states(built, fields, ("displacement", "stress", "von_mises"))
            write_single(self._directory / run_dir.FAILURE_FILE, states)

    def interfaces(self, built: Built) -> None:
        """Write every contact's final state as CSV."""
        if self.last is None:
            return
        with self._clock.phase("output"):
            for pairing in built.condensed.pairings:
                columns = recording.interface_columns(built, pairing, self.last)
                name = run_dir.interface_name(pairing.name, len(built.condensed.pairings))
                write_interface_csv(self._directory / name, {k: np.asarray(v) for k, v in columns.items()})

    def finish(self, summary: Mapping[str, Any]) -> None:
        """Close everything; summary.json comes last, so that its presence means the run is over."""
        self._events.write("end", status=summary["status"], reason=summary["stop_reason"])
        self._file.set_status(str(summary["status"]))
        self.close()
        write_json_atomic(self._directory / run_dir.SUMMARY_FILE, summary)

    def close(self) -> None:
        """Close the files; twice is allowed."""
        self._file.close()
        self._events.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()
