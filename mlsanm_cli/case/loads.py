"""Loads: each has a name, a place, a kind, and a value that a stage scales by the load's factor."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import AfterValidator, Field, model_validator
from pydantic_core import PydanticCustomError

from mlsanm_cli.case.base import (
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
from mlsanm_cli.case.places import Boundaries, Place, PlateBoundaries, Stretch, listed
from mlsanm_cli.case.tables import row_problem

Control = Literal["force", "displacement"]
Rows = tuple[tuple[float, ...], ...]


def _sound(rows: Rows) -> Rows:
    problem = row_problem(rows)
    if problem:
        raise PydanticCustomError("table", "{problem}", {"problem": problem})
    return rows


class _OnBoundary(Stretch):
    name: Name
    """Name of the load; stages call it by this name."""
    boundary: Boundaries
    """The boundary it acts on, or a list of several that are one."""

    @property
    def place(self) -> Place:
        """Where it acts."""
        return Place(listed(self.boundary), self.ends)

    @property
    def places(self) -> tuple[Place, ...]:
        """The same body by body; more than one of plates only."""
        return (self.place,)

    @property
    def owner(self) -> str:
        """The body it acts on, of several the first."""
        return self.place.body

    @property
    def owners(self) -> tuple[str, ...]:
        """The bodies it acts on."""
        return tuple(place.body for place in self.places)


class _InBody(Section):
    name: Name
    """Name of the load; stages call it by this name."""
    body: str
    """The body it acts on."""

    @property
    def owner(self) -> str:
        """The body it acts on."""
        return self.body

    @property
    def owners(self) -> tuple[str, ...]:
        """The same as of loads that act on several."""
        return (self.body,)


class Traction(_OnBoundary):
    """Force per unit length of boundary and unit thickness, (x, y).

    Numbers or expressions in x and y; or a ``table`` of arc length, x and y, interpolated linearly.
    """

    kind: Literal["traction"]
    """Kind of load."""
    traction: Annotated[AmountVector, STRESS] | None = None
    """Force per length of boundary, x and y: numbers or expressions in x and y."""
    table: Annotated[tuple[tuple[float, float, float], ...], AfterValidator(_sound), STRESS] | None = None
    """Rows of arc length along the boundary, x and y, interpolated linearly; instead of `traction`."""


class Pressure(_OnBoundary):
    """Pressure along the inward normal, positive in compression: a number, an expression in x and y, or a
    ``table`` of arc length and pressure."""

    kind: Literal["pressure"]
    """Kind of load."""
    pressure: Annotated[Amount, STRESS] | None = None
    """Pressure, positive in compression: a number or an expression in x and y."""
    table: Annotated[tuple[tuple[float, float], ...], AfterValidator(_sound), STRESS] | None = None
    """Rows of arc length along the boundary and pressure, interpolated linearly; instead of `pressure`."""
    follows: bool = False
    """Whether the pressure follows the deformed boundary (finite strain): per current length, along the
    current normal. If not, it keeps the direction and the force it has before loading."""


class Displacement(_OnBoundary):
    """Displacement of the boundary's points, numbers or expressions: both directions, or ``ux`` or ``uy``
    alone."""

    kind: Literal["displacement"]
    """Kind of load."""
    displacement: Annotated[AmountVector, LENGTH] | None = None
    """Displacement of every point, x and y: numbers or expressions in x and y."""
    ux: Annotated[Amount, LENGTH] | None = None
    """Displacement in x alone."""
    uy: Annotated[Amount, LENGTH] | None = None
    """Displacement in y alone."""

    @property
    def components(self) -> tuple[Amount | None, Amount | None]:
        """What is prescribed in x and in y, None where nothing is."""
        return self.displacement if self.displacement is not None else (self.ux, self.uy)


class BodyForce(_InBody):
    """Force per unit volume (x, y), numbers or expressions in x and y."""

    kind: Literal["body-force"]
    """Kind of load."""
    body_force: Annotated[AmountVector, DENSITY] = Field(alias="body-force")
    """Force per volume, x and y: numbers or expressions in x and y."""


class Temperature(_InBody):
    """A change of the body's temperature, in the degrees of the material's ``alpha``: a number, or an
    expression in x and y."""

    kind: Literal["temperature"]
    """Kind of load."""
    temperature: Annotated[Amount, TEMPERATURE]
    """Change of temperature: a number, or an expression in x and y."""


class _Moving(Section):
    """Moved by a force or by a displacement in each direction.

    ``force`` or ``displacement`` give both directions; ``ux, uy, fx, fy`` one each. Forces are per unit
    thickness.
    """

    force: Annotated[Vector, FORCE] | None = None
    """Force on it, x and y."""
    displacement: Annotated[Vector, LENGTH] | None = None
    """Its displacement, x and y."""
    ux: Annotated[float, LENGTH] | None = None
    """Its displacement in x alone."""
    uy: Annotated[float, LENGTH] | None = None
    """Its displacement in y alone."""
    fx: Annotated[float, FORCE] | None = None
    """Force on it in x alone."""
    fy: Annotated[float, FORCE] | None = None
    """Force on it in y alone."""

    @property
    def control(self) -> dict[str, tuple[Control, float]]:
        """What moves it in each direction, at load factor 1.

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
    """A rigid plate on the boundary. A direction that is not mentioned is free: the plate is smooth there."""

    boundary: PlateBoundaries
    """The boundary it is on, or a list of several, also of several bodies, which it moves together."""
    kind: Literal["platen"]
    """Kind of load."""
    rotation: Annotated[Rotation, TURN] = "fixed"
    """Whether the plate may turn, `"fixed"` or `"free"`, or by what angle (radian, counter-clockwise) it
    does; free by default where there is a `hinge` or a `moment`."""
    hinge: Annotated[Vector, LENGTH] | None = None
    """The point that forces act at and moments are counted about, and whose displacement is told; the middle
    of the boundary by default."""
    moment: Annotated[float, MOMENT] | None = None
    """Moment on the plate about its hinge, counter-clockwise."""

    @model_validator(mode="before")
    @classmethod
    def _turns(cls, data: Any) -> Any:
        """Plates with a hinge or a moment are free to turn."""
        turned = isinstance(data, dict) and ("hinge" in data or "moment" in data)
        return {"rotation": "free", **data} if turned else data

    @property
    def places(self) -> tuple[Place, ...]:
        """Where it is, body by body."""
        names = listed(self.boundary)
        bodies = dict.fromkeys(split_boundary(name)[0] for name in names)
        own = [tuple(name for name in names if split_boundary(name)[0] == body) for body in bodies]
        return tuple(Place(some, self.ends) for some in own)

    @property
    def place(self) -> Place:
        """Where it is on its first body."""
        return self.places[0]

    @property
    def label(self) -> str:
        """What the plate is called in messages."""
        return " and ".join(place.label for place in self.places)

    @property
    def turning(self) -> Literal["fixed", "free", "prescribed"]:
        """What its rotation is."""
        return "prescribed" if isinstance(self.rotation, float) else self.rotation


class ObstacleMotion(_Moving):
    """What moves the rigid obstacle of a contact. A direction that is not mentioned is held."""

    name: Name
    """Name of the load; stages call it by this name."""
    obstacle: str
    """The contact whose obstacle it moves."""
    kind: Literal["obstacle"]
    """Kind of load."""

    @property
    def owner(self) -> None:
        """It acts on no body."""
        return None

    @property
    def owners(self) -> tuple[str, ...]:
        """The same as of loads that act on several."""
        return ()


AnyLoad = Traction | Pressure | Displacement | Platen | BodyForce | Temperature | ObstacleMotion
Load = Annotated[AnyLoad, Field(discriminator="kind")]
