"""Quantities that depend on position: expressions in x and y, and tables in CSV files.

Expressions are parsed as Python and checked, never run as such. Only numbers, x, y, pi, arithmetic,
comparisons, conditionals (``a if x < 1 else b``) and the functions below are allowed. All numbers are floats,
which bounds their size. Tables are read by validation into the case, which is then self-contained; its
context is the folder to which names of files are relative, None in a resolved case.
"""

from __future__ import annotations

import ast
import io
import math
import operator
import re
from collections.abc import Callable, Iterator, Mapping
from functools import lru_cache
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

from mlsanm_cli.case.report import MAX_ITEMS, magnitude_problem, suggestion
from mlsanm_cli.errors import RunError
from mlsanm_cli.inputs import MAX_TEXT_BYTES, read_input

MAX_CHARACTERS = 500
MAX_DEPTH = 100

Value = Callable[[float, float], float]
Operation = Callable[..., float]

_UNARY = ("acos", "asin", "atan", "cos", "cosh", "exp", "log", "sin", "sinh", "sqrt", "tan", "tanh")
_OTHERS = {
    "abs": (math.fabs, 1, 1),
    "atan2": (math.atan2, 2, 2),
    "hypot": (math.hypot, 2, 2),
    "max": (max, 2, 20),
    "min": (min, 2, 20),
}
FUNCTIONS: Mapping[str, tuple[Operation, int, int]] = dict(
    sorted({**{name: (getattr(math, name), 1, 1) for name in _UNARY}, **_OTHERS}.items())
)
"""Functions with their smallest and largest number of arguments."""
NAMES: Mapping[str, Value] = {"x": lambda x, y: x, "y": lambda x, y: y, "pi": lambda x, y: math.pi}
_BINARY: Mapping[type[ast.operator], Operation] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
    # Never complex; raises OverflowError for powers that as integers would fill the memory.
    ast.Pow: math.pow,
}
_COMPARED: Mapping[type[ast.cmpop], Callable[[float, float], bool]] = {
    ast.Lt: operator.lt,
    ast.LtE: operator.le,
    ast.Gt: operator.gt,
    ast.GtE: operator.ge,
}

NO_UNITS = "numbers have no units: use any consistent ones, as mm, N and MPa"
_WITH_UNIT = re.compile(r"\s*[-+]?[\d.]+(e[-+]?\d+)?\s*[^\W\d_][\w/^²*]*\s*", re.IGNORECASE)


def with_unit(text: str) -> bool:
    """Whether a text is a number with a unit.

    >>> with_unit("70 GPa"), with_unit("1e-3mm"), with_unit("2*x"), with_unit("30")
    (True, True, False, False)
    """
    return _WITH_UNIT.fullmatch(text) is not None


class ExpressionError(ValueError):
    """An invalid expression, or one without a finite value at a point."""

    def __init__(self, message: str, hint: str = "") -> None:
        super().__init__(f"{message} ({hint})" if hint else message)


@lru_cache(maxsize=256)
def compile_expression(text: str) -> Value:
    """The function of x and y that a text describes. Raises ExpressionError.

    >>> compile_expression("2*x**2 - y if x > 0 else 0")(3.0, 1.0)
    17.0
    """
    if len(text) > MAX_CHARACTERS:
        raise ExpressionError(f"an expression has at most {MAX_CHARACTERS} characters, not {len(text)}")
    try:
        tree = ast.parse(text.strip(), mode="eval")
    except (SyntaxError, ValueError, RecursionError, MemoryError) as error:
        hint = NO_UNITS if with_unit(text) else ""
        raise ExpressionError(f'"{text}" is not an expression in x and y', hint) from error
    return _compiled(tree.body, MAX_DEPTH)


def value_at(text: str, x: float, y: float) -> float:
    """The finite value of an expression at a point. Raises ExpressionError."""
    try:
        value = compile_expression(text)(x, y)
    except ZeroDivisionError as error:
        raise ExpressionError(f'"{text}" divides by zero at ({x:.6g}, {y:.6g})') from error
    except (ValueError, OverflowError) as error:
        raise ExpressionError(f'"{text}" has no value at ({x:.6g}, {y:.6g})') from error
    if not math.isfinite(value):
        raise ExpressionError(f'"{text}" is not finite at ({x:.6g}, {y:.6g})')
    return value


def _compiled(node: ast.expr, depth: int) -> Value:
    if depth == 0:
        raise ExpressionError(f"an expression is nested at most {MAX_DEPTH} levels deep")

    def part(inner: ast.expr) -> Value:
        return _compiled(inner, depth - 1)

    match node:
        case ast.Constant(constant):
            if isinstance(constant, bool) or not isinstance(constant, int | float):
                raise ExpressionError(f"{constant!r} is not a number")
            try:
                number = float(constant)
            except OverflowError as error:
                raise ExpressionError("a number is too large") from error
            return lambda x, y: number
        case ast.Name(name) if name in NAMES:
            return NAMES[name]
        case ast.Name(name) if name in FUNCTIONS:
            raise ExpressionError(f"{name} is a function", f"write {name}(...)")
        case ast.Name(name):
            raise ExpressionError(f'"{name}" is not defined', suggestion(name, [*NAMES, *FUNCTIONS], "known"))
        case ast.UnaryOp(ast.USub() | ast.UAdd() as sign, operand):
            value = part(operand)
            return value if isinstance(sign, ast.UAdd) else lambda x, y: -value(x, y)
        case ast.BinOp(left, sign, right) if type(sign) in _BINARY:
            return _applied(_BINARY[type(sign)], [part(left), part(right)])
        case ast.IfExp(test, body, orelse):
            chosen, yes, no = part(test), part(body), part(orelse)
            return lambda x, y: yes(x, y) if chosen(x, y) else no(x, y)
        case ast.BoolOp(sign, values):
            every, parts = all if isinstance(sign, ast.And) else any, list(map(part, values))
            return lambda x, y: float(every(one(x, y) for one in parts))
        case ast.Compare(left, signs, others) if all(type(sign) in _COMPARED for sign in signs):
            tests, parts = [_COMPARED[type(sign)] for sign in signs], list(map(part, [left, *others]))
            return lambda x, y: float(
                all(test(a(x, y), b(x, y)) for test, (a, b) in zip(tests, pairwise(parts), strict=True))
            )
        case ast.Call(ast.Name(name), arguments, keywords) if name in FUNCTIONS:
            function, least, most = FUNCTIONS[name]
            if keywords or not least <= len(arguments) <= most:
                wanted = f"{least}" if least == most else f"{least} or more"
                raise ExpressionError(f"{name} takes {wanted} arguments, not {len(arguments)}")
            return _applied(function, list(map(part, arguments)))
        case ast.Call(called):
            quoted = f'"{ast.unparse(called)}"'
            raise ExpressionError(f"{quoted} cannot be called", suggestion(quoted, FUNCTIONS, "functions"))
    power = isinstance(node, ast.BinOp) and isinstance(node.op, ast.BitXor)
    hint = "powers are written x**2" if power else ""
    raise ExpressionError(f'"{ast.unparse(node)}" is not allowed in an expression in x and y', hint)


def _applied(operation: Operation, parts: list[Value]) -> Value:
    return lambda x, y: operation(*(part(x, y) for part in parts))


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
