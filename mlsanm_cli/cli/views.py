"""Commands that show results: ``plot``, ``report`` and ``probe``."""

from __future__ import annotations

import csv
import io
import math
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import click

from mlsanm_cli.app.results.choice import FIELDS, KINDS, POINT_FIELDS, QUANTITIES, Choice
from mlsanm_cli.cli import declare
from mlsanm_cli.cli.console import (
    Settings,
    TerminalConsole,
    console_for,
    of_app,
    print_result,
    print_tables,
    say,
)
from mlsanm_cli.cli.text import grid, label, number
from mlsanm_cli.errors import RunError
from mlsanm_cli.roundoff import ROUND_OFF
from mlsanm_cli.toml import plain


@declare.command(
    declare.RUNDIRS,
    declare.option(
        "--what",
        "Kind of picture. Repeatable.  [default: all except hysteresis and line]",
        type=click.Choice(KINDS),
        multiple=True,
    ),
    declare.name_option("contact", "Draw this contact only.", "contact"),
    declare.option("--field", "Field shown on bodies or along a line.", type=click.Choice(FIELDS)),
    declare.positions("Position on the load path. Repeatable.  [default: saved positions]"),
    declare.option(
        "--along", "Draw a field along a boundary such as block.top, or a line X,Y:X,Y.", metavar="LINE"
    ),
    declare.output("Output file of a single picture; the suffix selects the format."),
    declare.flag(
        "animate", "Animate the path: pressures, or --what bodies; a GIF, or with -o NAME.mp4 an MP4 file."
    ),
    declare.option(
        "--format formats",
        "File format. Repeatable.",
        type=click.Choice(["png", "svg", "pdf"]),
        multiple=True,
        default=("png",),
        show_default=True,
    ),
)
def plot(settings: Settings, /, rundirs: tuple[Path, ...], formats: tuple[str, ...], **chosen: Any) -> int:
    """Draw pictures of a run, or of several runs together.

    Contact pressures, the load path, and deformed bodies with von Mises stress. No display is needed.
    """
    with console_for(settings, "drawing"):
        draw = of_app("results.plot.plot")
        files = draw(rundirs, formats=tuple(dict.fromkeys(formats)), choice=Choice(**chosen))
    print_result(settings, {"files": [str(file) for file in files]}, "\n".join(map(str, files)))
    return 0


@declare.command(declare.RUNDIRS, declare.output("Output file.  [default: report.html in the run directory]"))
def report(settings: Settings, rundirs: tuple[Path, ...], out: Path | None) -> int:
    """Write an HTML report on one run or several.

    A self-contained file with case, pictures, tables, checks and provenance. For several runs it is written
    to the current directory unless -o is given.
    """
    with console_for(settings, "drawing"):
        path = of_app("results.report.report")(rundirs, out)
    print_result(settings, {"file": str(path)}, str(path))
    return 0


_ORIGINS = {
    "stored": "",
    "series": "from the power series of the step",
    "linear": "interpolated (linear problem)",
    "interpolated": "interpolated, error {error:.2g} % of the largest value",
}
_ORIGIN_KEYS = ("how", "error")


class PointType(click.ParamType[tuple[float, float]]):
    """Two numbers separated by a comma."""

    name = "X,Y"

    def convert(
        self, value: Any, param: click.Parameter | None, ctx: click.Context | None
    ) -> tuple[float, float]:
        """The point; usage error for anything else."""
        try:
            x, y = map(float, str(value).split(","))
        except ValueError:
            self.fail(f'"{value}" is not a point; write --point 0.5,1.0', param, ctx)
        if not (math.isfinite(x) and math.isfinite(y)):
            self.fail("nan and inf are not allowed", param, ctx)
        return x, y


@declare.command(
    declare.RUNDIR,
    declare.positions("Position on the load path. Repeatable.  [default: the end]"),
    declare.name_option("contact", "Results along a contact.", "contact"),
    declare.option(
        "--quantity quantities",
        "Quantity of the contact. Repeatable.  [default: all]",
        type=click.Choice(QUANTITIES),
        multiple=True,
    ),
    declare.name_option("force", "Force of a load, support or contact.", "load", "support", "contact"),
    declare.name_option("probe", "Results of a [[probe]] of the case.", "probe"),
    declare.name_option("body", "Body with the --point.", "body"),
    declare.option("--point", "Coordinates of a point in the undeformed body.", type=PointType()),
    declare.option(
        "--field", "Field at the point or probe.  [default: all]", type=click.Choice(POINT_FIELDS)
    ),
    declare.option("--csv as_csv", "Print the result as CSV on stdout.", is_flag=True),
)
def probe(
    settings: Settings,
    rundir: Path,
    at: tuple[float, ...],
    quantities: tuple[str, ...],
    point: tuple[float, float] | None,
    field: str | None,
    as_csv: bool,
    **names: str | None,
) -> int:
    """Print a result at any position on the load path.

    A position is the number of completed stages plus the fraction of the current one. Between stored states
    results are evaluated from the power series of the run, or interpolated with an error estimate if there
    are none. With --at alone, print the figures of all contacts; without options, list the available results.
    """
    targets = {kind: name for kind, name in names.items() if name is not None}
    of_point = bool(targets.keys() & {"body", "probe"})
    several, alone = len(targets) > 1, ("body" in targets) != (point is not None)
    for wrong, message, hint in (
        (several, "more than one result selected", "give one of --contact, --force, --probe, --body"),
        (alone, "--body and --point are needed together", "as in --body block --point 0,-0.5"),
        (quantities and "contact" not in targets, "--quantity needs a contact", "add --contact NAME"),
        (field and not of_point, "--field needs a point", "add --body and --point, or --probe"),
        (as_csv and settings.json, "--csv and --json exclude each other", "give one of them"),
    ):
        if wrong:
            raise RunError(message, hint)
    if not targets and not at:
        print_tables(settings, of_app("results.probe.contents")(rundir))
        return 0
    kind, name = next(iter(targets.items()), ("contacts", ""))
    x, y = point or (0.0, 0.0)
    function, given, title = {
        "contacts": ("everything", (), kind),
        "contact": ("contact", (name, quantities), f"contact {name}"),
        "force": ("force", (name,), f"force of {name}"),
        "probe": ("named", (name, field), f"probe {name}"),
        "body": ("point", (name, (x, y), field), f"{name} at ({x:g}, {y:g})"),
    }[kind]
    rows = of_app(f"results.probe.probe_{function}")(rundir, at, *given)
    if not as_csv:
        print_result(settings, {"levels": rows}, _text(title, rows, settings.paints(sys.stdout)))
        return 0
    for row in (row for row in rows if "error" in row):
        warning = f"position {number(row['position'])}: {_origin(row)}"
        TerminalConsole(sys.stderr, settings).warning(warning)
    say(settings, _csv(rows), newline=False)
    return 0


def _origin(row: Mapping[str, Any]) -> str:
    """The origin of a row in words, "" if it is stored."""
    error = float(row.get("error", 0.0))
    if row["how"] == "interpolated" and error < ROUND_OFF:
        return "interpolated to round-off"
    return _ORIGINS[row["how"]].format(error=100.0 * error)


def _text(title: str, rows: Sequence[Mapping[str, Any]], color: bool) -> str:
    """One table over the load levels; for a contact one table per level."""
    if not any(hasattr(value, "tolist") for value in rows[0].values()):
        columns = [key for key in rows[0] if key not in _ORIGIN_KEYS]
        cells = [[*(number(row[key]) for key in columns), _origin(row)] for row in rows]
        return grid(title, [*map(label, columns), ""], cells, color)
    tables = []
    for row in rows:
        columns = [key for key in row if key not in ("position", *_ORIGIN_KEYS)]
        origin = f", {_origin(row)}" if _origin(row) else ""
        cells = [[*map(number, values)] for values in zip(*(plain(row[key]) for key in columns), strict=True)]
        heading = f"{title}, position {number(row['position'])}{origin}"
        tables.append(grid(heading, [*map(label, columns)], cells, color))
    return "\n".join(tables)


def _csv(rows: Sequence[Mapping[str, Any]]) -> str:
    """One line per level, for a contact one per level and node."""
    stream = io.StringIO()
    writer = csv.writer(stream, lineterminator="\n")
    columns = [key for key in rows[0] if key not in _ORIGIN_KEYS]
    writer.writerow(columns)
    for row in rows:
        values = [plain(row[key]) for key in columns]
        count = next((len(value) for value in values if isinstance(value, list)), 1)
        spread = [value if isinstance(value, list) else [value] * count for value in values]
        writer.writerows(zip(*spread, strict=True))
    return stream.getvalue()
