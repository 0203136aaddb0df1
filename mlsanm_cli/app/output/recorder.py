"""The run directory while a run goes on: every finished step is on disk before the next one begins."""

from __future__ import annotations

import math
import time
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import numpy as np

from mlsanm_cli.app.assessment.checks import EnergyVerdict
from mlsanm_cli.app.assessment.diagnosis import diagnose, node_fields, worst_nodes
from mlsanm_cli.app.assessment.overlaps import check_overlaps, within_themselves
from mlsanm_cli.app.assessment.refinement import Adapted
from mlsanm_cli.app.clock import Clock
from mlsanm_cli.app.console import Console
from mlsanm_cli.app.output import recording
from mlsanm_cli.app.output.lines import contact_lines, obstacle_lines
from mlsanm_cli.app.output.recording import model_bodies
from mlsanm_cli.app.scene.assemble import SceneModel
from mlsanm_cli.app.slides import large_slides
from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.case import LoadedCase, resolved_mapping
from mlsanm_cli.cloud.cloud import Cloud
from mlsanm_cli.errors import NumericalError
from mlsanm_cli.io import run_dir
from mlsanm_cli.io.path_table import write_path_csv
from mlsanm_cli.io.run_file import RunFile
from mlsanm_cli.io.summary import EventLog, toml_text, write_interface_csv, write_json_atomic, write_toml
from mlsanm_cli.io.vtu import StateWriter, write_model, write_single
from mlsanm_cli.io.vtu_lines import LinesWriter
from mlsanm_cli.packing import packed
from mlsanm_cli.solve.checkpoint import BEGINNING, Start
from mlsanm_cli.solve.condensed_scene import CondensedScene
from mlsanm_cli.solve.fields import Fields, fields_of
from mlsanm_cli.solve.recorded import CLOUDS, PATH, Earlier, Recorded
from mlsanm_cli.solve.state import PathStep, Polish, State

NOTICED = 2.0
"""Seconds after which the rest of a path is estimated: before, nobody waits."""

NAMED = 2
"""Loads by which a stage is called."""

Saved = tuple[float, dict[str, dict[str, FloatArray]], dict[str, float]]
"""Position, fields by body and name, and attributes of a saved state."""


class Recorder:
    """Writes run.h5, events.jsonl, VTU and CSV files; use as a context manager.

    With ``earlier`` it goes on with the files of an earlier process, behind the last step in them.
    """

    def __init__(
        self,
        directory: Path,
        loaded: LoadedCase,
        attributes: Mapping[str, str | int | float],
        clock: Clock,
        console: Console,
        *,
        earlier: Earlier | None = None,
    ) -> None:
        self.directory = directory
        self._case = loaded.case
        self._clock = clock
        self._console = console
        with clock.phase("output"):
            resolved = resolved_mapping(loaded.case)
            self._file = _open(directory / run_dir.RUN_FILE, attributes, earlier)
            try:
                self._file.write_case(loaded.raw, toml_text(resolved))
                self._file.commit()
                self._events = EventLog(directory / run_dir.EVENTS_FILE)
                if earlier is not None:
                    before = earlier.recorded.rows - 1 if earlier.recorded else 0
                    self._events.write("resume", steps=before)
                else:
                    start = {"case": str(loaded.path), "case_hash": loaded.case_hash}
                    self._events.write("start", **start, threads=attributes.get("threads", 1))
                write_toml(directory / run_dir.RESOLVED_FILE, resolved)
            except BaseException:
                # HDF5 must not outlive the interpreter that its file is written through.
                self._file.close()
                raise
        self._states, self._lines = StateWriter(directory), LinesWriter(directory)
        # The clock of /path/seconds goes on where it stood.
        self._started = time.monotonic() - (earlier.seconds if earlier else 0.0)
        self._earlier = earlier.recorded if earlier else None
        self._pace: tuple[float, float] | None = None
        self._rows = 0
        self._saved = 0
        self._told: list[str] = []
        self.last: State | None = None
        self.iterations = self.factorizations = self.solves = 0
        self.residual = 0.0
        self.linear_residual: float | None = None
        self.warnings: list[str] = []
        self.cone: dict[str, float] = {}
        self.polished: list[Polish] = []
        self._mapped = False
        self._starts: Mapping[str, FloatArray] = {}
        self.judged: State | None = None
        self.energies: EnergyVerdict | None = None
        self.stressed: tuple[State, Mapping[str, Fields]] | None = None
        self.failed_at: dict[str, Any] = {}

    @property
    def steps(self) -> int:
        """Finished steps; the state at the start is none."""
        return max(self._rows - 1, 0)

    def start(self, adapted: Adapted) -> Start:
        """Store the model; where its path begins, or goes on."""
        built, self._starts = adapted.built, adapted.accuracy.solutions
        with self._clock.phase("output"):
            recording.write_model(self._file, built)
            self._file.confirm_attribute("cache_hash", recording.operators_digest(built))
            nodes = sum(len(body.model.cloud.points) for body in built.scene.bodies.values())
            self._file.confirm_attribute("nodes", str(nodes))
            if adapted.refined:
                self._file.write_checkpoint(CLOUDS, packed(adapted.refinement))
            self._file.commit()
            return self._take_up(built, self._earlier) if self._earlier else BEGINNING

    def _take_up(self, built: CondensedScene, before: Recorded) -> Start:
        """Go on behind what is recorded."""
        self._tell(before)
        self.last, self._rows = before.last, before.rows
        self.iterations, self.factorizations, self.solves = (
            before.iterations,
            before.factorizations,
            before.solves,
        )
        self.residual, self.linear_residual = before.residual, before.linear_residual
        self.cone, self.polished = dict(before.cone), list(before.polished)
        self.warnings += before.warnings
        self._told += before.warnings
        self._saved = before.saved
        if self._case.output.vtu:
            for position in self._file.saved_positions():
                self._states.keep(position, tuple(built.scene.bodies))
                self._lines.keep(position)
        return before.start

    def step(self, built: CondensedScene, step: PathStep) -> None:
        """Store one finished step, all at once: its series, its row, the fields wanted within it, and what
        the run goes on from."""
        state, index = step.state, self._rows
        with self._clock.phase("output"):
            # All that takes long comes first: signals wait while the file is written.
            row = recording.step_record(built, step, time.monotonic() - self._started)
            saved = self._saved_fields(built, step.saved) if self._case.output.fields else []
            self._count(built, step)
            recorded = self._recorded(step)
            content = packed(recorded)
            with self._file.together():
                if step.series:
                    if not self._mapped:
                        recording.write_maps(self._file, built)
                        self._mapped = True
                    self._file.write_series(index, step.series, step.series_attributes)
                self._file.append_step(row)
                for one in saved:
                    self._file.write_fields(*one)
                self._file.write_checkpoint(PATH, content)
                self._file.commit()
            self._tell(recorded)
        peak = float(state.pressure.max(initial=0.0))
        told = self._progress(state.position)
        if len(state.pressure):
            told = [f"closed {int(state.closed.sum())}", f"peak pressure {peak:.6g}", *told]
        text = "  ".join(told).rstrip()
        self._console.step(index, state.position, state.residual, text)

    def _progress(self, position: float) -> list[str]:
        """How far the path is, since when, and how long the rest takes if it goes on like this; nothing where
        nobody waits."""
        now, stages = time.monotonic(), len(self._case.stage)
        self._pace = self._pace or (now, position)
        begun, first = self._pace
        if now - begun < NOTICED or not first < position < stages:
            return []
        left = (now - begun) * (stages - position) / (position - first)
        number = math.floor(position)
        names = ", ".join(list(self._case.stage[number])[:NAMED])
        stage = f"stage {number + 1} of {stages} ({names}), " if stages > 1 else ""
        passed = self._clock.wall_seconds
        return [f"{stage}{100.0 * position / stages:.0f} %", f"{passed:.0f} s, {left:.0f} s left"]

    def _count(self, built: CondensedScene, step: PathStep) -> None:
        """Add a step, fields and all, to what is known of the path."""
        self.last = step.state
        self._rows += 1
        if self._case.output.fields:
            self._saved += len(step.saved)
        self.iterations += step.iterations
        self.factorizations += step.factorizations
        self.solves += step.solves
        states = (step.state, *step.saved)
        self.residual = max(self.residual, *(state.residual for state in states))
        for name in built.condensed.tangential:
            ratios = [recording.cone_ratio(built, name, state) for state in states]
            self.cone[name] = max(self.cone.get(name, 0.0), *ratios)
        if step.polish is not None:
            self.polished.append(step.polish)
        if step.warning:
            self._told.append(step.warning)
            self.warn(step.warning)

    def _tell(self, recorded: Recorded) -> None:
        """The event of the last step recorded, which a kill may have come before."""
        state = recorded.last
        self._events.write_once(
            "step",
            index=recorded.rows - 1,
            position=state.position,
            residual=state.residual,
            length=recorded.length,
        )

    def _recorded(self, step: PathStep) -> Recorded:
        return Recorded(
            last=step.state,
            length=step.length,
            rows=self._rows,
            saved=self._saved,
            iterations=self.iterations,
            factorizations=self.factorizations,
            solves=self.solves,
            residual=self.residual,
            linear_residual=self.linear_residual,
            cone=self.cone,
            polished=tuple(self.polished),
            warnings=tuple(self._told),
            mark=np.frombuffer(packed(step.mark), np.uint8),
        )

    def _saved_fields(self, built: CondensedScene, states: Sequence[State]) -> list[Saved]:
        """The fields wanted of states as run.h5 takes them; their VTU files are written."""
        wanted = tuple(dict.fromkeys(self._case.output.fields))
        stress = bool({"stress", "von_mises", "strain"} & set(wanted))
        saved: list[Saved] = []
        found = fields_of(built, states, stress, self._starts)
        for state, (fields, residual) in zip(states, found, strict=True):
            if stress:
                self.stressed = state, fields
            # Unlike max of Python, that of numpy loses no nan.
            self.linear_residual = float(np.maximum(self.linear_residual or 0.0, residual))
            shown = recording.shown_fields(built, state, fields, stress)
            clouds = {name: built.shown(name) for name in shown}
            self.judged = state
            self._judge_places(built, state, clouds, shown)
            if self._case.output.vtu:
                self._states.write(state.position, recording.vtu_states(clouds, shown, wanted))
                lines = contact_lines(built, state, shown), obstacle_lines(built, state)
                self._lines.write(state.position, *lines)
            kept = recording.stored_fields(shown, wanted)
            saved.append((state.position, kept, {"linear_residual": residual}))
        return saved

    def _judge_places(
        self,
        built: CondensedScene,
        state: State,
        clouds: Mapping[str, Cloud],
        fields: Mapping[str, Fields],
    ) -> None:
        """NumericalError where a body lies inside another one, a warning where one lies inside itself."""
        moved = {name: one.displacement for name, one in fields.items()}
        check_overlaps(built, state, clouds, moved)
        for name, message in large_slides(built, state, clouds, moved):
            if not any(told.startswith(f"the sides of contact {name} slide") for told in self._told):
                self._told.append(message)
                self.warn(message)
        for name, (x, y) in within_themselves(clouds, moved).items():
            text = f"body {name} lies inside itself"
            if not any(told.startswith(text) for told in self._told):
                message = (
                    f"{text} near ({x:.6g}, {y:.6g}) from position {state.position:.6g} on: contact of a "
                    f"body with itself is not there yet, and results beyond that mean nothing"
                )
                self._told.append(message)
                self.warn(message)

    def check_linear(self, built: CondensedScene) -> float:
        """How well the linear systems are solved over the saved states, or in the last if none was saved,
        which is then looked at for overlaps."""
        if self.linear_residual is None and self.last is not None:
            fields, self.linear_residual = fields_of(built, [self.last], stress=False, starts=self._starts)[0]
            clouds = {name: body.model.cloud for name, body in built.scene.bodies.items()}
            check_overlaps(built, self.last, clouds, {name: one.displacement for name, one in fields.items()})
        return self.linear_residual or 0.0

    def warn(self, message: str) -> None:
        """A warning on the console, in the events and in the summary."""
        self.warnings.append(message)
        self._events.write_once("warning", message=message)
        self._console.warning(message)

    def failure(self, error: NumericalError, prepared: SceneModel, built: CondensedScene | None) -> None:
        """Tell of a failure, and write failure.vtu: the state that was judged last, or the model if none was.

        That state is the last good one where the path itself broke off, or where the other has no numbers.
        """
        path = self.directory / run_dir.FAILURE_FILE
        state = self.judged if self.judged is not None and self.judged.is_finite else self.last
        told: dict[str, Any] = {"reason": error.message, "hint": error.hint}
        with self._clock.phase("output"):
            if built is None or state is None:
                write_model(path, model_bodies(prepared))
            else:
                found = diagnose(built, state)
                self.failed_at = {"position": state.position, "worst_nodes": worst_nodes(built, found)}
                fields, _ = fields_of(built, [state], stress=True)[0]
                clouds = {name: body.model.cloud for name, body in built.scene.bodies.items()}
                bodies = recording.vtu_states(clouds, fields, ("displacement", "stress", "von_mises"))
                if len(found.residual):
                    more = node_fields(built, found)
                    bodies = {name: replace(body, more=more[name]) for name, body in bodies.items()}
                write_single(path, bodies)
            self._events.write("failure", **told, **self.failed_at)

    def interfaces(self, built: CondensedScene) -> None:
        """Write the path, and every contact's final state, as CSV."""
        if self.last is None:
            return
        with self._clock.phase("output"):
            write_path_csv(self.directory / run_dir.PATH_FILE, self._file.path_table())
            for pairing in built.condensed.reported:
                columns = recording.interface_columns(built, pairing, self.last)
                name = run_dir.interface_name(pairing.name, len(built.condensed.reported))
                write_interface_csv(self.directory / name, {k: np.asarray(v) for k, v in columns.items()})

    def finish(self, summary: Mapping[str, Any]) -> None:
        """Close everything; summary.json comes last, so that its presence means the run is over."""
        self._states.finish()
        self._events.write("end", status=summary["status"], reason=summary["stop_reason"])
        self._file.set_status(str(summary["status"]))
        self.close()
        write_json_atomic(self.directory / run_dir.SUMMARY_FILE, summary)

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


def _open(path: Path, attributes: Mapping[str, str | int | float], earlier: Earlier | None) -> RunFile:
    """run.h5, a new one or that of an earlier process."""
    if earlier is None:
        return RunFile.create(path, attributes)
    before = earlier.recorded
    return RunFile.reopen(path, attributes, *((before.rows, before.saved) if before else (0, 0)))
