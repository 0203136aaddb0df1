"""Commands for many runs: ``sweep`` and ``collect``."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import click

from mlsanm_cli.cli import completion
from mlsanm_cli.cli.options import (
    FILE,
    cache_option,
    common,
    console_for,
    pretty_result,
    print_result,
    set_option,
    threads_option,
)
from mlsanm_cli.cli.settings import Settings, numerics, say
from mlsanm_cli.cli.text import as_json


@click.command()
@click.argument("case", type=FILE)
@click.option(
    "--vary",
    "varied",
    metavar="KEY=VALUES",
    multiple=True,
    shell_complete=completion.keys,
    help="Values separated by commas, or START:STOP:COUNT. Repeatable: all combinations are solved.",
)
@set_option
@click.option("--out", type=FILE, help="Directory of the runs.  [default: results/<case name>-sweep]")
@click.option("--force", is_flag=True, help="Solve completed points again and overwrite runs of other cases.")
@click.option("--jobs", type=click.IntRange(min=1), default=1, show_default=True, help="Number of processes.")
@click.option("--scheduler", metavar="ADDRESS", help="Solve on the Dask cluster of this scheduler.")
@cache_option
@threads_option
@common
@click.pass_obj
def sweep(settings: Settings, /, case: Path, varied: tuple[str, ...], **options: Any) -> int:
    """Solve CASE for all combinations of values.

    For instance --vary contact.interface.friction=0:0.5:11 or --vary body.block.spacing=0.1,0.2,0.4.
    Completed points are skipped: the same command continues an interrupted sweep.
    """
    with console_for(settings) as console:
        with numerics(options["threads"]):
            from mlsanm_cli.app.sweep.run_sweep import SweepOptions
            from mlsanm_cli.app.sweep.run_sweep import sweep as run_sweep
        own = SweepOptions(**{key: options.pop(key) for key in ("jobs", "threads", "scheduler", "force")})
        result = run_sweep(case, varied, own, console=console, argv=tuple(sys.argv), **options)
    shown = {key: value for key, value in result.items() if key not in ("trouble", "directories")}
    print_result(settings, result, pretty_result(settings, shown))
    return 3 if result["failed"] else 75 if result["stopped"] else 0


@click.command()
@click.argument("rundirs", metavar="RUNDIR...", type=FILE, nargs=-1, required=True)
@click.option("--out", type=FILE, help="Output file.  [default: stdout]")
@common
@click.pass_obj
def collect(settings: Settings, rundirs: tuple[Path, ...], out: Path | None) -> int:
    """Write the results of several runs as a CSV table.

    One row per run: the parameters that differ, status and results.
    """
    with numerics(1):
        from mlsanm_cli.app.results.collect import as_csv, write_rows
        from mlsanm_cli.app.results.collect import collect as collect_runs

    rows = collect_runs(rundirs)
    if out is not None:
        write_rows(out, rows)
    if settings.json:
        say(settings, as_json({"runs": rows}))
    elif out is None:
        say(settings, as_csv(rows), newline=False)
    return 0
