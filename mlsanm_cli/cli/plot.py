"""``mlsanm plot`` and ``mlsanm report``."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from mlsanm_cli.app.results.choice import FIELDS, KINDS, Choice
from mlsanm_cli.cli import completion
from mlsanm_cli.cli.options import FILE, common, console_for, print_result
from mlsanm_cli.cli.settings import Settings, numerics


@click.command()
@click.argument("rundirs", metavar="RUNDIR...", type=FILE, nargs=-1, required=True)
@click.option(
    "--what",
    type=click.Choice(KINDS),
    multiple=True,
    help="Kind of picture. Repeatable.  [default: all except hysteresis and line]",
)
@click.option(
    "--contact", metavar="NAME", shell_complete=completion.names("contact"), help="Draw this contact only."
)
@click.option("--field", type=click.Choice(FIELDS), help="Field shown on bodies or along a line.")
@click.option(
    "--at",
    type=float,
    multiple=True,
    help="Position on the load path. Repeatable.  [default: saved positions]",
)
@click.option(
    "--along", metavar="LINE", help="Draw a field along a boundary such as block.top, or a line X,Y:X,Y."
)
@click.option(
    "-o", "--output", "out", type=FILE, help="Output file of a single picture; the suffix selects the format."
)
@click.option(
    "--animate",
    is_flag=True,
    help="Animate the path: pressures, or --what bodies; a GIF, or with -o NAME.mp4 an MP4 file.",
)
@click.option(
    "--format",
    "formats",
    type=click.Choice(["png", "svg", "pdf"]),
    multiple=True,
    default=("png",),
    show_default=True,
    help="File format. Repeatable.",
)
@common
@click.pass_obj
def plot(settings: Settings, /, rundirs: tuple[Path, ...], formats: tuple[str, ...], **chosen: Any) -> int:
    """Draw pictures of a run, or of several runs together.

    Contact pressures, the load path, and deformed bodies with von Mises stress. No display is needed.
    """
    with console_for(settings, "drawing"):
        with numerics(1):
            from mlsanm_cli.app.results.plot import plot as plot_run
        files = plot_run(rundirs, formats=tuple(dict.fromkeys(formats)), choice=Choice(**chosen))
    print_result(settings, {"files": [str(file) for file in files]}, "\n".join(str(file) for file in files))
    return 0


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
