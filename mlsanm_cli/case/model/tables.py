"""Tables of loads and points of curves in CSV files. Validation reads them into the case, which is then
self-contained; its context is the folder to which names of files are relative, None in a resolved case."""

from __future__ import annotations

import io
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path
from typing import Any

from pydantic import (
    AfterValidator,
    GetCoreSchemaHandler,
    GetJsonSchemaHandler,
    ValidationError,
    ValidationInfo,
)
from pydantic.json_schema import JsonSchemaValue
from pydantic_core import CoreSchema, InitErrorDetails, PydanticCustomError, core_schema

from mlsanm_cli.case.limits import MAX_ITEMS, magnitude_problem
from mlsanm_cli.errors import RunError
from mlsanm_cli.inputs import MAX_TEXT_BYTES, read_input

Rows = tuple[tuple[float, ...], ...]


class OrFile:
    """Rows of numbers, or the name of a CSV file with them, whose first line is ``header``."""

    def __init__(self, *header: str) -> None:
        self.header = header

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        def read(value: Any, info: ValidationInfo) -> Any:
            named = isinstance(value, str) and info.context is not None
            return _rows(info.context / value, self.header, MAX_ITEMS["table"]) if named else value

        return core_schema.with_info_before_validator_function(read, handler(source))

    def __get_pydantic_json_schema__(
        self, schema: CoreSchema, handler: GetJsonSchemaHandler
    ) -> JsonSchemaValue:
        return {"anyOf": [handler(schema), {"type": "string"}]}


def with_points(side: Any, info: ValidationInfo) -> Any:
    """A raw side of an outline with the points of its file in place of the name."""
    match side:
        case {"file": str(file), **others} if file and not others.keys() & {"points", "to"} and info.context:
            try:
                return {**others, "points": _rows(info.context / file, ("x", "y"), MAX_ITEMS["points"])}
            except PydanticCustomError as error:
                place = InitErrorDetails(type=error, loc=("file",), input=file)
                raise ValidationError.from_exception_data("file", [place]) from error
    return side


def _rows(path: Path, header: tuple[str, ...], most: int) -> Rows:
    import csv

    try:
        file = io.StringIO(read_input(path, MAX_TEXT_BYTES).decode("utf-8-sig"), newline="")
        lines = [(number, row) for number, row in enumerate(csv.reader(file), start=1) if any(row)]
    except RunError as error:
        raise _problem(f"{error.message} ({error.hint})" if error.hint else error.message) from error
    except (UnicodeDecodeError, csv.Error) as error:
        raise _problem(f"{path} is not CSV text") from error
    if not lines or tuple(cell.strip() for cell in lines[0][1]) != header:
        raise _problem(f"{path} must begin with the line {','.join(header)}")
    if len(lines) > most + 1:
        raise _problem(f"{path} has more than {most} rows")

    def numbers(line: int, row: list[str]) -> Iterator[float]:
        if len(row) != len(header):
            raise _problem(f"{path}, line {line}: {len(row)} columns instead of {len(header)}")
        for cell in map(str.strip, row):
            try:
                number = float(cell)
            except ValueError as error:
                raise _problem(f'{path}, line {line}: "{cell}" is not a number') from error
            problem = magnitude_problem(number) if abs(number) < float("inf") else f"{cell} is not allowed"
            if problem:
                raise _problem(f"{path}, line {line}: {problem}")
            yield number

    return tuple(tuple(numbers(line, row)) for line, row in lines[1:])


def _increasing(rows: Rows) -> Rows:
    if len(rows) < 2:
        raise _problem("a table needs at least two rows")
    for number, (before, after) in enumerate(pairwise(rows), start=2):
        if not before[0] < after[0]:
            text = f"arc lengths must increase: row {number} has {after[0]:g} after {before[0]:g}"
            raise _problem(text)
    return rows


INCREASING = AfterValidator(_increasing)
"""Rows over the arc length, at least two."""


def _problem(text: str) -> PydanticCustomError:
    return PydanticCustomError("table", "{problem}", {"problem": text})
