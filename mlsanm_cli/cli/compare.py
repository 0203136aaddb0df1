"""``mlsanm compare``: options, table and exit codes."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import click

from mlsanm_cli.cli.options import FILE, common, console_for, print_result, set_option, threads_option
from mlsanm_cli.cli.results import comparison_text
from mlsanm_cli.cli.settings import Settings, numerics

_STATUS_CODES = {"disagree": 1, "failed": 3}


@click.command()
@click.argument("case", type=FILE)
@click.option("--newton", is_flag=True, help="Newton-Raphson with the regularised law.")
@click.option("--active-set", is_flag=True, help="Active-set method with the exact law.")
@click.option("--analytic", is_flag=True, help="Errors relative to the [reference] of the case.")
@click.option(
    "--levels",
    type=click.IntRange(min=1),
    default=10,
    show_default=True,
    help="Load levels per stage to compare, in addition to those of the case.",
)
@click.option(
    "--tolerance",
    type=click.FloatRange(min=0.0, min_open=True),
    help="Allowed difference between methods with the same law.  [default: 100 x solver.tolerance]",
)
@click.option(
    "--repeat",
    type=click.IntRange(min=1),
    default=1,
    show_default=True,
    help="Repetitions of every path; median times are reported.",
)
@click.option("--picture/--no-picture", default=True, help="Draw a work-precision diagram.  [default: draw]")
@set_option
@click.option("--out", type=FILE, help="Directory of comparison.json.  [default: results/<case name>]")
@click.option("--force", is_flag=True, help="Overwrite an existing comparison.")
@threads_option
@common
@click.pass_obj
def compare(settings: Settings, /, case: Path, newton: bool, active_set: bool, **options: Any) -> int:
    """Solve CASE by several methods and compare the results.

    The asymptotic numerical method (ANM: power series), the selected methods and that of CASE use the same
    operators. Exit code 1 if they disagree.
    """
    selected = {"newton": newton, "active-set": active_set}
    with console_for(settings) as console:
        with numerics(options["threads"]):
            from mlsanm_cli.app.comparison.compare import CompareOptions
            from mlsanm_cli.app.comparison.compare import compare as compare_methods
        own = {key: options.pop(key) for key in ("analytic", "levels", "tolerance", "repeat", "picture")}
        wanted = CompareOptions(tuple(name for name, given in selected.items() if given), **own)
        result = compare_methods(case, wanted, console=console, argv=tuple(sys.argv), **options)
    print_result(settings, result, comparison_text(result, settings.paints(sys.stdout)))
    return _STATUS_CODES.get(str(result["status"]), 0)
