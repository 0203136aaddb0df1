"""``mlsanm run`` of a case at finite strain, and warnings of its last state."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np

from mlsanm_cli.app.checks.quality import Quality, announce
from mlsanm_cli.app.context import Clock, RunContext
from mlsanm_cli.app.finite.checks import FiniteEnd, checks_of, finite_limits
from mlsanm_cli.app.finite.contact_path import contact_path
from mlsanm_cli.app.finite.estimate import missing_figures
from mlsanm_cli.app.finite.fields import (
    SceneForces,
    contact_summary,
    extremes,
    plates_turned,
    probe_records,
    resultants,
)
from mlsanm_cli.app.finite.path import finite_path
from mlsanm_cli.app.finite.recorder import FiniteRecorder
from mlsanm_cli.app.finite.refinement import Refinement, contact_errors, refined
from mlsanm_cli.app.finite.scene import FiniteScene, finite_scene
from mlsanm_cli.app.output.checkpoint import interrupted_run
from mlsanm_cli.app.output.summary import Ending, head, probe_figures, tail
from mlsanm_cli.app.scene.assemble import SceneModel
from mlsanm_cli.app.scene.build import place
from mlsanm_cli.case import LoadedCase
from mlsanm_cli.errors import NumericalError
from mlsanm_cli.io import run_dir
from mlsanm_cli.io.run_reader import RunOrigin


def run_finite(
    loaded: LoadedCase,
    prepared: SceneModel,
    directory: Path,
    provenance: Mapping[str, str | int | float],
    context: RunContext,
    origin: RunOrigin | None = None,
) -> Mapping[str, Any]:
    """Follow the path and write the run directory, or continue the run ``origin``; returns the content of
    summary.json."""
    case, earlier = loaded.case, interrupted_run(origin) if origin is not None else None
    refinement = Refinement.read(earlier.figures) if earlier else Refinement()
    if len(refinement.zones):
        prepared = place(case, context, refinement.asked)
    while True:
        with context.phase("operators"):
            scene = finite_scene(case, prepared)
        with FiniteRecorder(directory, loaded, provenance, context, refinement, earlier) as recorder:
            quality = announce(case, prepared, context, recorder.verdicts)
            failure, stop = _followed(scene, recorder, context)
            finer = None
            if stop is None:
                finer = refined(scene, recorder.touched, refinement, failure, context)
            if finer is None:
                errors = _errors(scene, recorder, context.clock)
                ending = _ending(scene, recorder, context, errors, failure, stop)
                summary = _summary(scene, recorder, ending, quality, context.clock, errors)
                recorder.finish(summary)
                return summary
        refinement, prepared = finer
        earlier = None
        run_dir.prepare(directory, force=True)
        context.console.note("repeating the run with finer nodes in contact")


def _followed(
    scene: FiniteScene, recorder: FiniteRecorder, context: RunContext
) -> tuple[NumericalError | None, KeyboardInterrupt | None]:
    """Follow the path; returns the error or the interrupt that ended it, if any."""
    try:
        checkpoint = recorder.start(scene)
        context.stop_gently()
        steps = contact_path(scene, checkpoint) if scene.in_increments else finite_path(scene, checkpoint)
        while True:
            context.check_stop()
            with context.phase("continuation"):
                step = next(steps, None)
            if step is None:
                return None, None
            recorder.step(scene, step)
    except NumericalError as error:
        return error, None
    except KeyboardInterrupt as stop:
        return None, stop


def _ending(
    scene: FiniteScene,
    recorder: FiniteRecorder,
    context: RunContext,
    errors: Mapping[str, Any],
    failure: NumericalError | None,
    stop: KeyboardInterrupt | None,
) -> Ending:
    """The end of the path."""
    if stop is not None:
        ending = Ending("stopped", str(stop), f"continue with: {run_dir.resume_command(recorder.directory)}")
        context.console.note(ending.hint)
        return ending
    try:
        if failure is not None:
            raise failure
        assert recorder.last is not None
        waves = extremes(scene, recorder.last)["ellipticity"]
        recorder.verdicts.judge(checks_of(FiniteEnd(scene, recorder, recorder.last, waves, errors)))
    except NumericalError as error:
        context.console.warning(error.advice)
        recorder.failure(error, scene)
        return Ending("failed", error.message, error.hint)
    return Ending("done", "end of the last stage")


def _errors(scene: FiniteScene, recorder: FiniteRecorder, clock: Clock) -> dict[str, Any]:
    """Estimated errors of the last state; of displacements None where the clouds are too small for one."""
    missing: dict[str, Any] = {"displacement": None}
    if recorder.missed is not None and recorder.last is not None:
        with clock.phase("estimate"), suppress(NumericalError, np.linalg.LinAlgError):
            missing = missing_figures(scene, recorder.last, recorder.missed())
    found, forces = {"energy": recorder.estimate} | missing, missing.get("contacts", {})
    for name, error in contact_errors(recorder.refinement, recorder.touched).items():
        forces[name] = max(error, forces.get(name, 0.0))
    return found | ({"contacts": forces} if forces else {})


def _summary(
    scene: FiniteScene,
    recorder: FiniteRecorder,
    ending: Ending,
    quality: Quality,
    clock: Clock,
    errors: Mapping[str, Any],
) -> dict[str, Any]:
    """Content of summary.json for the completed part of the path."""
    state, nodes = recorder.last, scene.unknowns // 2
    summary = head(ending, recorder, recorder.steps, state.position if state else None)
    if ending.hint:
        summary["hint"] = ending.hint
    summary |= {"nodes": nodes, "unknowns": 2 * nodes, "contact_unknowns": 0, "contacts": {}}
    summary |= {"residual": recorder.residual}
    if state is not None:
        forces = SceneForces.of(scene, state)
        summary["contact_unknowns"] = len(state.pressure)
        summary["contacts"] = contact_summary(scene, state, forces)
        summary["forces"] = {name: force.tolist() for name, force in resultants(scene, forces).items()}
        if scene.probes:
            summary["probes"] = {
                name: probe_figures(seen) for name, seen in probe_records(scene, state).items()
            }
        if turned := plates_turned(scene, state):
            summary["plates"] = turned
        summary["force_balance"] = recorder.balance
        if np.isfinite(recorder.stability):
            summary["stability"] = recorder.stability
        summary["error_estimate"] = errors
        summary["energy_error"] = recorder.energy_error
        summary["finite_strain"] = {
            "law": ", ".join(dict.fromkeys(body.law.kind for body in scene.bodies.values())),
            **extremes(scene, state),
            "equations_renewed": recorder.renewed,
            "limit_points": [
                {"position": position, "kind": "maximum" if highest else "minimum"}
                for position, highest in recorder.turns
            ],
        }
    limits = finite_limits(scene, "stability" in summary)
    return summary | tail(recorder, quality, limits, clock)
