"""``mlsanm plot`` and ``mlsanm report``."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from mlsanm_cli.app.results.choice import FIELDS, KINDS, Choice
from mlsanm_cli.cli import declare
from mlsanm_cli.cli.running import console_for, of_app, print_result
from mlsanm_cli.cli.settings import Settings


@declare.command(
    declare.RUNDIRS,
    click.option(
        "--what",
        type=click.Choice(KINDS),
        multiple=True,
        help="Kind of picture. Repeatable.  [default: all except hysteresis and line]",
    ),
    declare.name_option("contact", "Draw this contact only.", "contact"),
    click.option("--field", type=click.Choice(FIELDS), help="Field shown on bodies or along a line."),
    click.option(
        "--at",
        type=float,
        multiple=True,
        help="Position on the load path. Repeatable.  [default: saved positions]",
    ),
    click.option(
        "--along", metavar="LINE", help="Draw a field along a boundary such as block.top, or a line X,Y:X,Y."
    ),
    declare.file_option(
        "-o", "--output", "out", help="Output file of a single picture; the suffix selects the format."
    ),
    declare.flag(
        "animate", "Animate the path: pressures, or --what bodies; a GIF, or with -o NAME.mp4 an MP4 file."
    ),
    click.option(
        "--format",
        "formats",
        type=click.Choice(["png", "svg", "pdf"]),
        multiple=True,
        default=("png",),
        show_default=True,
        help="File format. Repeatable.",
    ),
)
def plot(settings: Settings, /, rundirs: tuple[Path, ...], formats: tuple[str, ...], **chosen: Any) -> int:
    """Draw pictures of a run, or of several runs together.

    Contact pressures, the load path, and deformed bodies with von Mises stress. No display is needed.
    """
    with console_for(settings, "drawing"):
        draw = of_app("results.plot.plot")
        files = draw(rundirs, formats=tuple(dict.fromkeys(formats)), choice=Choice(**chosen))
    print_result(settings, {"files": [str(file) for file in files]}, "\n".join(str(file) for file in files))
    return 0


@declare.command(
    declare.RUNDIRS,
    declare.file_option(
        "-o", "--output", "out", help="Output file.  [default: report.html in the run directory]"
    ),
)
def report(settings: Settings, rundirs: tuple[Path, ...], out: Path | None) -> int:
    """Write an HTML report on one run or several.

    A self-contained file with case, pictures, tables, checks and provenance. For several runs it is written
    to the current directory unless -o is given.
    """
    with console_for(settings, "drawing"):
        path = of_app("results.report.report")(rundirs, out)
    print_result(settings, {"file": str(path)}, str(path))
    return 0
