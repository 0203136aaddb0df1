"""``mlsanm resume``: a stopped or killed run continues to the same result within the solver's tolerance. The
path continues from the checkpoint after the last stored step. Clouds and operators are rebuilt from the
resolved case and must agree with the stored ones to round-off."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from mlsanm_cli.app.context import Clock, Console, RunContext
from mlsanm_cli.app.output.checkpoint import interrupted_run
from mlsanm_cli.app.run import analysis_of, carry_out
from mlsanm_cli.app.scene.imported import geometry_inspector
from mlsanm_cli.case import LoadedCase, parse_case
from mlsanm_cli.errors import RunError
from mlsanm_cli.io import run_dir
from mlsanm_cli.io.lock import locked
from mlsanm_cli.io.run_reader import RunData, read_origin
from mlsanm_cli.io.summary import read_json
from mlsanm_cli.stopping import Stopper


def resume(rundir: Path, *, max_wall: float | None = None, console: Console) -> Mapping[str, Any]:
    """Finishes the run in a directory; returns and raises the same as `run`. A completed run is not changed.
    Raises RunError for a failed run, which would fail again, for one that cannot be read, and if clouds or
    operators are not reproduced."""
    read_origin(rundir)
    with Stopper(max_wall) as stopper, locked(rundir):
        context = RunContext(Clock(), console, stopper=stopper)
        origin = read_origin(rundir)
        summary_file = rundir / run_dir.SUMMARY_FILE
        # A run killed just before its summary was written is unfinished, whatever its status.
        ended = origin.status if summary_file.is_file() else "running"
        if ended == "done":
            console.note(f"the run in {rundir} is complete, there is nothing to resume")
            return {**read_json(summary_file), "directory": str(rundir)}
        if ended == "failed":
            raise RunError(
                f"the run in {rundir} failed, and resuming would repeat the failure",
                "change the case and run it with --force",
            )
        loaded = stored_case(origin, rundir)
        earlier = interrupted_run(origin)
        analysis = analysis_of(loaded, context, earlier.refinement)
        again = {"resumed": int(origin.attributes.get("resumed", 0)) + 1}
        run_dir.reopen(rundir)
        return carry_out(analysis, rundir, loaded, again, earlier)


def stored_case(origin: RunData, rundir: Path) -> LoadedCase:
    """The stored case of a run, with its files inspected again. Raises RunError if it is incomplete."""
    if not origin.case_resolved:
        raise RunError(
            f"the run in {rundir} was killed before its first step", "run the case again with --force"
        )
    loaded = parse_case(origin.case_resolved, rundir / run_dir.RESOLVED_FILE, (), geometry_inspector)
    if loaded.case_hash != origin.attributes["case_hash"]:
        raise RunError(
            f"the case stored in {rundir} is not the one of the run: another version wrote it",
            f"it was mlsanm {origin.attributes['mlsanm_version']}; run the case again with --force",
        )
    return replace(loaded, raw=origin.case_raw, path=Path(str(origin.attributes["case_path"])))
