"""Recording of a run in its directory."""

from __future__ import annotations

import math
import time
from collections.abc import Mapping, Sequence
from dataclasses import asdict, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from mlsanm_cli.app.checks.diagnosis import diagnose, node_fields, worst_nodes
from mlsanm_cli.app.checks.overlaps import check_overlaps, within_themselves
from mlsanm_cli.app.checks.peaks import Peak
from mlsanm_cli.app.checks.refinement import Adapted
from mlsanm_cli.app.checks.verdicts import EnergyVerdict
from mlsanm_cli.app.context import RunContext
from mlsanm_cli.app.output import recording
from mlsanm_cli.app.output.checkpoint import REFINEMENT, EarlierRun, as_text, plain_checkpoint
from mlsanm_cli.app.output.lines import contact_lines, large_slides, obstacle_lines
from mlsanm_cli.app.output.recording import Views, model_bodies
from mlsanm_cli.app.output.writer import RunWriter
from mlsanm_cli.app.scene.assemble import SceneModel
from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.case import LoadedCase
from mlsanm_cli.cloud.cloud import Cloud
from mlsanm_cli.errors import NumericalError
from mlsanm_cli.io import run_dir
from mlsanm_cli.io.records import place
from mlsanm_cli.io.run_file import Attribute, Value
from mlsanm_cli.io.summary import write_csv
from mlsanm_cli.io.vtu import write_parts
from mlsanm_cli.solve.condensed_scene import CondensedScene
from mlsanm_cli.solve.fields import Fields, fields_of
from mlsanm_cli.solve.state import Checkpoint, PathStep, State

ESTIMATE_AFTER = 2.0
"""Seconds after which the remaining time of a path is shown."""
MAX_STAGE_LOADS = 2
"""Largest number of loads in the name of a stage."""


class Recorder(RunWriter):
    """Writes run.h5, events.jsonl, VTU and CSV files; use as a context manager. With ``earlier`` it continues
    the files of an interrupted run after their last step."""

    tallies = ("iterations", "factorizations", "solves", "residual", "linear_residual", "cone")

    def __init__(
        self,
        directory: Path,
        loaded: LoadedCase,
        attributes: Mapping[str, str | int | float],
        context: RunContext,
        *,
        earlier: EarlierRun | None = None,
    ) -> None:
        super().__init__(directory, loaded, attributes, context, earlier)
        self._case = loaded.case
        self._earlier = earlier
        self._pace: tuple[float, float] | None = None
        self._reported: list[str] = []
        self.last: State | None = None
        self.linear_residual: float | None = None
        self.cone: dict[str, float] = {}
        self._mapped = False
        self._views = Views({}, {})
        self._starts: Mapping[str, FloatArray] = {}
        self.checked: State | None = None
        self.energies: EnergyVerdict | None = None
        self.peaks: Mapping[str, Peak] = {}
        self.stressed: tuple[State, Mapping[str, Fields]] | None = None
        self.failed_at: dict[str, Any] = {}

    @property
    def steps(self) -> int:
        """Number of finished steps, without the state at the start."""
        return max(self._rows - 1, 0)

    def start(self, adapted: Adapted) -> Checkpoint | None:
        """Stores the model; returns the checkpoint from which the path continues, None for a new path."""
        built, bodies = adapted.built, adapted.accuracy.bodies
        self._starts = {name: one.solution for name, one in bodies.items()}
        with self._clock.phase("output"):
            self._views = Views.of(built, self._memo)
            self._file.confirm(recording.model_datasets(built, self._views.clouds))
            nodes = sum(len(body.model.cloud.points) for body in built.scene.bodies.values())
            digest = recording.operators_digest(built)
            self._file.add(attributes={"": {"cache_hash": digest, "nodes": str(nodes)}})
            if adapted.refined:
                self._file.add(datasets={REFINEMENT: as_text(asdict(adapted.refinement))})
            self._file.save_if_due()
            return self._take_up(built, self._earlier) if self._earlier else None

    def _take_up(self, built: CondensedScene, before: EarlierRun) -> Checkpoint | None:
        """Restores the state of the recorder after the last recorded step."""
        if before.last is None:
            return None
        self.last = before.last
        self.take_up(before.rows, before.figures, built.scene.bodies)
        self._reported += before.figures["told"]
        self.warnings += self._reported
        return before.checkpoint

    def step(self, built: CondensedScene, step: PathStep) -> None:
        """Adds a finished step: its series, its row, the fields saved within it, and the checkpoint. All of
        it is written together, some time later."""
        state, index = step.state, self._rows
        with self._clock.phase("output"):
            rows = [recording.step_row(built, state, self.path_figures(step, state))]
            datasets: dict[str, Value] = {}
            attributes: dict[str, Mapping[str, Attribute]] = {}
            if step.series:
                if not self._mapped:
                    datasets |= recording.map_datasets(built)
                    self._mapped = True
                series = place("series", str(index))
                datasets |= {f"{series}/{name}": array for name, array in step.series.items()}
                attributes[series] = step.series_attributes
            if self._case.output.fields:
                self._save_fields(built, step.saved, rows, datasets, attributes)
            self._count(built, step)
            figures = self.tallied()
            more = {"told": tuple(self._reported)}
            latest = partial(plain_checkpoint, state, step.checkpoint, figures | more)
            self.add_step(step, state, rows, datasets, attributes, latest)
        peak = float(state.pressure.max(initial=0.0))
        texts = self._progress(state.position)
        if len(state.pressure):
            texts = [f"closed {int(state.closed.sum())}", f"peak pressure {peak:.6g}", *texts]
        text = "  ".join(texts).rstrip()
        self._console.step(index, state.position, state.residual, text)

    def _progress(self, position: float) -> list[str]:
        """Progress of the path, elapsed and estimated remaining time; empty during the first seconds."""
        now, stages = time.monotonic(), len(self._case.stage)
        self._pace = self._pace or (now, position)
        begun, first = self._pace
        if now - begun < ESTIMATE_AFTER or not first < position < stages:
            return []
        left = (now - begun) * (stages - position) / (position - first)
        number = math.floor(position)
        names = ", ".join(list(self._case.stage[number])[:MAX_STAGE_LOADS])
        stage = f"stage {number + 1} of {stages} ({names}), " if stages > 1 else ""
        passed = self._clock.wall_seconds
        return [f"{stage}{100.0 * position / stages:.0f} %", f"{passed:.0f} s, {left:.0f} s left"]

    def _count(self, built: CondensedScene, step: PathStep) -> None:
        """Adds a step to the totals of the path."""
        self.last = step.state
        self._rows += 1
        states = (step.state, *step.saved)
        self.count(step, [state.residual for state in states])
        for name in built.condensed.tangential:
            ratios = [recording.cone_ratio(built, name, state) for state in states]
            self.cone[name] = max(self.cone.get(name, 0.0), *ratios)
        if step.warning:
            self._reported.append(step.warning)
            self.warn(step.warning)

    def _save_fields(
        self,
        built: CondensedScene,
        states: Sequence[State],
        rows: list[dict[str, Any]],
        datasets: dict[str, Value],
        attributes: dict[str, Mapping[str, Attribute]],
    ) -> None:
        """Adds the fields of saved states to the additions of run.h5, and writes their VTU files."""
        wanted = tuple(dict.fromkeys(self._case.output.fields))
        stress = bool({"stress", "von_mises", "strain"} & set(wanted))
        found = fields_of(built, states, stress, self._starts)
        for state, (fields, residual) in zip(states, found, strict=True):
            if stress:
                self.stressed = state, fields
            # numpy's maximum, unlike max, propagates nan.
            self.linear_residual = float(np.maximum(self.linear_residual or 0.0, residual))
            shown = recording.shown_fields(built, self._views, state, fields, stress)
            clouds = self._views.clouds
            self.checked = state
            self._check_places(built, state, clouds, shown)
            if self._case.output.vtu:
                self._states.write(state.position, recording.vtu_states(clouds, shown, wanted))
                lines = contact_lines(built, state, clouds, shown), obstacle_lines(built, state)
                self._lines.write(state.position, *lines)
            datasets |= recording.stored_fields(self._saved, shown, wanted)
            rows.append({"fields/position": state.position})
            attributes[place("fields", str(self._saved))] = {"linear_residual": residual}
            self._saved += 1

    def _check_places(
        self, built: CondensedScene, state: State, clouds: Mapping[str, Cloud], fields: Mapping[str, Fields]
    ) -> None:
        """Raises NumericalError if bodies overlap; warns if a body overlaps itself or surfaces slide far."""
        moved = {name: one.displacement for name, one in fields.items()}
        check_overlaps(built, state, clouds, moved)
        found = dict(large_slides(built, state, clouds, moved))
        for name, (x, y) in within_themselves(clouds, moved).items():
            found[f"body {name} overlaps itself"] = (
                f" near ({x:.6g}, {y:.6g}) from position {state.position:.6g} on: self-contact is not "
                f"supported, and results beyond that position are invalid"
            )
        for fault, where in found.items():
            if not any(one.startswith(fault) for one in self._reported):
                self._reported.append(fault + where)
                self.warn(fault + where)

    def check_linear(self, built: CondensedScene) -> float:
        """The largest error of the linear solver over the saved states; of the last state if none was saved,
        which is then also checked for overlaps."""
        if self.linear_residual is None and self.last is not None:
            fields, self.linear_residual = fields_of(built, [self.last], stress=False, starts=self._starts)[0]
            clouds = {name: body.model.cloud for name, body in built.scene.bodies.items()}
            check_overlaps(built, self.last, clouds, {name: one.displacement for name, one in fields.items()})
        return self.linear_residual or 0.0

    def stress_fields(self, built: CondensedScene, state: State) -> Mapping[str, Fields]:
        """The fields of all bodies in a state with stresses; recomputed unless it was the last one saved."""
        if self.stressed is not None and self.stressed[0] is state:
            return self.stressed[1]
        return fields_of(built, [state], stress=True, starts=self._starts)[0][0]

    def failure(self, error: NumericalError, prepared: SceneModel, built: CondensedScene | None) -> None:
        """Records a failure, and writes failure.vtu: the state that was checked last, or the last good one if
        the path ended there or the other is not finite; the model if there is no state.
        """
        path = self.directory / run_dir.FAILURE_FILE
        state = self.checked if self.checked is not None and self.checked.is_finite else self.last
        texts: dict[str, Any] = {"reason": error.message, "hint": error.hint}
        self._console.phase("writing the failed state")
        with self._clock.phase("output"):
            if built is None or state is None:
                write_parts(path, "body", model_bodies(prepared))
            else:
                found = diagnose(built, state)
                self.failed_at = {"position": state.position, "worst_nodes": worst_nodes(built, found)}
                fields, _ = fields_of(built, [state], stress=True)[0]
                clouds = {name: body.model.cloud for name, body in built.scene.bodies.items()}
                bodies = recording.vtu_states(clouds, fields, ("displacement", "stress", "von_mises"))
                if len(found.residual):
                    more = node_fields(built, found)
                    bodies = {k: replace(body, data={**body.data, **more[k]}) for k, body in bodies.items()}
                write_parts(path, "body", list(bodies.values()))
            self._events.write("failure", **texts, **self.failed_at)

    def interfaces(self, built: CondensedScene) -> None:
        """Writes the path and the final state of every contact as CSV."""
        if self.last is None:
            return
        with self._clock.phase("output"):
            self.write_path()
            for pairing in built.condensed.reported:
                columns = recording.interface_columns(built, pairing, self.last)
                name = run_dir.interface_name(pairing.name, len(built.condensed.reported))
                write_csv(self.directory / name, columns)
