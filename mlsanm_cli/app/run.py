"""``mlsanm run``: a case solved and written, with everything a reader needs to trust it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

from mlsanm_cli.app.checks.end_state import (
    check_held,
    check_limit,
    check_rolling,
    end_warnings,
    idle_note,
    overlap_warnings,
    tip_warnings,
)
from mlsanm_cli.app.checks.energy import energy_error
from mlsanm_cli.app.checks.peaks import boundary_peaks, check_peaks
from mlsanm_cli.app.checks.quality import Warn, announce, assess, factor_notes, nodal_warnings
from mlsanm_cli.app.checks.references import check_reference
from mlsanm_cli.app.checks.refinement import Adapted, Refinement, adapt, refine_again
from mlsanm_cli.app.checks.verdicts import (
    check_balance,
    check_energy,
    check_estimates,
    check_linear,
    check_open,
    check_points,
    check_spacing,
    check_state,
    check_transfer,
    force_balance,
)
from mlsanm_cli.app.context import Clock, Console, RunContext, Stopper
from mlsanm_cli.app.output.recorder import Recorder
from mlsanm_cli.app.output.summary import Ending, summarise
from mlsanm_cli.app.output.writer import attributes
from mlsanm_cli.app.results.info import finished
from mlsanm_cli.app.scene.assemble import SceneModel
from mlsanm_cli.app.scene.build import build_scene
from mlsanm_cli.app.scene.causes import strain_warnings
from mlsanm_cli.app.scene.imported import geometry_inspector
from mlsanm_cli.case import Case, Stop, load_case
from mlsanm_cli.contact.laws.limit_load import SlidingError
from mlsanm_cli.errors import NumericalError, UnfinishedError, UnstableError, WriteError
from mlsanm_cli.io import run_dir
from mlsanm_cli.io.lock import locked
from mlsanm_cli.memo import NO_CACHE, Memo
from mlsanm_cli.solve.condensed_scene import CondensedScene
from mlsanm_cli.solve.limit_loads import at_limit
from mlsanm_cli.solve.paths import path_of
from mlsanm_cli.solve.state import Checkpoint, State
from mlsanm_cli.solve.stop_events import StoppedPath

RESULTS = Path("results")


def run(
    case_path: Path,
    *,
    overrides: tuple[str, ...] = (),
    out: Path | None = None,
    force: bool = False,
    threads: int = 1,
    max_wall: float | None = None,
    console: Console,
    argv: tuple[str, ...] = (),
    skip_done: bool = False,
    memo: Memo = NO_CACHE,
) -> Mapping[str, Any]:
    """Solves a case and writes its run directory.

    ``memo`` keeps results for other runs of the process. With ``skip_done`` a completed run of this case in
    the directory is not repeated; its summary is returned with ``skipped``.

    Returns the mapping of summary.json with the ``directory`` added. The status of a run whose results are
    not reliable is "failed", that of one interrupted, or not finished after ``max_wall`` seconds, "stopped";
    completed steps of both are kept. Raises CaseError or RunError, with nothing written, for a case that
    cannot be run, UnfinishedError for a run whose disk is full, and KeyboardInterrupt if stopped before the
    run began.
    """
    with Stopper(max_wall) as stopper:
        context = RunContext(Clock(), console, memo, stopper)
        loaded = load_case(case_path, overrides, geometry_inspector)
        check_reference(loaded)
        directory = out or RESULTS / case_path.stem
        before = finished(directory, loaded.case_hash) if skip_done else None
        if before is not None:
            return {**before, "directory": str(directory), "skipped": True}
        run_dir.check(directory, force)
        prepared = build_scene(loaded, context)
        with locked(directory):
            run_dir.prepare(directory, force)
            provenance = attributes(loaded, argv, threads)
            if loaded.case.model.strain == "finite":
                from mlsanm_cli.app.finite.run import run_finite

                with resumable(directory):
                    found = run_finite(loaded, prepared, directory, provenance, context)
                return {**found, "directory": str(directory)}
            recorder = Recorder(directory, loaded, provenance, context)
            with resumable(directory), recorder:
                summary = carry_out(loaded.case, prepared, recorder, context)
    return {**summary, "directory": str(directory)}


def set_up(
    case: Case, prepared: SceneModel, context: RunContext, warn: Warn, refinement: Refinement | None = None
) -> Adapted:
    """Condenses the scene, refined as the case requires or by a ``refinement`` found before. Raises
    NumericalError for a scene that cannot be set up."""
    if refinement is None:
        adapted = adapt(case, prepared, context)
    else:
        adapted = refine_again(case, refinement, context)
    nodal = [pairing for pairing in adapted.built.condensed.pairings if pairing.grid is None]
    if adapted.refinement.failed:
        warn(adapted.refinement.failed)
    for warning in nodal_warnings(adapted.prepared, nodal, adapted.prepared.models):
        warn(warning)
    return adapted


@contextmanager
def resumable(directory: Path) -> Iterator[None]:
    """A block in which a WriteError becomes an UnfinishedError: the run can be resumed."""
    try:
        yield
    except WriteError as error:
        raise UnfinishedError(
            error.message, f"make room, then: {run_dir.resume_command(directory)}"
        ) from error


def carry_out(
    case: Case,
    prepared: SceneModel,
    recorder: Recorder,
    context: RunContext,
    refinement: Refinement | None = None,
) -> Mapping[str, Any]:
    """Refines and follows a scene whose recorder is open until it is done, failed or stopped; returns the
    summary. ``refinement`` is that of an earlier process."""
    built: CondensedScene | None = None
    adapted: Adapted | None = None
    ending = Ending("done", "end of the last stage")
    quality = announce(case, prepared, context, recorder.warn)
    try:
        adapted = set_up(case, prepared, context, recorder.warn, refinement)
        built = adapted.built
        if adapted.refined:
            quality = assess(case, adapted.prepared, context.memo)
            for warning in quality.warnings:
                recorder.warn(warning)
        quality = replace(quality, models={name: body.model for name, body in built.scene.bodies.items()})
        context.stop_gently()
        reached = _follow(built, recorder.start(adapted), recorder, context)
        if reached is not None and recorder.last is not None:
            at = f"at position {recorder.last.position:.9g}"
            ending = Ending("done", f"{reached.description}, {at}", stopped_by=reached.description)
        if recorder.last is not None and len(built.condensed.friction_nodes):
            from mlsanm_cli.app.checks.friction_accuracy import with_friction

            with context.phase("estimate"):
                accuracy = with_friction(built, adapted.accuracy, recorder.last, context.memo)
            adapted = replace(adapted, accuracy=accuracy)
        adapted = replace(adapted, accuracy=adapted.accuracy.with_energies(recorder.energies))
        estimates = adapted.accuracy.figures(built, recorder.last)
        for warning in check_estimates(built, estimates, adapted.accuracy.missing):
            recorder.warn(warning)
    except NumericalError as error:
        stability = error.stability if isinstance(error, UnstableError) else None
        ending = Ending("failed", error.message, error.hint, stability)
        context.console.warning(error.advice)
        recorder.failure(error, adapted.prepared if adapted else prepared, built)
    except KeyboardInterrupt as stop:
        ending = Ending("stopped", str(stop), f"continue with: {run_dir.resume_command(recorder.directory)}")
        context.console.note(ending.hint)
    if built is not None:
        recorder.interfaces(built)
        for note in factor_notes(built.scene):
            context.console.note(note)
    summary = summarise(case, ending, adapted, quality, recorder, context.clock) | {
        "cache": context.memo.figures
    }
    recorder.finish(summary)
    return summary


def _follow(
    built: CondensedScene, start: Checkpoint | None, recorder: Recorder, context: RunContext
) -> Stop | None:
    """Follows the path; returns the stop condition of the case that ended it early, if any. Raises
    NumericalError as soon as a state is not reliable."""
    path = StoppedPath(built, start, recorder.last, path_of)
    steps, first = path.steps(), None
    while True:
        context.check_stop()
        with context.phase("continuation"):
            try:
                step = next(steps, None)
                for state in (*step.saved, step.state) if step is not None else ():
                    check_rolling(built, state)
            except NumericalError as error:
                last = 0.0
                if recorder.last is not None:
                    last = recorder.last.position
                    if isinstance(error, SlidingError) and (warning := check_limit(built, recorder.last)):
                        recorder.warn(warning)
                raise at_limit(built.scene, built.condensed, built.stages, last, error) from error
        if step is None:
            break
        for state in (*step.saved, step.state):
            recorder.checked = state
            check_state(built, state)
        recorder.step(built, step)
        first = first or step.state
    assert recorder.last is not None
    with context.phase("output"):
        linear = recorder.check_linear(built)
    check_linear(linear)
    check_spacing(built, recorder.last)
    with context.phase("output"):
        fields = recorder.stress_fields(built, recorder.last)
        recorder.energies = energy_error(built, recorder.last, fields)
        recorder.peaks = boundary_peaks(built, recorder.last, fields)
    for warning in _warnings(built, first, recorder):
        if warning:
            recorder.warn(warning)
    if note := idle_note(built, recorder.last):
        context.console.note(note)
    return path.reached


def _warnings(built: CondensedScene, first: State | None, recorder: Recorder) -> Iterator[str]:
    """Warnings about a completed path, "" for checks without findings. A check may raise NumericalError; the
    warnings before it are kept."""
    last, energies = recorder.last, recorder.energies
    assert last is not None
    assert energies is not None
    if first is not None:
        yield from overlap_warnings(built, first, last)
    yield from end_warnings(built, last)
    yield from tip_warnings(built, last)
    # First of the checks that fail for inconsistent units, so that the warning names the cause.
    yield from strain_warnings(built.case, energies.strains)
    yield from check_transfer(built, last)
    yield check_balance(built.case, force_balance(built, last))
    yield check_energy(built.case, energies)
    yield from check_points(energies)
    yield from check_peaks(built.case, recorder.peaks)
    yield check_held(built)
    yield check_rolling(built, last)
    yield check_open(built)
    yield from built.weak
