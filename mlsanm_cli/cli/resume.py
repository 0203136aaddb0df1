"""``mlsanm resume``, and how a run that has ended is shown."""

from __future__ import annotations

import json
import shutil
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import click

from mlsanm_cli.cli.options import FILE, cache_option, common, console_for, max_wall_option, print_result
from mlsanm_cli.cli.results import run_text
from mlsanm_cli.cli.settings import Settings, numerics
from mlsanm_cli.cli.streams import say

_STATUS_CODES = {"failed": 3, "stopped": 75}


@click.command()
@click.argument("rundir", type=FILE)
@max_wall_option
@click.option(
    "--threads", type=click.IntRange(min=1), help="Threads to use.  [default: as many as the run used]"
)
@cache_option
@common
@click.pass_obj
def resume(settings: Settings, rundir: Path, max_wall: float | None, threads: int | None) -> int:
    """Go on with the run in RUNDIR that was stopped or killed, behind its last finished step.

    The result is that of a run that was never stopped, within the solver's tolerance.
    """
    threads = threads or _threads_of(rundir)
    with numerics(threads):
        from mlsanm_cli.app.resume import resume as resume_run

    console = console_for(settings)
    try:
        summary = resume_run(rundir, max_wall=max_wall, console=console)
    finally:
        console.close()
    return show_run(settings, summary)


def show_run(settings: Settings, summary: Mapping[str, Any]) -> int:
    """Print how a run ended; returns its exit code."""
    width = shutil.get_terminal_size((100, 24)).columns
    print_result(settings, summary, run_text(summary, settings.paints(sys.stdout), width))
    if not settings.quiet and not settings.json and "directory" in summary:
        say(settings, f"pictures: mlsanm plot {summary['directory']}")
    return _STATUS_CODES.get(str(summary.get("status")), 0)


def _threads_of(rundir: Path) -> int:
    """The threads a run used, from its first event: run.h5 cannot be opened before they are set."""
    try:
        with (rundir / "events.jsonl").open(encoding="utf-8") as stream:
            return max(int(json.loads(stream.readline())["threads"]), 1)
    except (OSError, ValueError, KeyError, TypeError):
        # What is wrong with the directory is told by the one who reads it.
        return 1
