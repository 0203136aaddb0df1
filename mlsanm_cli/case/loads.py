"""Loads: each has a name, a place, a kind, and a value that a stage scales by the load's factor."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import AfterValidator, Field
from pydantic_core import PydanticCustomError

from mlsanm_cli.case.base import Amount, AmountVector, BoundaryName, Name, Section, Vector, split_boundary
from mlsanm_cli.case.tables import row_problem

Control = Literal["force", "displacement"]
Rows = tuple[tuple[float, ...], ...]


def _sound(rows: Rows) -> Rows:
    problem = row_problem(rows)
    if problem:
        raise PydanticCustomError("table", "{problem}", {"problem": problem})
    return rows


class _OnBoundary(Section):
    name: Name
    boundary: BoundaryName

    @property
    def owner(self) -> str:
        """The body it acts on."""
        return split_boundary(self.boundary)[0]


class _InBody(Section):
    name: Name
    body: str

    @property
    def owner(self) -> str:
        """The body it acts on."""
        return self.body


class Traction(_OnBoundary):
    """Force per unit length of boundary and unit thickness, (x, y).

    Numbers or expressions in x and y; or a ``table`` of arc length, x and y, interpolated linearly.
    """

    kind: Literal["traction"]
    traction: AmountVector | None = None
    table: Annotated[tuple[tuple[float, float, float], ...], AfterValidator(_sound)] | None = None


class Pressure(_OnBoundary):
    """Pressure along the inward normal, positive in compression: a number, an expression in x and y, or a
    ``table`` of arc length and pressure."""

    kind: Literal["pressure"]
    pressure: Amount | None = None
    table: Annotated[tuple[tuple[float, float], ...], AfterValidator(_sound)] | None = None


class Displacement(_OnBoundary):
    """Displacement of the boundary's points, numbers or expressions: both directions, or ``ux`` or ``uy``
    alone."""

    kind: Literal["displacement"]
    displacement: AmountVector | None = None
    ux: Amount | None = None
    uy: Amount | None = None

    @property
    def components(self) -> tuple[Amount | None, Amount | None]:
        """What is prescribed in x and in y, None where nothing is."""
        return self.displacement if self.displacement is not None else (self.ux, self.uy)


class BodyForce(_InBody):
    """Force per unit volume (x, y), numbers or expressions in x and y."""

    kind: Literal["body-force"]
    body_force: AmountVector = Field(alias="body-force")


class Temperature(_InBody):
    """An even change of the body's temperature, in the degrees of the material's ``alpha``."""

    kind: Literal["temperature"]
    temperature: float


class Platen(_OnBoundary):
    """A rigid plate on the boundary, moved by a force or by a displacement in each direction.

    ``force`` or ``displacement`` give both directions; ``ux, uy, fx, fy`` one each. A direction that is
    not mentioned is free: the plate is smooth there. Forces are per unit thickness.
    """

    kind: Literal["platen"]
    force: Vector | None = None
    displacement: Vector | None = None
    ux: float | None = None
    uy: float | None = None
    fx: float | None = None
    fy: float | None = None
    rotation: Literal["fixed", "free"] = "fixed"

    @property
    def control(self) -> dict[str, tuple[Control, float]]:
        """What moves the plate in each direction it holds, at load factor 1.

        >>> Platen(name="p", boundary="a.top", kind="platen", fy=-2.0).control
        {'y': ('force', -2.0)}
        """
        held: dict[str, tuple[Control, float]] = {}
        for axis, direction in enumerate("xy"):
            if self.force is not None:
                held[direction] = ("force", self.force[axis])
            elif self.displacement is not None:
                held[direction] = ("displacement", self.displacement[axis])
            else:
                displacement, force = (self.ux, self.fx) if axis == 0 else (self.uy, self.fy)
                if displacement is not None:
                    held[direction] = ("displacement", displacement)
                elif force is not None:
                    held[direction] = ("force", force)
        return held


AnyLoad = Traction | Pressure | Displacement | Platen | BodyForce | Temperature
Load = Annotated[AnyLoad, Field(discriminator="kind")]
LOADS: dict[str, type[Section]] = {
    "platen": Platen,
    "traction": Traction,
    "pressure": Pressure,
    "displacement": Displacement,
    "body-force": BodyForce,
    "temperature": Temperature,
}
