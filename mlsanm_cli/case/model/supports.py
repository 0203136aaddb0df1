"""``[[support]]``: fixed displacements and elastic foundations."""

from collections.abc import Iterator
from typing import Annotated

from pydantic import Field

from mlsanm_cli.case.model.conditions import Kind
from mlsanm_cli.case.model.fields import FOUNDATION, LENGTH, Vector
from mlsanm_cli.case.model.places import Boundaries, BoundaryPart, Place, listed
from mlsanm_cli.case.model.section import Scope
from mlsanm_cli.errors import Fault

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

    def conditions(self) -> Iterator[tuple[int, Kind]]:
        """The components in which it fixes its boundary or has springs."""
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
