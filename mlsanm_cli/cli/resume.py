"""``mlsanm resume``, and the output at the end of a run."""

from __future__ import annotations

import json
import shlex
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
@click.option("--threads", type=click.IntRange(min=1), help="Number of threads.  [default: that of the run]")
@cache_option
@common
@click.pass_obj
def resume(settings: Settings, rundir: Path, max_wall: float | None, threads: int | None) -> int:
    """Continue the interrupted run in RUNDIR after its last saved step.

    The result agrees with that of an uninterrupted run to the tolerance of the solver.
    """
    threads = threads or _threads_of(rundir)
    with console_for(settings) as console:
        with numerics(threads):
            from mlsanm_cli.app.resume import resume as resume_run
        summary = resume_run(rundir, max_wall=max_wall, console=console)
    return show_run(settings, summary)


def show_run(settings: Settings, summary: Mapping[str, Any]) -> int:
    """Prints the result of a run and returns its exit code."""
    width = shutil.get_terminal_size((100, 24)).columns
    print_result(settings, summary, run_text(summary, settings.paints(sys.stdout), width))
    # A run without a state has nothing to draw.
    drawable = summary.get("position") is not None and "directory" in summary
    if drawable and not settings.quiet and not settings.json:
        say(settings, f"pictures: mlsanm plot {shlex.quote(str(summary['directory']))}")
    return _STATUS_CODES.get(str(summary.get("status")), 0)


def _threads_of(rundir: Path) -> int:
    """The number of threads of a run, from its first event: run.h5 cannot be read before it is set."""
    try:
        with (rundir / "events.jsonl").open(encoding="utf-8") as stream:
            return max(int(json.loads(stream.readline())["threads"]), 1)
    except (OSError, ValueError, KeyError, TypeError):
        # Problems of the directory are reported later, when it is read.
        return 1
