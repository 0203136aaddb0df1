"""Loads: each has a name, a region, a kind, and a value that stages multiply by the load factor."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import AfterValidator, Field, model_validator
from pydantic_core import PydanticCustomError

from mlsanm_cli.case.model.base import (
    DENSITY,
    FORCE,
    LENGTH,
    MOMENT,
    RADIANS,
    STRESS,
    TEMPERATURE,
    Amount,
    AmountVector,
    Name,
    Rotation,
    Section,
    Vector,
    split_boundary,
)
from mlsanm_cli.case.model.places import Boundaries, BoundaryPart, Place, PlateBoundaries, listed
from mlsanm_cli.case.model.tables import row_problem

Control = Literal["force", "displacement"]
Rows = tuple[tuple[float, ...], ...]


def _checked_rows(rows: Rows) -> Rows:
    problem = row_problem(rows)
    if problem:
        raise PydanticCustomError("table", "{problem}", {"problem": problem})
    return rows


class _OnBoundary(BoundaryPart):
    name: Name
    """Name of the load, used by stages."""
    boundary: Boundaries
    """Loaded boundary, or a list of boundaries of one body."""

    @property
    def place(self) -> Place:
        """The loaded region."""
        return Place(listed(self.boundary), self.ends)

    @property
    def places(self) -> tuple[Place, ...]:
        """The loaded regions, one per body; only platens have more than one."""
        return (self.place,)

    @property
    def owner(self) -> str:
        """The loaded body; the first of several."""
        return self.place.body

    @property
    def owners(self) -> tuple[str, ...]:
        """The loaded bodies."""
        return tuple(place.body for place in self.places)


class _InBody(Section):
    name: Name
    """Name of the load, used by stages."""
    body: str
    """The loaded body."""

    @property
    def owner(self) -> str:
        """The loaded body."""
        return self.body

    @property
    def owners(self) -> tuple[str, ...]:
        """The loaded bodies."""
        return (self.body,)


class Traction(_OnBoundary):
    """Traction on a boundary: constant, an expression in x and y, or a table over the arc length."""

    kind: Literal["traction"]
    """Kind of load."""
    traction: Annotated[AmountVector, STRESS] | None = None
    """Components in x and y: numbers or expressions in x and y."""
    table: Annotated[tuple[tuple[float, float, float], ...], AfterValidator(_checked_rows), STRESS] | None = (
        None
    )
    """Rows [arc length, x component, y component], interpolated linearly; instead of `traction`."""


class Pressure(_OnBoundary):
    """Pressure on a boundary: constant, an expression in x and y, or a table over the arc length."""

    kind: Literal["pressure"]
    """Kind of load."""
    pressure: Annotated[Amount, STRESS] | None = None
    """Pressure, positive in compression: a number or an expression in x and y."""
    table: Annotated[tuple[tuple[float, float], ...], AfterValidator(_checked_rows), STRESS] | None = None
    """Rows [arc length, pressure], interpolated linearly; instead of `pressure`."""
    follows: bool = False
    """Follower load (finite strain): pressure per current length along the current normal. Otherwise force
    and direction are those of the undeformed boundary."""


class Displacement(_OnBoundary):
    """Prescribed displacement of a boundary: both components, or ``ux`` or ``uy`` alone."""

    kind: Literal["displacement"]
    """Kind of load."""
    displacement: Annotated[AmountVector, LENGTH] | None = None
    """Components in x and y: numbers or expressions in x and y."""
    ux: Annotated[Amount, LENGTH] | None = None
    """Displacement in x; y remains free."""
    uy: Annotated[Amount, LENGTH] | None = None
    """Displacement in y; x remains free."""

    @property
    def components(self) -> tuple[Amount | None, Amount | None]:
        """Prescribed components in x and in y, None where free."""
        return self.displacement if self.displacement is not None else (self.ux, self.uy)


class BodyForce(_InBody):
    """Body force per unit volume."""

    kind: Literal["body-force"]
    """Kind of load."""
    body_force: Annotated[AmountVector, DENSITY] = Field(alias="body-force")
    """Components in x and y: numbers or expressions in x and y."""


class Temperature(_InBody):
    """Temperature change of a body whose material has a thermal expansion ``alpha``."""

    kind: Literal["temperature"]
    """Kind of load."""
    temperature: Annotated[Amount, TEMPERATURE]
    """Temperature change: a number or an expression in x and y."""


class _RigidMotion(Section):
    """A rigid body with a prescribed force or displacement in each direction. ``force`` and ``displacement``
    give both components, ``ux, uy, fx, fy`` one each. Forces are per unit thickness."""

    force: Annotated[Vector, FORCE] | None = None
    """Force, x and y."""
    displacement: Annotated[Vector, LENGTH] | None = None
    """Displacement, x and y."""
    ux: Annotated[float, LENGTH] | None = None
    """Displacement in x."""
    uy: Annotated[float, LENGTH] | None = None
    """Displacement in y."""
    fx: Annotated[float, FORCE] | None = None
    """Force in x."""
    fy: Annotated[float, FORCE] | None = None
    """Force in y."""

    @property
    def control(self) -> dict[str, tuple[Control, float]]:
        """The controlled quantity in each direction and its value at load factor 1.

        >>> Platen(name="p", boundary="a.top", kind="platen", fy=-2.0).control
        {'y': ('force', -2.0)}
        """
        force = self.force or (self.fx, self.fy)
        displacement = self.displacement or (self.ux, self.uy)
        found: dict[str, tuple[Control, float]] = {}
        for direction, f, u in zip("xy", force, displacement, strict=True):
            if self.force is None and u is not None:
                found[direction] = ("displacement", u)
            elif f is not None:
                found[direction] = ("force", f)
        return found


class Platen(_OnBoundary, _RigidMotion):
    """A rigid plate bonded to a boundary. In a direction without force or displacement the boundary is free
    to slide along the plate."""

    boundary: PlateBoundaries
    """Boundary with the plate, or a list of boundaries that move together, also of several bodies."""
    kind: Literal["platen"]
    """Kind of load."""
    rotation: Annotated[Rotation, RADIANS] = "fixed"
    """Rotation of the plate: `"fixed"`, `"free"`, or a prescribed angle (counter-clockwise). Free by default
    if a `hinge` or a `moment` is given, here or in another load on the same plate."""
    hinge: Annotated[Vector, LENGTH] | None = None
    """Reference point of force, moment and displacement; by default that of another load on the same plate,
    else the middle of the boundary."""
    moment: Annotated[float, MOMENT] | None = None
    """Moment about the hinge, counter-clockwise."""

    @model_validator(mode="before")
    @classmethod
    def _turns(cls, data: Any) -> Any:
        """Plates with a hinge or a moment are free to rotate."""
        turned = isinstance(data, dict) and ("hinge" in data or "moment" in data)
        return {"rotation": "free", **data} if turned else data

    @property
    def places(self) -> tuple[Place, ...]:
        """The regions it covers, one per body."""
        names = listed(self.boundary)
        bodies = dict.fromkeys(split_boundary(name)[0] for name in names)
        own = [tuple(name for name in names if split_boundary(name)[0] == body) for body in bodies]
        return tuple(Place(some, self.ends) for some in own)

    @property
    def place(self) -> Place:
        """The region it covers on its first body."""
        return self.places[0]

    @property
    def label(self) -> str:
        """Name in messages."""
        return " and ".join(place.label for place in self.places)

    @property
    def turning(self) -> Literal["fixed", "free", "prescribed"]:
        """The kind of rotation."""
        return "prescribed" if isinstance(self.rotation, float) else self.rotation


class ObstacleMotion(_RigidMotion):
    """Motion of the rigid obstacle of a contact. A direction without force or displacement is fixed."""

    name: Name
    """Name of the load, used by stages."""
    obstacle: str
    """Contact to which the obstacle belongs."""
    kind: Literal["obstacle"]
    """Kind of load."""
    rotation: Annotated[float, RADIANS] = 0.0
    """Angle by which the obstacle turns, counter-clockwise, any number of turns (finite strain only)."""
    pivot: Annotated[Vector, LENGTH] | None = None
    """Centre of rotation in the undeformed position; it moves with the obstacle. The centre of a disk by
    default."""

    @property
    def owner(self) -> None:
        """None: no body is loaded directly."""
        return None

    @property
    def owners(self) -> tuple[str, ...]:
        """Empty: no body is loaded directly."""
        return ()


AnyLoad = Traction | Pressure | Displacement | Platen | BodyForce | Temperature | ObstacleMotion
Load = Annotated[AnyLoad, Field(discriminator="kind")]
