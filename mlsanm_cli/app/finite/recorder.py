"""The run directory of a run at finite strain: every finished step is on disk before the next one begins."""

from __future__ import annotations

import time
from collections.abc import Mapping
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import numpy as np

from mlsanm_cli.app.clock import Clock
from mlsanm_cli.app.console import Console
from mlsanm_cli.app.finite.fields import (
    FiniteFields,
    SceneForces,
    contact_records,
    fields_of,
    platen_displacements,
    probe_records,
    resultants,
    unloaded,
)
from mlsanm_cli.app.finite.path import FiniteState, FiniteStep, Turn
from mlsanm_cli.app.finite.scene import FiniteScene
from mlsanm_cli.app.output.recording import boundary_tags
from mlsanm_cli.case import LoadedCase, resolved_mapping
from mlsanm_cli.errors import NumericalError
from mlsanm_cli.io import run_dir
from mlsanm_cli.io.path_table import write_path_csv
from mlsanm_cli.io.records import StepRecord
from mlsanm_cli.io.run_file import RunFile
from mlsanm_cli.io.summary import EventLog, toml_text, write_json_atomic, write_toml
from mlsanm_cli.io.vtu import BodyState, StateWriter, write_single


class FiniteRecorder:
    """Writes run.h5, events.jsonl, VTU and CSV files; use as a context manager.

    ``steps`` counts finished ones; the state at the start is none.
    """

    def __init__(
        self,
        directory: Path,
        loaded: LoadedCase,
        attributes: Mapping[str, str | int | float],
        clock: Clock,
        console: Console,
    ) -> None:
        self.directory, self._clock, self._console = directory, clock, console
        resolved = resolved_mapping(loaded.case)
        self._file = RunFile.create(directory / run_dir.RUN_FILE, {**attributes, "strain": "finite"})
        try:
            self._file.write_case(loaded.raw, toml_text(resolved))
            self._file.commit()
            self._events = EventLog(directory / run_dir.EVENTS_FILE)
            start = {"case": str(loaded.path), "case_hash": loaded.case_hash}
            self._events.write("start", **start, threads=attributes.get("threads", 1))
            write_toml(directory / run_dir.RESOLVED_FILE, resolved)
        except BaseException:
            # HDF5 must not outlive the interpreter that its file is written through.
            self._file.close()
            raise
        self._states = StateWriter(directory)
        self._started = time.monotonic()
        self.steps = 0
        self.last: FiniteState | None = None
        self.iterations = self.factorizations = self.solves = self.renewed = 0
        self.residual = self.balance = self._largest = 0.0
        self.stability = float("inf")
        self.turns: list[Turn] = []
        self.warnings: list[str] = []

    def start(self, scene: FiniteScene) -> None:
        """Store the body, and begin the path."""
        with self._clock.phase("output"):
            for name, body in scene.bodies.items():
                cloud = body.elastic.model.cloud
                surfaces = cloud.surfaces.values()
                self._file.write_body(
                    name,
                    cloud.points,
                    np.concatenate([surface.index for surface in surfaces]),
                    np.concatenate([surface.normal for surface in surfaces]),
                    [surface.name for surface in surfaces for _ in surface.index],
                )
            nothing = scene.stages[0]
            for contact in scene.contacts:
                slave, normal = contact.slave, contact.start(nothing)
                self._file.write_contact(contact.name, slave.places, normal, slave.arc, slave.weight)
            forces = SceneForces.of(scene, unloaded(scene))
            moved = tuple(platen_displacements(scene, nothing))
            probes = tuple(probe.name for probe in scene.probes)
            self._file.start_path(scene.case.moved, tuple(resultants(scene, forces)), moved, probes)
            self._file.commit()

    def step(self, scene: FiniteScene, step: FiniteStep) -> None:
        """Store one finished step with the fields wanted within it."""
        state = step.state
        with self._clock.phase("output"):
            between = [one for one in step.saved if one is not state]
            rows = [self._row(scene, one, FiniteStep(one, order=step.order)) for one in between]
            rows.append(self._row(scene, state, step))
            fields = [(one, fields_of(scene, one)) for one in step.saved] if scene.case.output.fields else []
            with self._file.together():
                for row in rows:
                    self._file.append_step(row)
                for one, found in fields:
                    self._file.write_fields(one.position, _stored(scene, found))
                self._file.commit()
            for one, found in fields:
                if scene.case.output.vtu:
                    self._states.write(one.position, _shown(scene, found))
            self._events.write_once(
                "step",
                index=self.steps + bool(self.last),
                position=state.position,
                residual=state.residual,
                length=step.length,
            )
        self._count(scene, step)
        turned = [f"limit point {turn.position:.6g}" for turn in step.turns]
        text = "  ".join([*turned, *(["equations renewed"] if step.renewed else [])])
        self._console.step(self.steps, state.position, state.residual, text)

    def _row(self, scene: FiniteScene, state: FiniteState, step: FiniteStep) -> StepRecord:
        forces = SceneForces.of(scene, state)
        return StepRecord(
            position=state.position,
            step_length=step.length,
            residual=state.residual,
            order=step.order,
            factorizations=step.factorizations,
            solves=step.solves,
            seconds=time.monotonic() - self._started,
            factors=dict(zip(scene.case.moved, state.factors.tolist(), strict=True)),
            resultants=resultants(scene, forces),
            contacts=contact_records(scene, state),
            displacements=platen_displacements(scene, state.factors),
            probes=probe_records(scene, state),
        )

    def _count(self, scene: FiniteScene, step: FiniteStep) -> None:
        self.steps += self.last is not None
        self.last = step.state
        self.iterations += step.iterations
        self.factorizations += step.factorizations
        self.solves += step.solves
        self.renewed += step.renewed
        self.turns += step.turns
        self.stability = min(self.stability, step.state.stability)
        self.residual = max(self.residual, step.state.residual, *(one.residual for one in step.saved), 0.0)
        forces = SceneForces.of(scene, step.state)
        self._largest = max(self._largest, forces.size)
        self.balance = forces.rest / self._largest if self._largest else 0.0

    def warn(self, message: str) -> None:
        """A warning on the console, in the events and in the summary."""
        self.warnings.append(message)
        self._events.write_once("warning", message=message)
        self._console.warning(message)

    def failure(self, error: NumericalError, scene: FiniteScene) -> None:
        """Tell of a failure, and write the last good state as failure.vtu."""
        with self._clock.phase("output"):
            if self.last is not None:
                shown = _shown(scene, fields_of(scene, self.last))
                write_single(self.directory / run_dir.FAILURE_FILE, shown)
            self._events.write("failure", reason=error.message, hint=error.hint)

    def finish(self, summary: Mapping[str, Any]) -> None:
        """Close everything; summary.json comes last, so that its presence means the run is over."""
        if self.last is not None:
            write_path_csv(self.directory / run_dir.PATH_FILE, self._file.path_table())
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


def _stored(scene: FiniteScene, fields: Mapping[str, FiniteFields]) -> dict[str, dict[str, Any]]:
    """The fields asked for, as run.h5 takes them; with stresses the stretches and ratios of volumes."""
    wanted: list[str] = list(scene.case.output.fields)
    if "stress" in wanted:
        wanted += ["stretch", "volume_ratio"]
    return {body: {name: getattr(found, name) for name in wanted} for body, found in fields.items()}


def _shown(scene: FiniteScene, fields: Mapping[str, FiniteFields]) -> dict[str, BodyState]:
    """The same as VTU files take them."""
    return {name: _body_shown(scene, name, found) for name, found in fields.items()}


def _body_shown(scene: FiniteScene, name: str, fields: FiniteFields) -> BodyState:
    wanted, cloud = scene.case.output.fields, scene.bodies[name].elastic.model.cloud
    more = {
        "stretch_1": fields.stretch[:, 0],
        "stretch_2": fields.stretch[:, 1],
        "volume_ratio": fields.volume_ratio,
    }
    return BodyState(
        points=cloud.points,
        boundary_tag=boundary_tags(cloud),
        displacement=fields.displacement if "displacement" in wanted else None,
        stress=fields.stress if "stress" in wanted else None,
        von_mises=fields.von_mises if "von_mises" in wanted else None,
        stress_zz=fields.stress_zz if "stress" in wanted else None,
        more=more if "stress" in wanted else {},
    )
