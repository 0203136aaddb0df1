"""Writer of the run directory at finite strain; contact surfaces and obstacles as lines for ParaView."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from mlsanm_cli.app.context import RunContext
from mlsanm_cli.app.finite.estimate import EnergyError, missing_works
from mlsanm_cli.app.finite.fields import (
    FiniteFields,
    SceneForces,
    contact_records,
    fields_of,
    platen_displacements,
    probe_records,
    resultants,
    stretch_along,
)
from mlsanm_cli.app.finite.patches import Touched
from mlsanm_cli.app.finite.refinement import Refinement
from mlsanm_cli.app.finite.scene import FiniteScene
from mlsanm_cli.app.output.checkpoint import EarlierRun, plain_checkpoint
from mlsanm_cli.app.output.lines import contact_data, obstacles
from mlsanm_cli.app.output.recording import body_part, stored_fields, vtu_data
from mlsanm_cli.app.output.writer import RunWriter, body_datasets, contact_datasets
from mlsanm_cli.case import LoadedCase
from mlsanm_cli.contact.finite.rigid import RigidContact
from mlsanm_cli.errors import NumericalError
from mlsanm_cli.io import run_dir
from mlsanm_cli.io.records import row
from mlsanm_cli.io.run_file import Value
from mlsanm_cli.io.vtu import VtuPart, write_parts
from mlsanm_cli.mechanics.near_field import as_complex, as_real
from mlsanm_cli.roundoff import ROUND_OFF
from mlsanm_cli.solve.state import Checkpoint, PathStep, State


class FiniteRecorder(RunWriter):
    """Writes run.h5, events.jsonl, VTU and CSV files; use as a context manager. ``steps`` counts finished
    steps, without the initial state."""

    tallies = (
        *("steps", "renewed", "balance", "largest", "stability", "residual", "unaccounted", "kept"),
        *("missing", "energy", "iterations", "factorizations", "solves"),
    )

    def __init__(
        self,
        directory: Path,
        loaded: LoadedCase,
        attributes: Mapping[str, str | int | float],
        context: RunContext,
        refinement: Refinement,
        earlier: EarlierRun | None = None,
    ) -> None:
        attributes = {**attributes, "strain": "finite"}
        super().__init__(directory, loaded, attributes, context, earlier)
        self._earlier, self.refinement, self.touched = earlier, refinement, Touched()
        self.steps = self.renewed = 0
        self.last: State | None = None
        self.missed: Callable[[], Any] | None = None
        self.balance = self.largest = 0.0
        self.unaccounted = self.kept = self.energy = 0.0
        self.missing: dict[str, float] = {}
        self.stability = float("inf")
        self.turns: list[tuple[float, bool]] = []

    def start(self, scene: FiniteScene) -> Checkpoint | None:
        """Store bodies and contacts; returns the checkpoint to continue from, if there is one."""
        with self._clock.phase("output"):
            datasets: dict[str, Value] = {}
            for name, body in scene.bodies.items():
                model = body.elastic.model
                datasets |= body_datasets(name, model.cloud, model.settings.degree)
            for contact in scene.contacts.pairs:
                slave, sign = contact.slave, -1.0 if contact.exchanged else 1.0
                normal = sign * contact.start(scene.stages[0])
                datasets |= contact_datasets(contact.name, slave.places, normal, slave.arc, slave.weight)
            self._file.confirm(datasets)
            self._file.save_if_due()
            return self._take_up(scene, self._earlier) if self._earlier else None

    def _take_up(self, scene: FiniteScene, before: EarlierRun) -> Checkpoint | None:
        """Continue an earlier recording."""
        if before.checkpoint is None:
            return None
        self.last = before.checkpoint.state
        self.take_up(before.rows, before.figures, scene.bodies)
        self.turns += before.figures["turns"]
        self.warnings += before.figures["warnings"]
        self.touched = Touched.read(before.figures)
        return before.checkpoint

    def step(self, scene: FiniteScene, step: PathStep) -> None:
        """Store a finished step with the requested fields within it."""
        state = step.state
        with self._clock.phase("output"):
            between = [one for one in step.saved if one is not state]
            rows = [self._row(scene, one, PathStep(one, order=step.order)) for one in between]
            rows.append(self._row(scene, state, step))
            fields = [(one, fields_of(scene, one)) for one in step.saved] if scene.case.output.fields else []
            datasets: dict[str, Value] = {}
            wanted: list[str] = list(scene.case.output.fields)
            wanted += ["stretch", "volume_ratio"] if "stress" in wanted else []
            for one, found in fields:
                datasets |= stored_fields(self._saved, found, wanted)
                rows.append({"fields/position": one.position})
                self._saved += 1
                if scene.case.output.vtu:
                    self._states.write(one.position, _shown(scene, found))
                    self._lines.write(
                        one.position, contact_lines(scene, one, found), obstacle_lines(scene, one)
                    )
            self._count(scene, step)
            self._rows += 1 + len(between)
            figures = self.tallied()
            more = {"turns": self.turns.copy(), "warnings": list(self.warnings)}
            more |= {"refinement": self.refinement.plain, "touched": self.touched.plain}
            assert step.checkpoint is not None
            latest = partial(plain_checkpoint, state, step.checkpoint, figures | more)
            self.add_step(step, state, rows, datasets, {}, latest)
        turned = [f"limit point {position:.6g}" for position, _ in step.limit_points]
        text = "  ".join([*turned, *(["equations renewed"] if step.renewed else [])])
        self._console.step(self.steps, state.position, state.residual, text)

    def _row(self, scene: FiniteScene, state: State, step: PathStep) -> dict[str, Any]:
        forces = SceneForces.of(scene, state)
        return row(
            path=self.path_figures(step, state),
            factors=dict(zip(scene.case.moved, state.factors.tolist(), strict=True)),
            resultants=resultants(scene, forces),
            contacts=contact_records(scene, state),
            displacements=platen_displacements(scene, state),
            probes=probe_records(scene, state),
        )

    def _count(self, scene: FiniteScene, step: PathStep) -> None:
        self.steps += self.last is not None
        self.touched.add(scene, step)
        before, self.last, self.missed = self.last, step.state, step.missed
        self.count(step, [step.state.residual, *(one.residual for one in step.saved), 0.0])
        self.renewed += step.renewed
        self.turns += step.limit_points
        self.stability = min(self.stability, float(step.state.solver.get("stability", np.inf)))
        forces = SceneForces.of(scene, step.state)
        self.largest = max(self.largest, forces.size)
        # Rigid motion leaves round-off in the forces.
        stiffest = max(body.elastic.model.material.modulus for body in scene.bodies.values())
        tiny = ROUND_OFF * stiffest * float(np.abs(step.state.displacement).max())
        found = EnergyError.of(scene, step.state)
        self.kept = max(self.kept, abs(step.kept))
        self.unaccounted = max(self.unaccounted, found.total + abs(step.kept))
        if before is not None:
            for ends in pairwise((before, *step.way, step.state)):
                for name, one in missing_works(scene, *ends).items():
                    self.missing[name] = self.missing.get(name, 0.0) + one
        self.energy = max(self.energy, found.energy)
        self.balance = forces.rest / max(self.largest, tiny) if self.largest else 0.0

    @property
    def estimate(self) -> float:
        """Largest estimated error of the energy over the largest energy on the path."""
        return float(self.unaccounted / self.energy) if self.energy else 0.0

    @property
    def energy_error(self) -> float:
        """Internal less external work of the bodies over the largest energy."""
        return sum(map(abs, self.missing.values())) / (0.5 * self.energy) if self.energy else 0.0

    def failure(self, error: NumericalError, scene: FiniteScene) -> None:
        """Record a failure and write the last accepted state as failure.vtu."""
        self._console.phase("writing the failed state")
        with self._clock.phase("output"):
            if self.last is not None:
                shown = _shown(scene, fields_of(scene, self.last))
                write_parts(self.directory / run_dir.FAILURE_FILE, "body", list(shown.values()))
            self._events.write("failure", reason=error.message, hint=error.hint)

    def finish(self, summary: Mapping[str, Any]) -> None:
        """Close all files; summary.json is written last, so that its presence means the run has ended."""
        if self.last is not None:
            self.write_path()
        super().finish(summary)


def _shown(scene: FiniteScene, fields: Mapping[str, FiniteFields]) -> dict[str, VtuPart]:
    """The requested fields as VTU parts."""
    wanted, parts = scene.case.output.fields, {}
    for name, found in fields.items():
        data = vtu_data(found, wanted)
        if "stress" in wanted:
            data |= {"stretch_1": found.stretch[:, 0], "stretch_2": found.stretch[:, 1]}
            data["volume_ratio"] = found.volume_ratio
        parts[name] = body_part(scene.bodies[name].elastic.model.cloud, data)
    return parts


def contact_lines(scene: FiniteScene, state: State, fields: Mapping[str, FiniteFields]) -> dict[str, VtuPart]:
    """Slave sides of all contacts in a state with their pressures; stresses act on the slave of the case."""
    records, parts = contact_records(scene, state), scene.parts(state.displacement)
    lines = {}
    for contact, _, there in scene.contacts.each:
        record, side = records[contact.name], contact.slave
        moved = fields[side.body].displacement[side.nodes]
        turn, _ = side.turned(moved)
        sign = -1.0 if contact.exchanged else 1.0
        normal = -sign * as_real(as_complex(side.outward) * turn)
        stretch = stretch_along(scene, side, parts[side.body])
        stress = sign * state.side_traction[there].reshape(-1, 2)[: side.count] / stretch[:, None]
        numbers = np.arange(side.count, dtype=np.int64)
        edges = np.stack([numbers, np.roll(numbers, -1)], axis=1)
        edges = edges if side.around is not None else edges[:-1]
        data = contact_data(record, side.arc, bool(contact.friction))
        data |= {"displacement": moved, "normal": normal, "contact_stress": stress}
        lines[contact.name] = VtuPart(side.places, edges, data)
    return lines


def obstacle_lines(scene: FiniteScene, state: State) -> dict[str, VtuPart]:
    """Rigid obstacles in a state, by contact."""
    points = np.concatenate([body.elastic.model.nodes for body in scene.bodies.values()])
    drawn = obstacles(scene.case, points.min(axis=0), points.max(axis=0))
    lines = {}
    for contact in scene.contacts.pairs:
        if isinstance(contact, RigidContact):
            places, edges = drawn[contact.name]
            turned = (places - contact.pivot) @ contact.turn(state.driven).T
            moved = contact.pivot + contact.motion @ state.driven + turned - places
            lines[contact.name] = VtuPart(places, edges, {"displacement": moved})
    return lines
