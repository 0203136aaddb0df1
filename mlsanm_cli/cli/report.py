"""``mlsanm report``: options."""

from __future__ import annotations

from pathlib import Path

import click

from mlsanm_cli.cli.options import FILE, common, print_result
from mlsanm_cli.cli.settings import Settings, numerics


@click.command()
@click.argument("rundirs", metavar="RUNDIR...", type=FILE, nargs=-1, required=True)
@click.option("-o", "--output", "out", type=FILE, help="File.  [default: report.html beside the run]")
@common
@click.pass_obj
def report(settings: Settings, rundirs: tuple[Path, ...], out: Path | None) -> int:
    """Write an HTML page about the run in RUNDIR, or several.

    Case, pictures, tables, checks and provenance in one file that needs no server. Of several runs it is
    written here unless -o tells where.
    """
    with numerics(1):
        from mlsanm_cli.app.results.report import report as write_report

    path = write_report(rundirs, out)
    print_result(settings, {"file": str(path)}, str(path))
    return 0
