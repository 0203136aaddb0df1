"""``mlsanm run``: a case solved and written, with everything a reader needs to trust it."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from mlsanm_cli.app import recording
from mlsanm_cli.app.build import Built, build_scene, complete
from mlsanm_cli.app.clock import Clock, peak_memory_mb
from mlsanm_cli.app.console import Console
from mlsanm_cli.app.judge import force_balance, judge_balance, judge_state
from mlsanm_cli.app.paths import State, path_of
from mlsanm_cli.app.provenance import attributes
from mlsanm_cli.app.quality import Quality, assess
from mlsanm_cli.app.recorder import Recorder
from mlsanm_cli.app.references import check_reference, reference_profile
from mlsanm_cli.case import load_case
from mlsanm_cli.errors import NumericalError
from mlsanm_cli.io import run_dir

RESULTS = Path("results")


def run(
    case_path: Path,
    *,
    overrides: tuple[str, ...] = (),
    out: Path | None = None,
    force: bool = False,
    threads: int = 1,
    console: Console,
    argv: tuple[str, ...] = (),
) -> Mapping[str, Any]:
    """Solve a case and write its run directory.

    Returns the mapping of summary.json with the ``directory`` added. A run whose numbers cannot be believed
    comes back with status "failed", one that was interrupted with "stopped"; both keep what was done. Raises
    CaseError or RunError, with nothing written, for a case that cannot be run.
    """
    clock = Clock()
    loaded = load_case(case_path, overrides)
    check_reference(loaded)
    directory = out or RESULTS / case_path.stem
    run_dir.check(directory, force)
    prepared = build_scene(loaded, clock, console)
    with clock.phase("cloud"):
        quality = assess(prepared)
    run_dir.prepare(directory, force)
    built: Built | None = None
    status, reason, hint = "done", "end of the last stage", ""
    with Recorder(directory, loaded, attributes(loaded, argv, threads), clock, console) as recorder:
        try:
            for note in prepared.notes:
                console.note(note)
            for warning in quality.warnings:
                recorder.warn(warning)
            built = complete(loaded.case, prepared, clock, console)
            recorder.start(built)
            _follow(built, recorder, clock)
        except NumericalError as error:
            status, reason, hint = "failed", error.message, error.hint
            console.warning(f"{error.message}; {error.hint}" if error.hint else error.message)
            recorder.failure(built)
        except KeyboardInterrupt:
            status, reason = "stopped", "stopped by a signal"
        if built is not None:
            recorder.interfaces(built)
        summary = _summary(built, quality, recorder, clock, status, reason, hint)
        recorder.finish(summary)
    return {**summary, "directory": str(directory)}


def _follow(built: Built, recorder: Recorder, clock: Clock) -> None:
    """Go along the path; raises NumericalError as soon as a state cannot be believed."""
    steps = path_of(built)
    while True:
        with clock.phase("continuation"):
            step = next(steps, None)
        if step is None:
            break
        for state in (step.state, *step.saved):
            judge_state(built, state)
        recorder.step(built, step)
    assert recorder.last is not None
    warning = judge_balance(force_balance(built, recorder.last))
    if warning:
        recorder.warn(warning)


def _summary(
    built: Built | None,
    quality: Quality,
    recorder: Recorder,
    clock: Clock,
    status: str,
    reason: str,
    hint: str,
) -> dict[str, Any]:
    """The content of summary.json, as far as the run came."""
    state = recorder.last
    summary: dict[str, Any] = {
        "status": status,
        "stop_reason": reason,
        "position": state.position if state else None,
        "steps": recorder.steps,
        "factorizations": recorder.factorizations,
        "solves": recorder.solves,
    }
    if hint:
        summary["hint"] = hint
    if built is not None:
        bodies = built.scene.bodies
        nodes = sum(len(body.model.cloud.points) for body in bodies.values())
        summary |= {
            "nodes": nodes,
            "unknowns": 2 * nodes,
            "contact_unknowns": len(built.condensed.weight),
            "elastic_factorizations": len(bodies),
            "condensation_solves": built.condensed.solves,
            "enlarged_stencils": sum(body.model.stencils.enlarged for body in bodies.values()),
        }
    summary["contacts"] = {}
    summary["residual"] = recorder.residual
    summary["linear_residual"] = recorder.linear_residual
    if built is not None and state is not None:
        verdict = force_balance(built, state)
        summary["contacts"] = {p.name: _contact(built, p.name, state) for p in built.condensed.pairings}
        arguments = (state.factors, state.motion, state.pressure)
        summary["forces"] = {name: f(*arguments).tolist() for name, f in built.condensed.forces.items()}
        summary["force_balance"] = verdict.force_balance
        summary["force_balance_bodies"] = dict(verdict.bodies)
    summary["stability"] = built.condensed.stability if built is not None else None
    summary["quality"] = quality.figures
    summary["seconds"] = clock.seconds
    summary["peak_memory_mb"] = peak_memory_mb()
    summary["warnings"] = recorder.warnings
    return summary


def _contact(built: Built, name: str, state: State) -> dict[str, Any]:
    """A contact's figures, with the reference's beside them where the case names one."""
    pairing = next(p for p in built.condensed.pairings if p.name == name)
    figures = recording.contact_summary(built, pairing, state)
    profile = reference_profile(built, pairing, state)
    if profile is not None:
        figures["reference"] = {
            "solution": built.case.reference.solution if built.case.reference else None,
            "peak_pressure": profile.peak,
            "half_width": profile.half_width,
            "pressure_error_l2": profile.error_l2,
        }
    return figures
