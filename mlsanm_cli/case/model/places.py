"""Regions: a boundary, several boundaries that form one surface, or a part of them."""

from collections.abc import Iterator
from functools import partial
from typing import Annotated, Any

from pydantic import Field, PlainValidator, WithJsonSchema
from pydantic_core import PydanticCustomError

from mlsanm_cli.case.model.section import (
    BOUNDARY_PATTERN,
    LENGTH,
    Point,
    Scope,
    Section,
    Vector,
    split_boundary,
)
from mlsanm_cli.errors import Fault
from mlsanm_cli.records import dataclass

_NAME = {"type": "string", "pattern": f"^{BOUNDARY_PATTERN.pattern}$"}


def _boundaries(value: Any, several_bodies: bool = False) -> str | tuple[str, ...]:
    names = value if isinstance(value, tuple) else (value,)
    if not names or not all(isinstance(name, str) and BOUNDARY_PATTERN.fullmatch(name) for name in names):
        text = 'expected "<body>.<boundary>", as in "block.top", or a list of such names'
        raise PydanticCustomError("boundary", text)
    if len({split_boundary(name)[0] for name in names}) > 1 and not several_bodies:
        raise PydanticCustomError("boundary", "the boundaries of a list must belong to one body")
    if len(set(names)) < len(names):
        raise PydanticCustomError("boundary", "a boundary is listed twice")
    return names if isinstance(value, tuple) else names[0]


_SCHEMA = WithJsonSchema({"anyOf": [_NAME, {"type": "array", "items": _NAME, "minItems": 1}]})

Boundaries = Annotated[str | tuple[str, ...], PlainValidator(_boundaries), _SCHEMA]
"""A boundary of a body, or several that form one surface."""
PlateBoundaries = Annotated[
    str | tuple[str, ...], PlainValidator(partial(_boundaries, several_bodies=True)), _SCHEMA
]
"""A boundary, or several of one body or more, that a rigid plate moves."""


def listed(boundaries: str | tuple[str, ...] | None) -> tuple[str, ...]:
    """One boundary or several as a tuple, empty for None.

    >>> listed("block.top")
    ('block.top',)
    """
    if boundaries is None:
        return ()
    return (boundaries,) if isinstance(boundaries, str) else boundaries


def label_of(boundaries: tuple[str, ...]) -> str:
    """Name of a surface of several boundaries.

    >>> label_of(("pad.left", "pad.foot"))
    'pad.left+foot'
    """
    return "+".join([boundaries[0], *(split_boundary(name)[1] for name in boundaries[1:])])


@dataclass(frozen=True)
class Place:
    """Boundaries of one body, or their part between the points nearest to two ``ends``."""

    boundaries: tuple[str, ...]
    ends: tuple[Point, Point] | None = None

    @property
    def body(self) -> str:
        """The body."""
        return split_boundary(self.boundaries[0])[0]

    @property
    def edges(self) -> tuple[str, ...]:
        """The boundaries without the body's name."""
        return tuple(split_boundary(name)[1] for name in self.boundaries)

    @property
    def label(self) -> str:
        """Name in messages and results."""
        if self.ends is None:
            return label_of(self.boundaries)
        (a, b), (c, d) = self.ends
        return f"{label_of(self.boundaries)} from ({a:g}, {b:g}) to ({c:g}, {d:g})"


class BoundaryPart(Section):
    """A part of a boundary; all of it by default."""

    start: Annotated[Vector, LENGTH] | None = Field(default=None, alias="from")
    """Start of the loaded, supported or contacting part of the boundary: the point nearest to this one. On
    closed boundaries the part runs from here with the material on the left."""
    to: Annotated[Vector, LENGTH] | None = None
    """End of that part."""

    @property
    def ends(self) -> tuple[Point, Point] | None:
        """Both ends, None for the whole boundary."""
        return None if self.start is None or self.to is None else (self.start, self.to)

    def faults(self, scope: Scope) -> Iterator[Fault]:
        yield from super().faults(scope)
        if (self.start is None) != (self.to is None):
            key, other = ("from", "to") if self.to is None else ("to", "from")
            yield Fault((key,), f'needs "{other}" too', "give both ends of the part of the boundary")
        elif self.start is not None and self.start == self.to:
            hint = "give two different ends of the part of the boundary"
            yield Fault(("to",), "is the same point", hint)
