"""``mlsanm probe``: options, tables and CSV output."""

from __future__ import annotations

import csv
import io
import math
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import click

from mlsanm_cli.app.results.choice import POINT_FIELDS, QUANTITIES
from mlsanm_cli.cli import declare
from mlsanm_cli.cli.console import TerminalConsole
from mlsanm_cli.cli.running import of_app, pretty_result, print_result
from mlsanm_cli.cli.settings import Settings, say
from mlsanm_cli.cli.text import grid, label, number
from mlsanm_cli.errors import RunError
from mlsanm_cli.roundoff import ROUND_OFF
from mlsanm_cli.toml import plain

_ORIGINS = {
    "stored": "",
    "series": "from the power series of the step",
    "linear": "interpolated (linear problem)",
    "interpolated": "interpolated, error {error:.2g} % of the largest value",
}
POINT_HINT = "as in --body block --point 0,-0.5"
_ORIGIN_KEYS = ("how", "error")


class PointType(click.ParamType[tuple[float, float]]):
    """Two numbers separated by a comma."""

    name = "X,Y"

    def convert(
        self, value: Any, param: click.Parameter | None, ctx: click.Context | None
    ) -> tuple[float, float]:
        """The point; usage error for anything else."""
        try:
            x, y = (float(part) for part in str(value).split(","))
        except ValueError:
            self.fail(f'"{value}" is not a point; write --point 0.5,1.0', param, ctx)
        if not (math.isfinite(x) and math.isfinite(y)):
            self.fail("nan and inf are not allowed", param, ctx)
        return x, y


@declare.command(
    declare.RUNDIR,
    click.option(
        "--at", type=float, multiple=True, help="Position on the load path. Repeatable.  [default: the end]"
    ),
    declare.name_option("contact", "Results along a contact.", "contact"),
    click.option(
        "--quantity",
        "quantities",
        type=click.Choice(QUANTITIES),
        multiple=True,
        help="Quantity of the contact. Repeatable.  [default: all]",
    ),
    declare.name_option("force", "Force of a load, support or contact.", "load", "support", "contact"),
    declare.name_option("probe", "Results of a [[probe]] of the case.", "probe"),
    declare.name_option("body", "Body with the --point.", "body"),
    click.option("--point", type=PointType(), help="Coordinates of a point in the undeformed body."),
    click.option(
        "--field", type=click.Choice(POINT_FIELDS), help="Field at the point or probe.  [default: all]"
    ),
    click.option("--csv", "as_csv", is_flag=True, help="Print the result as CSV on stdout."),
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
    for wrong, message, hint in (
        (
            len(targets) > 1,
            "more than one result selected",
            "give one of --contact, --force, --probe, --body",
        ),
        (("body" in targets) != (point is not None), "--body and --point are needed together", POINT_HINT),
        (quantities and "contact" not in targets, "--quantity needs a contact", "add --contact NAME"),
        (
            field is not None and not targets.keys() & {"body", "probe"},
            "--field needs a point",
            "add --body and --point, or --probe",
        ),
        (as_csv and settings.json, "--csv and --json exclude each other", "give one of them"),
    ):
        if wrong:
            raise RunError(message, hint)
    if not targets and not at:
        contents = of_app("results.probe.contents")(rundir)
        print_result(settings, contents, pretty_result(settings, contents))
        return 0
    kind, name = next(iter(targets.items()), ("contacts", ""))
    title = f"{kind} {name}".rstrip()
    if kind == "contacts":
        rows = of_app("results.probe.probe_everything")(rundir, at)
    elif kind == "contact":
        rows = of_app("results.probe.probe_contact")(rundir, at, name, quantities)
    elif kind == "force":
        title, rows = f"force of {name}", of_app("results.probe.probe_force")(rundir, at, name)
    elif kind == "probe":
        rows = of_app("results.probe.probe_named")(rundir, at, name, field)
    else:
        assert point is not None
        title = f"{name} at ({point[0]:g}, {point[1]:g})"
        rows = of_app("results.probe.probe_point")(rundir, at, name, point, field)
    if as_csv:
        for row in rows:
            if "error" in row:
                TerminalConsole(sys.stderr, settings).warning(
                    f"position {number(row['position'])}: {_origin(row)}"
                )
        say(settings, _csv(rows), newline=False)
        return 0
    print_result(settings, {"levels": rows}, _text(title, rows, settings.paints(sys.stdout)))
    return 0


def _text(title: str, rows: Sequence[Mapping[str, Any]], color: bool) -> str:
    """One table over the load levels; for a contact one table per level."""
    if any(hasattr(value, "tolist") for value in rows[0].values()):
        return "\n".join(_nodes(title, row, color) for row in rows)
    columns = [key for key in rows[0] if key not in _ORIGIN_KEYS]
    cells = [[*(number(row[key]) for key in columns), _origin(row)] for row in rows]
    return grid(title, [*map(label, columns), ""], cells, color)


def _origin(row: Mapping[str, Any]) -> str:
    """The origin of a row in words, "" if it is stored."""
    error = float(row.get("error", 0.0))
    if row["how"] == "interpolated" and error < ROUND_OFF:
        return "interpolated to round-off"
    return _ORIGINS[row["how"]].format(error=100.0 * error)


def _nodes(title: str, row: Mapping[str, Any], color: bool) -> str:
    columns = [key for key in row if key not in ("position", *_ORIGIN_KEYS)]
    origin = f", {_origin(row)}" if _origin(row) else ""
    cells = [list(map(number, values)) for values in zip(*(plain(row[key]) for key in columns), strict=True)]
    return grid(f"{title}, position {number(row['position'])}{origin}", [*map(label, columns)], cells, color)


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
