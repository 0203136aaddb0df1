"""``mlsanm run`` of a case at finite strain."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from mlsanm_cli.app.assessment.checks import BALANCE_LIMIT
from mlsanm_cli.app.assessment.quality import Quality, announce
from mlsanm_cli.app.clock import Clock
from mlsanm_cli.app.context import RunContext
from mlsanm_cli.app.finite.checkpoint import interrupted_run
from mlsanm_cli.app.finite.contact_path import contact_path
from mlsanm_cli.app.finite.end import few_nodes, held_at_points
from mlsanm_cli.app.finite.estimate import ESTIMATE_WARNING, EnergyError, check_work
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
from mlsanm_cli.app.finite.verdict import ELLIPTICITY_WARNING
from mlsanm_cli.app.output.summary import Ending, head, probe_figures
from mlsanm_cli.app.scene.assemble import SceneModel
from mlsanm_cli.app.scene.build import place
from mlsanm_cli.case import LoadedCase
from mlsanm_cli.errors import NumericalError
from mlsanm_cli.io import run_dir
from mlsanm_cli.io.run_reader import RunOrigin
from mlsanm_cli.solve.coercivity import CONTACT_LIMIT
from mlsanm_cli.system import peak_memory_mb


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
            quality = announce(case, prepared, context, recorder.warn)
            failure, stop = _followed(scene, recorder, context)
            finer = None
            if stop is None:
                finer = refined(scene, recorder.touched, refinement, failure, context)
            if finer is None:
                ending = _ending(scene, recorder, context, failure, stop)
                summary = _summary(scene, recorder, ending, quality, context.clock)
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
        mark = recorder.start(scene)
        context.stop_gently()
        steps = contact_path(scene, mark) if scene.in_increments else finite_path(scene, mark)
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
    failure: NumericalError | None,
    stop: KeyboardInterrupt | None,
) -> Ending:
    """The end of the path."""
    if stop is not None:
        ending = Ending("stopped", str(stop), f"continue with: mlsanm resume {recorder.directory}")
        context.console.note(ending.hint)
        return ending
    try:
        if failure is not None:
            raise failure
        _check_end(scene, recorder)
    except NumericalError as error:
        context.console.warning(f"{error.message}; {error.hint}" if error.hint else error.message)
        recorder.failure(error, scene)
        return Ending("failed", error.message, error.hint)
    return Ending("done", "end of the last stage")


def _check_end(scene: FiniteScene, recorder: FiniteRecorder) -> None:
    """Warn of an inaccurate last state. NumericalError if its forces are not balanced."""
    assert recorder.last is not None
    waves = extremes(scene, recorder.last)["ellipticity"]
    if waves < ELLIPTICITY_WARNING:
        recorder.warn(
            f"the law is close to losing ellipticity: acoustic tensor {waves:.2g} of the shear modulus"
        )
    if recorder.estimate > ESTIMATE_WARNING:
        kept = recorder.kept / recorder.energy
        recorder.warn(EnergyError.of(scene, recorder.last).warning(scene, recorder.estimate, kept))
    if text := check_work(scene, recorder.missing, recorder.energy_error):
        recorder.warn(text)
    for text in recorder.refinement.warnings:
        recorder.warn(text)
    if recorder.last.pressed is not None:
        for text in few_nodes(scene, recorder.last.pressed):
            recorder.warn(text)
    for text in held_at_points(scene, recorder.last):
        recorder.warn(text)
    # Reactions at single nodes are not known from the stress.
    single = any(body.elastic.held_nodes for body in scene.bodies.values())
    if recorder.balance > BALANCE_LIMIT and not single:
        raise NumericalError(
            f"force imbalance on a body: {100 * recorder.balance:.2g} % of the largest force",
            "make the spacing smaller",
        )


def _summary(
    scene: FiniteScene, recorder: FiniteRecorder, ending: Ending, quality: Quality, clock: Clock
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
        if state.pressed is not None:
            summary["contact_unknowns"] = len(state.pressed.pressure)
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
        summary["error_estimate"] = {"energy": recorder.estimate}
        if errors := contact_errors(recorder.refinement, recorder.touched):
            summary["error_estimate"]["contacts"] = errors
        summary["energy_error"] = recorder.energy_error
        summary["finite_strain"] = {
            "law": ", ".join(dict.fromkeys(body.law.kind for body in scene.bodies.values())),
            **extremes(scene, state),
            "equations_renewed": recorder.renewed,
            "limit_points": [
                {"position": turn.position, "kind": "maximum" if turn.maximum else "minimum"}
                for turn in recorder.turns
            ],
        }
    limits = {"residual": scene.case.solver.tolerance, "force_balance": BALANCE_LIMIT, "ellipticity": 0.0}
    limits["error_estimate"] = ESTIMATE_WARNING
    if "stability" in summary:
        limits["stability"] = CONTACT_LIMIT
    return summary | {
        "quality": quality.figures,
        "limits": limits,
        "seconds": clock.seconds,
        "wall_seconds": clock.wall_seconds,
        "peak_memory_mb": peak_memory_mb(),
        "warnings": recorder.warnings,
    }
