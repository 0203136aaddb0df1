"""``mlsanm plot``: options."""

from __future__ import annotations

from pathlib import Path

import click

from mlsanm_cli.cli import completion
from mlsanm_cli.cli.options import FILE, common, print_result
from mlsanm_cli.cli.settings import Settings, numerics

KINDS = ("pressure", "traction", "loop", "hysteresis", "force", "peak", "bodies", "line")
FIELDS = ("von_mises", "xx", "yy", "xy", "ux", "uy", "displacement")


@click.command()
@click.argument("rundirs", metavar="RUNDIR...", type=FILE, nargs=-1, required=True)
@click.option(
    "--what", type=click.Choice(KINDS), multiple=True, help="Kind of picture; repeatable.  [default: all]"
)
@click.option(
    "--contact",
    metavar="NAME",
    shell_complete=completion.names("contact"),
    help="Pictures of this contact only.",
)
@click.option("--field", type=click.Choice(FIELDS), help="Colours of the bodies, or what a line shows.")
@click.option("--at", type=float, multiple=True, help="Path position; repeatable.  [default: saved ones]")
@click.option(
    "--along",
    metavar="LINE",
    help="A boundary, as block.top, or a line X,Y:X,Y, along which a field is drawn.",
)
@click.option("-o", "--output", "out", type=FILE, help="Write this one picture; its ending tells the format.")
@click.option("--animate", is_flag=True, help="A GIF along the path: pressures, or --what bodies.")
@click.option(
    "--format",
    "formats",
    type=click.Choice(["png", "svg", "pdf"]),
    multiple=True,
    default=("png",),
    show_default=True,
    help="File format; repeatable.",
)
@common
@click.pass_obj
def plot(
    settings: Settings,
    rundirs: tuple[Path, ...],
    what: tuple[str, ...],
    contact: str | None,
    field: str | None,
    at: tuple[float, ...],
    along: str | None,
    out: Path | None,
    animate: bool,
    formats: tuple[str, ...],
) -> int:
    """Draw the run in RUNDIR, or several over each other.

    Pressure against position, load path, deformed bodies with von Mises stress; needs no display.
    """
    with numerics(1):
        from mlsanm_cli.app.results.plot import plot as plot_run
        from mlsanm_cli.app.results.plot_choice import Choice

    choice = Choice(what, contact, field, at, along, out, animate)
    files = plot_run(rundirs, formats=tuple(dict.fromkeys(formats)), choice=choice)
    print_result(settings, {"files": [str(file) for file in files]}, "\n".join(str(file) for file in files))
    return 0
