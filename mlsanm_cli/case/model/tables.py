"""Tables of loads and points of curves, read from CSV files into the case, which makes it self-contained."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Mapping
from itertools import pairwise
from pathlib import Path
from typing import Any

from mlsanm_cli.case.lines import KeyPath
from mlsanm_cli.errors import RunError
from mlsanm_cli.inputs import MB, read_input

HEADERS = {"pressure": ("s", "pressure"), "traction": ("s", "tx", "ty")}
"""Columns of the table by kind of load; s is the arc length."""
POINT_HEADER = ("x", "y")
"""Columns of the table of a curve."""
MAX_ROWS, MAX_POINTS = 100_000, 2000
MAX_BYTES = 16 * MB
"""Largest file of a table."""


class TableError(ValueError):
    """A table file that cannot be read or is invalid."""


def inline_tables(data: Mapping[str, Any], base: Path) -> tuple[dict[str, Any], list[tuple[KeyPath, str]]]:
    """The content of a case with the rows of tables in place of file names, which are relative to ``base``.
    Also returns the problems found, by key; there the file name remains."""
    content = dict(data)
    problems: list[tuple[KeyPath, str]] = []
    loads = data.get("load")
    if isinstance(loads, tuple):
        changed = []
        for index, load in enumerate(loads):
            if isinstance(load, Mapping) and isinstance(load.get("table"), str):
                try:
                    load = {
                        **load,
                        "table": read_table(base / load["table"], HEADERS.get(load.get("kind", ""))),
                    }
                except TableError as error:
                    problems.append((("load", index, "table"), str(error)))
            changed.append(load)
        content["load"] = tuple(changed)
    bodies = data.get("body")
    if isinstance(bodies, tuple):
        content["body"] = tuple(_with_points(k, body, base, problems) for k, body in enumerate(bodies))
    return content, problems


def _with_points(index: int, body: Any, base: Path, problems: list[tuple[KeyPath, str]]) -> Any:
    """A body with the points of its curves in place of file names."""
    shape = body.get("shape") if isinstance(body, Mapping) else None
    sides = shape.get("sides") if isinstance(shape, Mapping) else None
    if not isinstance(sides, tuple) or not isinstance(shape, Mapping):
        return body
    changed = []
    for number, side in enumerate(sides):
        file = side.get("file") if isinstance(side, Mapping) else None
        if isinstance(file, str) and file and "points" not in side and "to" not in side:
            try:
                points = read_table(base / file, POINT_HEADER, MAX_POINTS)
                side = {**{key: value for key, value in side.items() if key != "file"}, "points": points}
            except TableError as error:
                problems.append((("body", index, "shape", "sides", number, "file"), str(error)))
        changed.append(side)
    return {**body, "shape": {**shape, "sides": tuple(changed)}}


def read_table(
    path: Path, header: tuple[str, ...] | None, most: int = MAX_ROWS
) -> tuple[tuple[float, ...], ...]:
    """Rows of a CSV file whose first line is ``header``, at most ``most``. Raises TableError."""
    if header is None:
        raise TableError("loads of this kind have no table")
    try:
        file = io.StringIO(read_input(path, MAX_BYTES).decode("utf-8-sig"), newline="")
        lines = [(number, row) for number, row in enumerate(csv.reader(file), start=1) if any(row)]
    except RunError as error:
        raise TableError(f"{error.message} ({error.hint})" if error.hint else error.message) from error
    except (UnicodeDecodeError, csv.Error) as error:
        raise TableError(f"{path} is not CSV text") from error
    found = tuple(cell.strip() for cell in lines[0][1]) if lines else ()
    if found != header:
        raise TableError(f"{path} must begin with the line {','.join(header)}")
    if len(lines) > most + 1:
        raise TableError(f"{path} has more than {most} rows")
    return tuple(_numbers(path, number, row, len(header)) for number, row in lines[1:])


def _numbers(path: Path, line: int, row: list[str], columns: int) -> tuple[float, ...]:
    if len(row) != columns:
        raise TableError(f"{path}, line {line}: {len(row)} columns instead of {columns}")
    numbers = []
    for cell in row:
        try:
            number = float(cell)
        except ValueError as error:
            raise TableError(f'{path}, line {line}: "{cell.strip()}" is not a number') from error
        if not math.isfinite(number):
            raise TableError(f"{path}, line {line}: {cell.strip()} is not allowed")
        numbers.append(number)
    return tuple(numbers)


def row_problem(rows: tuple[tuple[float, ...], ...]) -> str:
    """The problem with the rows of a table, "" if there is none."""
    if len(rows) < 2:
        return "a table needs at least two rows"
    for number, (before, after) in enumerate(pairwise(rows), start=2):
        if not before[0] < after[0]:
            return f"arc lengths must increase: row {number} has {after[0]:g} after {before[0]:g}"
    return ""
