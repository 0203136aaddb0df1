"""Base class of the tables of the case file, what they are checked against (the other tables and the geometry
of the bodies), and the types of their keys."""

from __future__ import annotations

import ast
import inspect
import re
import textwrap
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import field, replace
from itertools import pairwise, takewhile
from typing import TYPE_CHECKING, Annotated, Any, Literal, TypeVar

from pydantic import (
    AfterValidator,
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    GetJsonSchemaHandler,
    ValidationError,
    ValidatorFunctionWrapHandler,
    WrapValidator,
)
from pydantic.json_schema import JsonSchemaValue
from pydantic_core import CoreSchema, PydanticCustomError, PydanticKnownError

from mlsanm_cli.case.model.expressions import compile_expression
from mlsanm_cli.case.report import KeyPath
from mlsanm_cli.errors import Fault
from mlsanm_cli.records import dataclass
from mlsanm_cli.roundoff import ROUND_OFF

if TYPE_CHECKING:
    from mlsanm_cli.case.model.case import Case

Point = tuple[float, float]
Item = TypeVar("Item")


@dataclass(frozen=True)
class Geometry:
    """Names of ``boundaries``, centre, larger side and ``left`` end of the bounding box, SHA-256 of the
    file."""

    boundaries: tuple[str, ...]
    centre: Point
    size: float
    left: float
    digest: str = ""


@dataclass(frozen=True)
class Scope:
    """A case whose tables are valid by themselves, the ``geometries`` of its valid shapes by body, and the
    section and name of items that are ``absent``, as they are not valid, "" of those with an invalid part."""

    case: Case
    geometries: Mapping[str, Geometry] = field(default_factory=dict)
    absent: tuple[tuple[str, str], ...] = ()

    @property
    def strain(self) -> str:
        return self.case.model.strain

    @property
    def confined(self) -> bool:
        return self.case.model.confined

    def names(self, section: str) -> tuple[str, ...]:
        """The names of all items of a section, those of absent ones last."""
        items = getattr(self.case, section)
        names = tuple(items) if isinstance(items, dict) else tuple(item.name for item in items)
        return (*names, *filter(None, self.missing(section)))

    def missing(self, section: str) -> tuple[str, ...]:
        """The names of absent items of a section, "" of those with an invalid part."""
        return tuple(name for owner, name in self.absent if owner == section)

    def refused(self, given: object, key: KeyPath, what: str, hint: str) -> Iterator[Fault]:
        """A fault if something is ``given`` that finite strain does not support."""
        if given and self.strain == "finite":
            yield Fault(key, f"{what} with finite strain is not supported yet", hint)

    def finite_only(self, given: object, key: KeyPath, what: str) -> Iterator[Fault]:
        """A fault if something is ``given`` that only finite strain supports."""
        if given and self.strain == "small":
            hint = 'write strain = "finite" in [model], or remove the key'
            yield Fault(key, f"{what} needs finite strain", hint)


class Section(BaseModel):
    """A table of the case file: frozen, no unknown keys, no nan or inf, no conversion between types. The
    docstring below a key is its description in `mlsanm explain`, the case reference and the JSON Schema; the
    docstring of the class describes the table. Files with tables do not postpone the evaluation of
    annotations: as texts, pydantic would compile each of them at every start (10 ms)."""

    # Deferred: the validator of the whole case is built once, when it is needed, not that of each table.
    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False, defer_build=True)

    @classmethod
    def __get_pydantic_json_schema__(cls, core: CoreSchema, handler: GetJsonSchemaHandler) -> JsonSchemaValue:
        """Adds the docstrings here: pydantic would parse all source files for them at every start."""
        schema = handler(core)
        keys = handler.resolve_ref_schema(schema)["properties"]
        for owner in reversed(cls.__mro__[: cls.__mro__.index(Section)]):
            (tree,) = ast.parse(textwrap.dedent(inspect.getsource(owner))).body
            assert isinstance(tree, ast.ClassDef)
            for key, below in pairwise(tree.body):
                if isinstance(key, ast.AnnAssign) and isinstance(below, ast.Expr):
                    name, text = ast.unparse(key.target), inspect.cleandoc(ast.literal_eval(below.value))
                    keys[cls.model_fields[name].alias or name]["description"] = text
        return schema

    def given(self, *keys: str) -> list[str]:
        """Those of the keys that have a value."""
        return [key for key in keys if getattr(self, key) is not None]

    def earlier(self, items: Iterable[Item]) -> list[Item]:
        """The items of its list that precede this table."""
        return list(takewhile(lambda item: item is not self, items))

    def exclusive(self, *keys: str, required: bool = True) -> Iterator[Fault]:
        """A fault if more than one of the keys is given, or none although one is ``required``."""
        given, names = self.given(*keys), ", ".join(f'"{key}"' for key in keys)
        if required and not given:
            yield Fault((), f"needs one of {names}")
        if len(given) > 1:
            yield Fault((given[1],), f'"{given[0]}" is given too', f"only one of {names}")

    def faults(self, scope: Scope) -> Iterator[Fault]:
        """Relations between keys of this table, and with other tables in ``scope``, that do not hold; paths
        of keys are relative to the table."""
        yield from ()


def all_faults(value: Any, scope: Scope, path: KeyPath = ()) -> Iterator[Fault]:
    """The faults of a table at a path, those of its base classes first, and of all tables in it, each with
    its full path."""
    items: list[tuple[str | int, Any]] = []
    if isinstance(value, Section):
        for owner in reversed(type(value).__mro__):
            if issubclass(owner, Section) and "faults" in vars(owner):
                yield from (replace(one, key=(*path, *one.key)) for one in owner.faults(value, scope))
        fields = type(value).model_fields
        items = [(field.alias or name, getattr(value, name)) for name, field in fields.items()]
    elif isinstance(value, dict):
        items = list(value.items())
    elif isinstance(value, tuple) and value and isinstance(value[0], Section):
        items = list(enumerate(value))
    for step, item in items:
        yield from all_faults(item, scope, (*path, step))


BOUNDARY_PATTERN = re.compile(r"[^.\s]+\.[^.\s]+")


class Unit(str):
    """Unit of a number, shown by `mlsanm explain` and in the JSON Schema."""

    def __get_pydantic_json_schema__(
        self, core: CoreSchema, handler: GetJsonSchemaHandler
    ) -> JsonSchemaValue:
        return {**handler(core), UNIT: str(self)}


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
    """Reports a value that fits no member of a union with one ``text``; nan, inf and expressions with their
    own."""

    def check(value: Any, handler: ValidatorFunctionWrapHandler) -> Any:
        try:
            return handler(value)
        except ValidationError as error:
            reasons = {one["type"]: one.get("ctx", {}) for one in error.errors(include_url=False)}
            if "finite_number" in reasons:
                raise PydanticKnownError("finite_number") from error
            problem = reasons.get("value_error", {}).get("error", text)
            raise PydanticCustomError("expected", "{text}", {"text": str(problem)}) from error

    return WrapValidator(check)


def _expression(text: str) -> str:
    compile_expression(text)
    return text


Vector = Annotated[tuple[float, float], BeforeValidator(_two_items)]
Amount = Annotated[
    float | Annotated[str, AfterValidator(_expression)],
    expecting("expected a number, or an expression in x and y in quotes"),
]
AmountVector = Annotated[tuple[Amount, Amount], BeforeValidator(_two_items)]
Positive = Annotated[float, Field(gt=0.0)]
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
Coefficient = Annotated[
    # 0 where tractions would be round-off of the pressures.
    Literal["bonded"]
    | Annotated[float, Field(ge=0.0), AfterValidator(lambda value: value if value > ROUND_OFF else 0.0)],
    expecting('expected a number of at least 0, or "bonded"'),
]


def split_boundary(boundary: str) -> tuple[str, str]:
    """Body and edge of a boundary name.

    >>> split_boundary("block.top")
    ('block', 'top')
    """
    body, _, edge = boundary.partition(".")
    return body, edge
