"""Base class of the tables of the case file, and the field types they share."""

from __future__ import annotations

import ast
import inspect
import math
import re
import textwrap
from dataclasses import dataclass
from functools import partial
from itertools import pairwise
from typing import Annotated, Any, Literal

from pydantic import (
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    GetJsonSchemaHandler,
    PlainValidator,
    WithJsonSchema,
)
from pydantic.json_schema import JsonSchemaValue
from pydantic_core import CoreSchema, PydanticCustomError, PydanticKnownError

from mlsanm_cli.case.model.expressions import ExpressionError, compile_expression

NAME_PATTERN = re.compile(r"[A-Za-z0-9_-]*[A-Za-z_-][A-Za-z0-9_-]*")
MAX_NAME_LENGTH = 80
"""Names become parts of file names."""
MAX_DEGREE = 6
Point = tuple[float, float]
BOUNDARY_PATTERN = re.compile(r"[^.\s]+\.[^.\s]+")


class Section(BaseModel):
    """A table of the case file: frozen, no unknown keys, no nan or inf, no conversion between types. The
    docstring below a key is its description in `mlsanm explain`, the case reference and the JSON Schema; the
    docstring of the class describes the table."""

    # Deferred: the validator of the whole case is built once, when it is needed, not that of each table.
    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False, defer_build=True)

    @classmethod
    def __get_pydantic_json_schema__(
        cls, core_schema: CoreSchema, handler: GetJsonSchemaHandler
    ) -> JsonSchemaValue:
        """Adds the docstrings here: pydantic would parse all source files for them at every start."""
        found = handler(core_schema)
        keys = handler.resolve_ref_schema(found)["properties"]
        for name, text in _docstrings(cls).items():
            keys[cls.model_fields[name].alias or name]["description"] = text
        return found


def _docstrings(table: type[BaseModel]) -> dict[str, str]:
    """The docstrings below the fields of a table, by field."""
    found = {}
    for owner in reversed(table.__mro__[: table.__mro__.index(Section)]):
        (tree,) = ast.parse(textwrap.dedent(inspect.getsource(owner))).body
        assert isinstance(tree, ast.ClassDef)
        for key, below in pairwise(tree.body):
            if isinstance(key, ast.AnnAssign) and isinstance(below, ast.Expr):
                assert isinstance(key.target, ast.Name)
                found[key.target.id] = inspect.cleandoc(ast.literal_eval(below.value))
    return found


@dataclass(frozen=True)
class Unit:
    """Unit of a number, shown by `mlsanm explain` and in the JSON Schema."""

    name: str

    def __get_pydantic_json_schema__(
        self, core_schema: CoreSchema, handler: GetJsonSchemaHandler
    ) -> JsonSchemaValue:
        return {**handler(core_schema), UNIT: self.name}


UNIT = "x-unit"
LENGTH, STRESS, FORCE = Unit("length"), Unit("stress"), Unit("force per thickness")
ANGLE, NUMBER = Unit("degrees"), Unit("dimensionless")
DENSITY, FOUNDATION = Unit("force per volume"), Unit("stress per length")
TEMPERATURE, EXPANSION = Unit("temperature"), Unit("per temperature")
RADIANS, MOMENT = Unit("radian"), Unit("moment per thickness")


def _two_items(value: Any) -> Any:
    if not isinstance(value, tuple) or len(value) != 2:
        raise PydanticCustomError("vector", "expected two numbers, as in [0.0, 1.0]")
    return value


def _name(value: Any) -> str:
    if isinstance(value, str) and len(value) > MAX_NAME_LENGTH:
        raise PydanticCustomError("name", f"a name has at most {MAX_NAME_LENGTH} characters")
    if not isinstance(value, str) or NAME_PATTERN.fullmatch(value) is None:
        raise PydanticCustomError("name", "a name consists of letters, digits, _ and -, and is not a number")
    return value


def _auto_or_whole(value: Any, most: int | None) -> int | Literal["auto"]:
    if value == "auto":
        return "auto"
    if isinstance(value, bool) or not isinstance(value, int) or not 1 <= value <= (most or value):
        whole = f"from 1 to {most}" if most else "above 0"
        raise PydanticCustomError("auto_or_whole", f'expected "auto" or a whole number {whole}')
    return value


def _auto_or_length(value: Any) -> float | Literal["auto"]:
    if value == "auto":
        return "auto"
    number = float("nan")
    if isinstance(value, int | float) and not isinstance(value, bool):
        try:
            number = float(value)
        except OverflowError:
            number = float("inf")
    if not 0.0 < number < float("inf"):
        raise PydanticCustomError("auto_or_length", 'expected "auto" or a number above 0')
    return number


def _finite(value: Any, expected: str) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise PydanticCustomError("number_or_word", "{expected}", {"expected": expected})
    if not math.isfinite(value):
        raise PydanticCustomError("finite_number", "nan and inf are not allowed")
    return float(value)


def _coefficient(value: Any) -> float | Literal["bonded"]:
    if value == "bonded":
        return "bonded"
    number = _finite(value, 'expected a number of at least 0, or "bonded"')
    if number < 0.0:
        raise PydanticKnownError("greater_than_equal", {"ge": 0})
    return number


def _rotation(value: Any) -> float | Literal["fixed", "free"]:
    if isinstance(value, str) and value in ("fixed", "free"):
        return "fixed" if value == "fixed" else "free"
    return _finite(value, 'expected "fixed", "free", or an angle in radian')


def _amount(value: Any) -> float | str:
    if not isinstance(value, str):
        return _finite(value, "expected a number, or an expression in x and y in quotes")
    try:
        compile_expression(value)
    except ExpressionError as error:
        raise PydanticCustomError("expression", "{problem}", {"problem": str(error)}) from error
    return value


Vector = Annotated[tuple[float, float], BeforeValidator(_two_items)]
"""Two finite numbers."""

Amount = Annotated[
    float | str, PlainValidator(_amount), WithJsonSchema({"anyOf": [{"type": "number"}, {"type": "string"}]})
]
"""A finite number, or an expression in x and y."""

AmountVector = Annotated[tuple[Amount, Amount], BeforeValidator(_two_items)]
"""Two numbers or expressions in x and y."""

Positive = Annotated[float, Field(gt=0.0)]
"""A finite number above 0."""

Name = Annotated[
    str,
    PlainValidator(_name),
    WithJsonSchema({"type": "string", "pattern": f"^{NAME_PATTERN.pattern}$", "maxLength": MAX_NAME_LENGTH}),
]
"""The name of a body, load, contact or material."""

AutoCount = Annotated[
    int | Literal["auto"],
    PlainValidator(partial(_auto_or_whole, most=None)),
    WithJsonSchema({"anyOf": [{"const": "auto"}, {"type": "integer", "exclusiveMinimum": 0}]}),
]
AutoDegree = Annotated[
    int | Literal["auto"],
    PlainValidator(partial(_auto_or_whole, most=MAX_DEGREE)),
    WithJsonSchema({"anyOf": [{"const": "auto"}, {"type": "integer", "minimum": 1, "maximum": MAX_DEGREE}]}),
]
AutoLength = Annotated[
    float | Literal["auto"],
    PlainValidator(_auto_or_length),
    WithJsonSchema({"anyOf": [{"const": "auto"}, {"type": "number", "exclusiveMinimum": 0.0}]}),
]


Rotation = Annotated[
    float | Literal["fixed", "free"],
    PlainValidator(_rotation),
    WithJsonSchema({"anyOf": [{"enum": ["fixed", "free"]}, {"type": "number"}]}),
]
"""Rotation of a plate: fixed, free, or a prescribed angle."""

Coefficient = Annotated[
    float | Literal["bonded"],
    PlainValidator(_coefficient),
    WithJsonSchema({"anyOf": [{"const": "bonded"}, {"type": "number", "minimum": 0.0}]}),
]
"""A coefficient of friction, or bonded surfaces."""


def split_boundary(boundary: str) -> tuple[str, str]:
    """Body and edge of a boundary name.

    >>> split_boundary("block.top")
    ('block', 'top')
    """
    body, _, edge = boundary.partition(".")
    return body, edge
