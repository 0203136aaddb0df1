"""``mlsanm run``: a case solved and written. ``mlsanm resume``: a stopped or killed run continues from the
checkpoint after its last stored step; clouds and operators are rebuilt from the resolved case and must agree
with the stored ones to round-off."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from mlsanm_cli.app.checks.references import read_case
from mlsanm_cli.app.context import Clock, Console, RunContext
from mlsanm_cli.app.output.analysis import Analysis, Ending
from mlsanm_cli.app.output.recorder import EarlierRun, Recorder, attributes, interrupted_run, summarise
from mlsanm_cli.app.scene.build import Refinement, build_scene
from mlsanm_cli.app.scene.outlines import geometry_of
from mlsanm_cli.case import LoadedCase, parse_case
from mlsanm_cli.errors import Interrupted, NumericalError, RunError, UnfinishedError, WriteError
from mlsanm_cli.io import run_dir
from mlsanm_cli.io.files import read_summary
from mlsanm_cli.io.run_dir import locked
from mlsanm_cli.io.run_file import Attribute
from mlsanm_cli.io.run_reader import held_run, read_origin
from mlsanm_cli.memo import NO_CACHE, Memo
from mlsanm_cli.stopping import Stopper


def run(
    case_path: Path,
    *,
    out: Path,
    overrides: tuple[str, ...] = (),
    force: bool = False,
    threads: int = 1,
    max_wall: float | None = None,
    console: Console,
    argv: tuple[str, ...] = (),
    skip_done: bool = False,
    memo: Memo = NO_CACHE,
) -> Mapping[str, Any]:
    """Solves a case and writes the run directory ``out``; ``memo`` keeps results for other runs of the
    process. With ``skip_done`` a completed run of this case is not repeated: its summary has ``skipped``.

    Returns the mapping of summary.json with the ``directory`` added. The status of a run whose results are
    not reliable is "failed", that of one interrupted, or not finished after ``max_wall`` seconds, "stopped";
    completed steps of both are kept. Raises CaseError or RunError, with nothing written, for a case that
    cannot be run, UnfinishedError if the disk is full, KeyboardInterrupt if stopped before the run began.
    """
    with Stopper(max_wall) as stopper:
        context = RunContext(Clock(), console, memo, stopper)
        loaded = read_case(case_path, overrides)
        held, summary = held_run(out) if skip_done else (None, None)
        if summary is not None and held == loaded.case_hash:
            return {**summary, "directory": str(out), "skipped": True}
        run_dir.check(out, force)
        analysis = analysis_of(loaded, context)
        with locked(out):
            run_dir.prepare(out, force)
            return carry_out(analysis, out, loaded, attributes(loaded, argv, threads))


def analysis_of(
    loaded: LoadedCase, context: RunContext, refinement: Refinement | None = None
) -> Analysis[Any]:
    """The analysis of a case, on refined clouds if given. Raises CaseError if it cannot be run."""
    case, zones = loaded.case, refinement.zones if refinement is not None else ()
    prepared = build_scene(loaded, context, zones)
    # A run imports that of its strain only.
    if case.model.strain == "small":
        from mlsanm_cli.app.analysis.small_strain import SmallStrain

        return SmallStrain(case, prepared, context, refinement)
    from mlsanm_cli.app.analysis.finite_strain import FiniteStrain

    return FiniteStrain(case, prepared, context, refinement)


def carry_out(
    analysis: Analysis[Any],
    directory: Path,
    loaded: LoadedCase,
    provenance: Mapping[str, Attribute],
    earlier: EarlierRun | None = None,
) -> dict[str, Any]:
    """Follows the path of a scene and writes the run directory; returns the summary. Raises UnfinishedError
    if it cannot be written, and Interrupted if stopped at once: the run can be resumed."""
    context, again = analysis.context, run_dir.resume_command(directory)
    try:
        with Recorder(directory, loaded, provenance, context, earlier) as recorder:
            try:
                ending = follow(analysis, recorder)
            except NumericalError as error:
                ending = Ending("failed", error.message, error.hint, error)
            except KeyboardInterrupt as stop:
                ending = Ending("stopped", str(stop), f"continue with: {again}")
            context.stopper.finish()
            if ending.error is not None:
                recorder.failure(analysis, ending.error)
            for note in (*([ending.hint] if ending.status == "stopped" else ()), *analysis.notes):
                context.console.note(note)
            if ending.error is not None:
                context.console.error(ending.error.message, ending.error.hint)
            summary = summarise(analysis, ending, recorder)
            recorder.finish(analysis, summary)
            return {**summary, "directory": str(directory)}
    except WriteError as error:
        raise UnfinishedError(error.message, f"make room, then: {again}") from error
    except KeyboardInterrupt as stop:
        # A second signal, while the first is obeyed.
        raise Interrupted(str(stop), f"continue with: {again}") from stop


def follow(analysis: Analysis[Any], recorder: Recorder) -> Ending:
    """Follows the path of a scene; states are checked and recorded. Raises NumericalError for a bad one."""
    context = analysis.context
    analysis.set_up(recorder.verdicts)
    # From now on the command stops between steps, where no results are lost, unless one takes long.
    context.stopper.gentle = True
    context.stopper.check()
    checkpoint = recorder.start(analysis)
    steps = analysis.steps(checkpoint, recorder.last, recorder.verdicts)
    while True:
        context.stopper.check()
        with context.phase("continuation"):
            step = next(steps, None)
        if step is None:
            assert recorder.last is not None
            recorder.verdicts.judge(analysis.judge(recorder.last, recorder.tally))
            if checkpoint is None or checkpoint.ended_by < 0:
                return Ending("done", "end of the last stage")
            stop = analysis.case.stop[checkpoint.ended_by].description
            return Ending("done", f"{stop}, at position {recorder.last.position:.9g}", stopped_by=stop)
        for state in (*(one for one in step.saved if one is not step.state), step.state):
            recorder.checked = state
            recorder.verdicts.judge(analysis.checks(state))
        recorder.step(analysis, step)
        checkpoint = step.checkpoint


def resume(rundir: Path, *, max_wall: float | None = None, console: Console) -> Mapping[str, Any]:
    """Finishes the run in a directory; returns and raises the same as `run`. A completed run is not changed.
    Raises RunError for a failed run, which would fail again, and if clouds or operators are not reproduced.
    """
    read_origin(rundir)
    with Stopper(max_wall) as stopper, locked(rundir):
        context = RunContext(Clock(), console, stopper=stopper)
        origin = read_origin(rundir)
        summary_file = rundir / run_dir.SUMMARY_FILE
        # A run killed just before its summary was written is unfinished, whatever its status.
        ended = origin.status if summary_file.is_file() else "running"
        if ended == "done":
            console.note(f"the run in {rundir} is complete, there is nothing to resume")
            return {**read_summary(summary_file), "directory": str(rundir)}
        if ended == "failed":
            message = f"the run in {rundir} failed, and resuming would repeat the failure"
            raise RunError(message, "change the case and run it with --force")
        if not origin.case_resolved:
            message = f"the run in {rundir} was killed before its first step"
            raise RunError(message, "run the case again with --force")
        loaded = parse_case(origin.case_resolved, rundir / run_dir.RESOLVED_FILE, (), geometry_of)
        if loaded.case_hash != origin.attributes["case_hash"]:
            message = f"the case stored in {rundir} is not the one of the run: another version wrote it"
            version = origin.attributes["mlsanm_version"]
            raise RunError(message, f"it was mlsanm {version}; run the case again with --force")
        loaded = replace(loaded, raw=origin.case_raw, path=Path(str(origin.attributes["case_path"])))
        earlier = interrupted_run(origin)
        analysis = analysis_of(loaded, context, earlier.refinement)
        again = {"resumed": int(origin.attributes.get("resumed", 0)) + 1}
        run_dir.reopen(rundir)
        return carry_out(analysis, rundir, loaded, again, earlier)
