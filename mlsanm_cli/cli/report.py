"""``mlsanm report``."""

from __future__ import annotations

from pathlib import Path

import click

from mlsanm_cli.cli.options import FILE, common, console_for, print_result
from mlsanm_cli.cli.settings import Settings, numerics


@click.command()
@click.argument("rundirs", metavar="RUNDIR...", type=FILE, nargs=-1, required=True)
@click.option(
    "-o", "--output", "out", type=FILE, help="Output file.  [default: report.html in the run directory]"
)
@common
@click.pass_obj
def report(settings: Settings, rundirs: tuple[Path, ...], out: Path | None) -> int:
    """Write an HTML report on one run or several.

    A self-contained file with case, pictures, tables, checks and provenance. For several runs it is written
    to the current directory unless -o is given.
    """
    with console_for(settings, "drawing"):
        with numerics(1):
            from mlsanm_cli.app.results.report import report as write_report
        path = write_report(rundirs, out)
    print_result(settings, {"file": str(path)}, str(path))
    return 0
