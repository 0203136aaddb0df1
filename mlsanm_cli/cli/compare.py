"""``mlsanm compare``: options, table and exit codes."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import click

from mlsanm_cli.cli import declare
from mlsanm_cli.cli.results import comparison_text
from mlsanm_cli.cli.running import console_for, of_app, print_result
from mlsanm_cli.cli.settings import Settings

METHODS = ("newton", "active-set")
_STATUS_CODES = {"disagree": 1, "failed": 3}


@declare.command(
    declare.CASE,
    declare.flag("newton", "Newton-Raphson with the regularised law."),
    declare.flag("active-set", "Active-set method with the exact law."),
    declare.flag("analytic", "Errors relative to the [reference] of the case."),
    click.option(
        "--levels",
        type=click.IntRange(min=1),
        default=10,
        show_default=True,
        help="Load levels per stage to compare, in addition to those of the case.",
    ),
    click.option(
        "--tolerance",
        type=click.FloatRange(min=0.0, min_open=True),
        help="Allowed difference between methods with the same law.  [default: 100 x solver.tolerance]",
    ),
    click.option(
        "--repeat",
        type=click.IntRange(min=1),
        default=1,
        show_default=True,
        help="Repetitions of every path; median times are reported.",
    ),
    click.option(
        "--picture/--no-picture", default=True, help="Draw a work-precision diagram.  [default: draw]"
    ),
    declare.SET,
    declare.file_option("--out", help="Directory of comparison.json.  [default: results/<case name>]"),
    declare.flag("force", "Overwrite an existing comparison."),
    declare.THREADS,
)
def compare(settings: Settings, /, case: Path, **options: Any) -> int:
    """Solve CASE by several methods and compare the results.

    The asymptotic numerical method (ANM: power series), the selected methods and that of CASE use the same
    operators. Exit code 1 if they disagree.
    """
    methods = tuple(name for name in METHODS if options.pop(name.replace("-", "_")))
    with console_for(settings) as console:
        run = of_app("comparison.compare.compare", options["threads"])
        result = run(case, methods=methods, console=console, argv=tuple(sys.argv), **options)
    print_result(settings, result, comparison_text(result, settings.paints(sys.stdout)))
    return _STATUS_CODES.get(str(result["status"]), 0)
