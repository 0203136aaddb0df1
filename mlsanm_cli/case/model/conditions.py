"""Supports, stops of the path, and which conditions on a boundary are compatible."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Annotated, Literal

from pydantic import Field

from mlsanm_cli.case.model.places import Boundaries, BoundaryPart, Place, listed
from mlsanm_cli.case.model.section import FOUNDATION, LENGTH, Point, Scope, Section, Unit, Vector
from mlsanm_cli.case.report import suggestion
from mlsanm_cli.errors import Fault

Kind = Literal["support", "spring", "displacement", "traction", "platen force", "platen displacement"]


def compatible(one: Kind, other: Kind) -> bool:
    """Whether two conditions may act on the same component: values of one kind that add up, each with its
    load factor, or springs and tractions."""
    additive = one == other and one not in ("support", "spring")
    return additive or {one, other} == {"spring", "traction"}


ZERO_ONLY = Field(json_schema_extra={"enum": [0.0]})
"""0.0 is the only value supported; others are reported by name."""


class Support(BoundaryPart):
    """Displacements fixed at zero on a boundary or at a point of a body, or elastic
    springs on a boundary."""

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
        for component, value in enumerate((self.ux, self.uy)):
            if value is not None:
                yield component, "support"
        for component, spring in enumerate(self.spring or ()):
            if spring:
                yield component, "spring"

    def faults(self, scope: Scope) -> Iterator[Fault]:
        yield from super().faults(scope)
        yield from self._location_faults()
        if self.spring is not None:
            if self.boundary is None:
                yield Fault(("spring",), "springs act on a boundary", 'give "boundary"')
            if min(self.spring) < 0.0 or max(self.spring) == 0.0:
                message = "stiffnesses must not be negative, and one must be above 0"
                yield Fault(("spring",), message, "0 for a direction without spring")
        elif self.ux is None and self.uy is None:
            yield Fault((), "fixes nothing", "give ux = 0.0, uy = 0.0 or both, or spring = [kx, ky]")
        for key in ("ux", "uy"):
            if getattr(self, key):
                message = "a nonzero displacement of a support is not supported yet"
                yield Fault((key,), message, 'a load of kind "displacement" moves a boundary')
        for other in self.earlier(scope.case.support):
            same = self.near is not None and (other.body, other.near) == (self.body, self.near)
            for key in ("ux", "uy"):
                if same and getattr(self, key) is not None and getattr(other, key) is not None:
                    yield Fault((), f"another support fixes this point in {key[1]} already")

    def _location_faults(self) -> Iterator[Fault]:
        both = 'give "boundary", or "body" and "near"'
        if self.boundary is not None:
            if self.body is not None or self.near is not None:
                yield Fault((), 'give either "boundary", or "body" and "near"')
            return
        if self.start is not None or self.to is not None:
            yield Fault((), '"from" and "to" need a boundary', 'give "boundary"')
        if self.body is None and self.near is None:
            yield Fault((), "has no location", both)
        elif self.body is None or self.near is None:
            hint = "near = [x, y] selects the nearest node of the body"
            yield Fault((), '"body" and "near" are needed together', hint)


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
        """The condition in words."""
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
        what, known = self._named(scope)
        if self.of not in known:
            message = f'there is no {what} "{self.of}"' if self.of else f"missing: the name of a {what}"
            yield Fault(("of",), message, suggestion(self.of, known))
        if self.what == "slip" and any(c.name == self.of and not c.friction for c in scope.case.contact):
            yield Fault(("of",), f'contact "{self.of}" is frictionless and has no slip')

    def _named(self, scope: Scope) -> tuple[str, list[str]]:
        """What ``of`` can name: in words, and the names."""
        names = scope.names
        if self.what == "force":
            supports = [one.boundary for one in scope.case.support if isinstance(one.boundary, str)]
            return "load or contact or support", [*names("load"), *names("contact"), *supports]
        if self.what == "displacement":
            rigid = [one.name for one in scope.case.load if one.kind in ("platen", "obstacle")]
            return "platen or obstacle load or probe", [*rigid, *scope.missing("load"), *names("probe")]
        section = "probe" if self.what == "von_mises" else "contact"
        return section, list(names(section))
