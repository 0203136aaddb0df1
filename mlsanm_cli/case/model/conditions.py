"""Regions (a boundary, several that form one surface, or a part of them), their supports, which conditions on
them are compatible, and stops of the path."""

from collections.abc import Iterator
from functools import partial
from typing import Annotated, Any, Literal

from pydantic import Field, PlainValidator, WithJsonSchema
from pydantic_core import PydanticCustomError

from mlsanm_cli.case.model.section import (
    BOUNDARY_PATTERN,
    FOUNDATION,
    LENGTH,
    Point,
    Scope,
    Section,
    Unit,
    Vector,
    split_boundary,
)
from mlsanm_cli.case.report import suggestion
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


@dataclass(frozen=True)
class Place:
    """Boundaries of one body, or their part between the points nearest to two ``ends``."""

    boundaries: tuple[str, ...]
    ends: tuple[Point, Point] | None = None

    @property
    def body(self) -> str:
        return split_boundary(self.boundaries[0])[0]

    @property
    def edges(self) -> tuple[str, ...]:
        """The boundaries without the body's name."""
        return tuple(split_boundary(name)[1] for name in self.boundaries)

    @property
    def label(self) -> str:
        """Name in messages and results.

        >>> Place(("pad.left", "pad.foot"), ((0.0, 1.0), (0.0, 2.0))).label
        'pad.left+foot from (0, 1) to (0, 2)'
        """
        name = f"{self.body}.{'+'.join(self.edges)}"
        if self.ends is None:
            return name
        (a, b), (c, d) = self.ends
        return f"{name} from ({a:g}, {b:g}) to ({c:g}, {d:g})"


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
        if len(self.given("start", "to")) == 1:
            key, other = ("from", "to") if self.to is None else ("to", "from")
            yield Fault((key,), f'needs "{other}" too', "give both ends of the part of the boundary")
        elif self.start is not None and self.start == self.to:
            yield Fault(("to",), "is the same point", "give two different ends of the part of the boundary")


Kind = Literal["support", "spring", "displacement", "traction", "platen force", "platen displacement"]


def compatible(one: Kind, other: Kind) -> bool:
    """Whether two conditions may act on the same component: values of one kind that add up, each with its
    load factor, or springs and tractions."""
    additive = one == other and one not in ("support", "spring")
    return additive or {one, other} == {"spring", "traction"}


ZERO_ONLY = Field(json_schema_extra={"enum": [0.0]})
"""0.0 is the only value supported; others are reported by name."""


class Support(BoundaryPart):
    """Displacements fixed at zero on a boundary or at a point of a body, or elastic springs on a boundary."""

    boundary: Boundaries | None = None
    """The supported boundary or boundaries of one body; give `boundary`, or `body` and `near`."""
    body: str | None = None
    """Body of which a single node is supported."""
    near: Annotated[Vector, LENGTH] | None = None
    """A node is placed at this point and supported; in bodies with nodes from a file, the nearest node is."""
    ux: Annotated[float, ZERO_ONLY, LENGTH] | None = None
    """0.0 fixes the displacement in x; without it x is free."""
    uy: Annotated[float, ZERO_ONLY, LENGTH] | None = None
    """0.0 fixes the displacement in y; without it y is free."""
    spring: Annotated[Vector, FOUNDATION] | None = None
    """Stiffness of springs on the boundary (Winkler foundation): traction per displacement in x and y."""

    @property
    def place(self) -> Place | None:
        """The boundaries on which it acts; None if it fixes a single node."""
        return None if self.boundary is None else Place(listed(self.boundary), self.ends)

    @property
    def holds(self) -> tuple[bool, bool]:
        """Whether it resists displacement in x and in y."""
        springs = self.spring or (0.0, 0.0)
        return self.ux is not None or springs[0] > 0.0, self.uy is not None or springs[1] > 0.0

    def conditions(self, normal: Point | None) -> Iterator[tuple[int, Kind]]:
        """The components in which it fixes a boundary or has springs, whatever its ``normal``."""
        yield from ((component, "support") for component, u in enumerate((self.ux, self.uy)) if u is not None)
        yield from ((component, "spring") for component, k in enumerate(self.spring or ()) if k)

    def faults(self, scope: Scope) -> Iterator[Fault]:
        point = self.given("body", "near")
        if self.boundary is not None and point:
            yield Fault((), 'give either "boundary", or "body" and "near"')
        elif self.boundary is None:
            if self.given("start", "to"):
                yield Fault((), '"from" and "to" need a boundary', 'give "boundary"')
            if not point:
                yield Fault((), "has no location", 'give "boundary", or "body" and "near"')
            elif len(point) == 1:
                hint = "near = [x, y] selects the nearest node of the body"
                yield Fault((), '"body" and "near" are needed together', hint)
        if self.spring is not None:
            if self.boundary is None:
                yield Fault(("spring",), "springs act on a boundary", 'give "boundary"')
            if min(self.spring) < 0.0 or max(self.spring) == 0.0:
                message = "stiffnesses must not be negative, and one must be above 0"
                yield Fault(("spring",), message, "0 for a direction without spring")
        elif self.ux is None and self.uy is None:
            yield Fault((), "fixes nothing", "give ux = 0.0, uy = 0.0 or both, or spring = [kx, ky]")
        for key in self.given("ux", "uy"):
            if getattr(self, key) != 0.0:
                message = "a nonzero displacement of a support is not supported yet"
                yield Fault((key,), message, 'a load of kind "displacement" moves a boundary')
        for other in self.earlier(scope.case.support):
            if self.near is not None and (other.body, other.near) == (self.body, self.near):
                for key in sorted({*self.given("ux", "uy")} & {*other.given("ux", "uy")}):
                    yield Fault((), f"another support fixes this point in {key[1]} already")


UNIT_OF_QUANTITY = Unit("unit of the quantity")
VECTORS = ("force", "displacement")


class Stop(Section):
    """Condition that ends the path at the load where a quantity reaches a limit."""

    what: Literal["force", "displacement", "pressure", "area", "slip", "von_mises", "fold"]
    """Force of a load, support or contact; displacement of a platen, obstacle or probe; of a contact the
    largest pressure, the length in contact (area) or the largest slip where it is closed; von Mises stress at
    a probe; or a fold (limit point)."""
    of: str = ""
    """Name of the load, contact or probe, or boundary of the support; empty for a fold."""
    component: Literal["x", "y", "size"] = "size"
    """Component of a force or displacement, with its sign, or its magnitude (size)."""
    above: Annotated[float | None, UNIT_OF_QUANTITY] = None
    """Limit reached from below; give `above` or `below`."""
    below: Annotated[float | None, UNIT_OF_QUANTITY] = None
    """Limit reached from above; give `above` or `below`."""

    @property
    def description(self) -> str:
        if self.what == "fold":
            return "fold (limit point of the load)"
        along = f" in {self.component}" if self.component != "size" else ""
        side, value = ("above", self.above) if self.above is not None else ("below", self.below)
        return f"{self.what.replace('_', ' ')} of {self.of}{along} {side} {value:g}"

    def faults(self, scope: Scope) -> Iterator[Fault]:
        if self.what == "fold":
            for key in (*self.given("above", "below"), *(("of",) if self.of else ())):
                yield Fault((key,), "does not apply to a fold", "remove it")
            return
        yield from self.exclusive("above", "below")
        if self.component != "size" and self.what not in VECTORS:
            yield Fault(("component",), f"{self.what} has no components", "remove it")
        # What ``of`` can name: in words, and the names.
        case, names = scope.case, scope.names
        what = "probe" if self.what == "von_mises" else "contact"
        known = list(names(what))
        if self.what == "force":
            supports = [one.boundary for one in case.support if isinstance(one.boundary, str)]
            what, known = "load or contact or support", [*names("load"), *known, *supports]
        elif self.what == "displacement":
            rigid = [one.name for one in case.load if one.kind in ("platen", "obstacle")]
            what = "platen or obstacle load or probe"
            known = [*rigid, *scope.missing("load"), *names("probe")]
        if self.of not in known:
            message = f'there is no {what} "{self.of}"' if self.of else f"missing: the name of a {what}"
            yield Fault(("of",), message, suggestion(self.of, known))
        if self.what == "slip" and any(c.name == self.of and not c.friction for c in case.contact):
            yield Fault(("of",), f'contact "{self.of}" is frictionless and has no slip')
