"""Tables of loads and points of curves, read from CSV files into the case, which makes it self-contained."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Callable
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


def with_items(data: dict[str, Any], section: str, change: Callable[[int, Any], Any]) -> dict[str, Any]:
    """The content of a case with the items of a list, if there is one, replaced by ``change`` of their number
    and content."""
    items = data.get(section)
    if not isinstance(items, tuple):
        return data
    return {**data, section: tuple(change(number, item) for number, item in enumerate(items))}


def inline_tables(data: dict[str, Any], base: Path) -> tuple[dict[str, Any], list[tuple[KeyPath, str]]]:
    """The content of a case with the rows of tables in place of file names, which are relative to ``base``.
    Also returns the problems found, by key; there the file name remains."""
    problems: list[tuple[KeyPath, str]] = []

    def inlined(item: Any, key: KeyPath, to: str, header: tuple[str, ...] | None, most: int) -> Any:
        """The item with rows under the key ``to`` in place of the file named by the last part of ``key``."""
        name = key[-1]
        try:
            rows = read_table(base / item[name], header, most)
        except TableError as error:
            problems.append((key, str(error)))
            return item
        return {**{other: value for other, value in item.items() if other != name}, to: rows}

    def of_load(index: int, load: Any) -> Any:
        match load:
            case {"table": str(), **others}:
                header = HEADERS.get(str(others.get("kind")))
                return inlined(load, ("load", index, "table"), "table", header, MAX_ROWS)
        return load

    def of_body(index: int, body: Any) -> Any:
        match body:
            case {"shape": {"sides": tuple(sides)} as shape}:
                here: KeyPath = ("body", index, "shape", "sides")
                filled = tuple(of_side((*here, number, "file"), side) for number, side in enumerate(sides))
                return {**body, "shape": {**shape, "sides": filled}}
        return body

    def of_side(key: KeyPath, side: Any) -> Any:
        match side:
            case {"file": str(file), **others} if file and not others.keys() & {"points", "to"}:
                return inlined(side, key, "points", POINT_HEADER, MAX_POINTS)
        return side

    return with_items(with_items(data, "load", of_load), "body", of_body), problems


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
