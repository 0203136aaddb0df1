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
    STRESS,
    TEMPERATURE,
    TURN,
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


def _sound(rows: Rows) -> Rows:
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
        """The loaded regions, one per body; only plates have more than one."""
        return (self.place,)

    @property
    def owner(self) -> str:
        """The loaded body, of several the first."""
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
    table: Annotated[tuple[tuple[float, float, float], ...], AfterValidator(_sound), STRESS] | None = None
    """Rows [arc length, x component, y component], interpolated linearly; instead of `traction`."""


class Pressure(_OnBoundary):
    """Pressure on a boundary: constant, an expression in x and y, or a table over the arc length."""

    kind: Literal["pressure"]
    """Kind of load."""
    pressure: Annotated[Amount, STRESS] | None = None
    """Pressure, positive in compression: a number or an expression in x and y."""
    table: Annotated[tuple[tuple[float, float], ...], AfterValidator(_sound), STRESS] | None = None
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


class _Moving(Section):
    """A rigid body with a prescribed force or displacement in each direction.

    ``force`` or ``displacement`` give both components; ``ux, uy, fx, fy`` one each. Forces are per unit
    thickness.
    """

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


class Platen(_OnBoundary, _Moving):
    """A rigid plate bonded to a boundary. A direction without force or displacement is free to slide."""

    boundary: PlateBoundaries
    """Boundary with the plate, or a list of boundaries, also of several bodies, that move together."""
    kind: Literal["platen"]
    """Kind of load."""
    rotation: Annotated[Rotation, TURN] = "fixed"
    """Rotation of the plate: `"fixed"`, `"free"`, or a prescribed angle (counter-clockwise). Free by default
    if a `hinge` or a `moment` is given, there or in another load on the same plate."""
    hinge: Annotated[Vector, LENGTH] | None = None
    """Reference point of force, moment and displacement; that of other loads on the same plate, or the middle
    of the boundary by default."""
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
        """Kind of rotation."""
        return "prescribed" if isinstance(self.rotation, float) else self.rotation


class ObstacleMotion(_Moving):
    """Motion of the rigid obstacle of a contact. A direction without force or displacement is fixed."""

    name: Name
    """Name of the load, used by stages."""
    obstacle: str
    """Contact to which the obstacle belongs."""
    kind: Literal["obstacle"]
    """Kind of load."""
    rotation: Annotated[float, TURN] = 0.0
    """Angle by which the obstacle turns, counter-clockwise, any number of turns (finite strain only)."""
    pivot: Annotated[Vector, LENGTH] | None = None
    """Point of the obstacle as drawn about which it turns; it moves with the obstacle. The centre of disks by
    default."""

    @property
    def owner(self) -> None:
        """No body is loaded directly."""
        return None

    @property
    def owners(self) -> tuple[str, ...]:
        """The loaded bodies."""
        return ()


AnyLoad = Traction | Pressure | Displacement | Platen | BodyForce | Temperature | ObstacleMotion
Load = Annotated[AnyLoad, Field(discriminator="kind")]
