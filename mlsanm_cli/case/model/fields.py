"""Types of the keys of the case file, and the units of numbers."""

from __future__ import annotations

import re
from typing import Annotated, Any, Literal

from pydantic import (
    AfterValidator,
    BeforeValidator,
    Field,
    GetJsonSchemaHandler,
    ValidationError,
    ValidatorFunctionWrapHandler,
    WrapValidator,
)
from pydantic.json_schema import JsonSchemaValue
from pydantic_core import CoreSchema, PydanticCustomError, PydanticKnownError

from mlsanm_cli.case.model.expressions import ExpressionError, compile_expression

BOUNDARY_PATTERN = re.compile(r"[^.\s]+\.[^.\s]+")


class Unit(str):
    """Unit of a number, shown by `mlsanm explain` and in the JSON Schema."""

    def __get_pydantic_json_schema__(
        self, core_schema: CoreSchema, handler: GetJsonSchemaHandler
    ) -> JsonSchemaValue:
        return {**handler(core_schema), UNIT: str(self)}


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


def expecting(text: str) -> WrapValidator:
    """Reports a value that fits no member of a union with one ``text``; nan, inf and faulty expressions with
    their own."""

    def check(value: Any, handler: ValidatorFunctionWrapHandler) -> Any:
        try:
            return handler(value)
        except ValidationError as error:
            found = {one["type"]: one["msg"] for one in error.errors(include_url=False)}
            if "finite_number" in found:
                raise PydanticKnownError("finite_number") from error
            raise PydanticCustomError(
                "expected", "{text}", {"text": found.get("expression", text)}
            ) from error

    return WrapValidator(check)


def _expression(text: str) -> str:
    try:
        compile_expression(text)
    except ExpressionError as error:
        raise PydanticCustomError("expression", "{problem}", {"problem": str(error)}) from error
    return text


Vector = Annotated[tuple[float, float], BeforeValidator(_two_items)]
"""Two finite numbers."""

Amount = Annotated[
    float | Annotated[str, AfterValidator(_expression)],
    expecting("expected a number, or an expression in x and y in quotes"),
]
"""A finite number, or an expression in x and y."""

AmountVector = Annotated[tuple[Amount, Amount], BeforeValidator(_two_items)]
"""Two numbers or expressions in x and y."""

Positive = Annotated[float, Field(gt=0.0)]
"""A finite number above 0."""

Name = Annotated[
    str,
    Field(pattern=r"^[A-Za-z0-9_-]*[A-Za-z_-][A-Za-z0-9_-]*$", max_length=80),
    expecting("a name has at most 80 letters, digits, _ and -, and is not a number"),
]
"""The name of a body, load, contact or material, part of file names."""

AutoCount = Annotated[
    Literal["auto"] | Annotated[int, Field(gt=0)], expecting('expected "auto" or a whole number above 0')
]
AutoDegree = Annotated[
    Literal["auto"] | Annotated[int, Field(ge=1, le=6)],
    expecting('expected "auto" or a whole number from 1 to 6'),
]
AutoLength = Annotated[Literal["auto"] | Positive, expecting('expected "auto" or a number above 0')]

Rotation = Annotated[
    Literal["fixed", "free"] | float, expecting('expected "fixed", "free", or an angle in radian')
]
"""Rotation of a plate: fixed, free, or a prescribed angle."""

Coefficient = Annotated[
    Literal["bonded"] | Annotated[float, Field(ge=0.0)],
    expecting('expected a number of at least 0, or "bonded"'),
]
"""A coefficient of friction, or bonded surfaces."""


def split_boundary(boundary: str) -> tuple[str, str]:
    """Body and edge of a boundary name.

    >>> split_boundary("block.top")
    ('block', 'top')
    """
    body, _, edge = boundary.partition(".")
    return body, edge
