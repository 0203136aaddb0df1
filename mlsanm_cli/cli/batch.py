"""Commands for many runs: ``sweep``, ``collect`` and ``compare``."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import click

from mlsanm_cli.cli import declare
from mlsanm_cli.cli.console import TerminalConsole, called
from mlsanm_cli.cli.results import comparison_text
from mlsanm_cli.cli.settings import Settings, of_app, print_result, print_tables, say
from mlsanm_cli.cli.text import as_json
from mlsanm_cli.errors import RunError


@declare.command(
    declare.CASE,
    declare.option(
        "--vary varied",
        "Values separated by commas, or START:STOP:COUNT. Repeatable: all combinations are solved.",
        metavar="KEY=VALUES",
        **declare.KEYS,
    ),
    declare.SET,
    declare.file_option("--out", "Directory of the runs.  [default: results/<case name>-sweep]"),
    declare.flag("force", "Solve completed points again and overwrite runs of other cases."),
    declare.count("--jobs", "Number of processes."),
    declare.option("--scheduler", "Solve on the Dask cluster of this scheduler.", metavar="ADDRESS"),
    declare.THREADS,
)
def sweep(settings: Settings, /, case: Path, varied: tuple[str, ...], **options: Any) -> int:
    """Solve CASE for all combinations of values.

    For instance --vary contact.interface.friction=0:0.5:11 or --vary body.block.spacing=0.1,0.2,0.4.
    Completed points are skipped: the same command continues an interrupted sweep.
    """
    function, argv = "sweep.sweep", tuple(sys.argv)
    result = called(settings, function, options["threads"], case, varied, argv=argv, **options)
    shown = {key: value for key, value in result.items() if key not in ("trouble", "directories")}
    print_tables(settings, result, shown)
    return 3 if result["failed"] else 75 if result["stopped"] else 0


@declare.command(declare.RUNDIRS, declare.file_option("--out", "Output file.  [default: stdout]"))
def collect(settings: Settings, rundirs: tuple[Path, ...], out: Path | None) -> int:
    """Write the results of several runs as a CSV table.

    One row per run: the parameters that differ, status and results.
    """
    rows = of_app("results.info.collect")(rundirs)
    lost = [row for row in rows if row["status"] == "unreadable"]
    if len(lost) == len(rows):
        reason = f"{lost[0]['directory']}: {lost[0]['stop_reason']}" if lost else "there are only files"
        raise RunError(f"no directory holds a run ({reason})", "name run directories, as in results/sweep/*")
    with TerminalConsole(sys.stderr, settings) as console:
        for row in lost:
            console.warning(f"{row['directory']}: {row['stop_reason']}")
    if out is not None:
        of_app("results.info.write_rows")(out, rows)
    if settings.json:
        say(settings, as_json({"runs": rows}))
    elif out is None:
        say(settings, of_app("results.info.as_csv")(rows), newline=False)
    return 0


METHODS = ("newton", "active-set")
_STATUS_CODES = {"disagree": 1, "failed": 3}


@declare.command(
    declare.CASE,
    declare.flag("newton", "Newton-Raphson with the regularised law."),
    declare.flag("active-set", "Active-set method with the exact law."),
    declare.flag("analytic", "Errors relative to the [reference] of the case."),
    declare.count("--levels", "Load levels per stage to compare, in addition to those of the case.", 10),
    declare.option(
        "--tolerance",
        "Allowed difference between methods with the same law.  [default: 100 x solver.tolerance]",
        type=click.FloatRange(min=0.0, min_open=True),
    ),
    declare.count("--repeat", "Repetitions of every path; median times are reported."),
    declare.option("--picture/--no-picture", "Draw a work-precision diagram.  [default: draw]", default=True),
    declare.SET,
    declare.file_option("--out", "Directory of comparison.json.  [default: results/<case name>]"),
    declare.flag("force", "Overwrite an existing comparison."),
    declare.THREADS,
)
def compare(settings: Settings, /, case: Path, **options: Any) -> int:
    """Solve CASE by several methods and compare the results.

    The asymptotic numerical method (ANM: power series), the selected methods and that of CASE use the same
    operators. Exit code 1 if they disagree.
    """
    methods = tuple(name for name in METHODS if options.pop(name.replace("-", "_")))
    function, argv = "comparison.compare.compare", tuple(sys.argv)
    result = called(settings, function, options["threads"], case, methods=methods, argv=argv, **options)
    print_result(settings, result, comparison_text(result, settings.paints(sys.stdout)))
    return _STATUS_CODES.get(str(result["status"]), 0)
