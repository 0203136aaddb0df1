"""Loads: each has a name, a region, a kind, and a value that stages multiply by the load factor."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import takewhile
from typing import TYPE_CHECKING, Annotated, Any, Literal

from pydantic import Field, model_validator

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
from mlsanm_cli.case.model.conditions import Kind
from mlsanm_cli.case.model.model import UNSUPPORTED
from mlsanm_cli.case.model.obstacles import DiskObstacle
from mlsanm_cli.case.model.places import Boundaries, BoundaryPart, Place, PlateBoundaries, listed
from mlsanm_cli.case.model.tables import INCREASING, from_file
from mlsanm_cli.case.report import suggestion
from mlsanm_cli.errors import Fault

if TYPE_CHECKING:
    from mlsanm_cli.case.model.obstacles import AnyObstacle
    from mlsanm_cli.case.model.scope import Scope

Control = Literal["force", "displacement"]
NEEDS_FINITE = 'write strain = "finite" in [model], or remove the key'


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


def _value_faults(kind: str, value: object, table: object) -> Iterator[Fault]:
    """A load over a boundary is given by a value, under the key of its kind, or by a table."""
    if value is None and table is None:
        yield Fault((kind,), "missing (required)", f'give "{kind}" or "table"')
    elif value is not None and table is not None:
        yield Fault(("table",), f'"{kind}" is given too', "give one of the two")


class Traction(_OnBoundary):
    """Traction on a boundary: constant, an expression in x and y, or a table over the arc length."""

    kind: Literal["traction"]
    """Kind of load."""
    traction: Annotated[AmountVector, STRESS] | None = None
    """Components in x and y: numbers or expressions in x and y."""
    table: (
        Annotated[tuple[tuple[float, float, float], ...], from_file("s", "tx", "ty"), INCREASING, STRESS]
        | None
    ) = None
    """Rows [arc length, x component, y component], interpolated linearly; instead of `traction`."""

    def conditions(self, normal: tuple[float, float] | None) -> Iterator[tuple[int, Kind]]:
        """The components that it loads; ``normal`` is that of a straight boundary."""
        for component in (0, 1):
            if self.traction is None or self.traction[component] != 0.0:
                yield component, "traction"

    def faults(self, scope: Scope) -> Iterator[Fault]:
        yield from super().faults(scope)
        yield from _value_faults("traction", self.traction, self.table)


class Pressure(_OnBoundary):
    """Pressure on a boundary: constant, an expression in x and y, or a table over the arc length."""

    kind: Literal["pressure"]
    """Kind of load."""
    pressure: Annotated[Amount, STRESS] | None = None
    """Pressure, positive in compression: a number or an expression in x and y."""
    table: (
        Annotated[tuple[tuple[float, float], ...], from_file("s", "pressure"), INCREASING, STRESS] | None
    ) = None
    """Rows [arc length, pressure], interpolated linearly; instead of `pressure`."""
    follows: bool = False
    """Follower load (finite strain): pressure per current length along the current normal. Otherwise force
    and direction are those of the undeformed boundary."""

    def conditions(self, normal: tuple[float, float] | None) -> Iterator[tuple[int, Kind]]:
        """The components that it loads: of a boundary parallel to an axis only that along its ``normal``."""
        for component in (0, 1):
            if normal is None or normal[component] != 0.0:
                yield component, "traction"

    def faults(self, scope: Scope) -> Iterator[Fault]:
        yield from super().faults(scope)
        yield from _value_faults("pressure", self.pressure, self.table)
        if self.follows and scope.strain == "small":
            yield Fault(("follows",), "follower loads need finite strain", NEEDS_FINITE)
        if self.follows and scope.strain == "finite" and not scope.confined:
            yield Fault(("follows",), f"a follower pressure in plane stress {UNSUPPORTED}", "follows = false")


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

    def conditions(self, normal: tuple[float, float] | None) -> Iterator[tuple[int, Kind]]:
        """The components that it prescribes."""
        for component, value in enumerate(self.components):
            if value is not None:
                yield component, "displacement"

    def faults(self, scope: Scope) -> Iterator[Fault]:
        yield from super().faults(scope)
        single = [key for key in ("ux", "uy") if getattr(self, key) is not None]
        if self.displacement is not None and single:
            message = '"displacement" gives both components already'
            yield Fault((single[0],), message, "give displacement, or ux, or uy")
        elif self.displacement is None and not single:
            hint = "give displacement, or ux or uy alone"
            yield Fault(("displacement",), "missing (required)", hint)


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

    def faults(self, scope: Scope) -> Iterator[Fault]:
        for body in scope.case.body:
            material = scope.case.material.get(body.material) if body.name == self.body else None
            if material is not None and material.alpha is None:
                message = f'material "{body.material}" of body "{body.name}" has no thermal expansion'
                yield Fault((), message, f"give alpha in [material.{body.material}]")


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

    def faults(self, scope: Scope) -> Iterator[Fault]:
        yield from super().faults(scope)
        single = [key for key in ("ux", "uy", "fx", "fy") if getattr(self, key) is not None]
        if self.force is not None and self.displacement is not None:
            hint = "give one quantity per direction: ux or fx, uy or fy"
            yield Fault((), "has both force and displacement", hint)
        elif (self.force is not None or self.displacement is not None) and single:
            both = "force" if self.force is not None else "displacement"
            hint = "ux or fx, and uy or fy instead"
            yield Fault((single[0],), f'"{both}" gives both components already', hint)
        for u, f in (("ux", "fx"), ("uy", "fy")):
            if u in single and f in single:
                yield Fault((f,), f"{u} is given for this direction too", "give one of the two")


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

    def conditions(self, normal: tuple[float, float] | None) -> Iterator[tuple[int, Kind]]:
        """The components that it prescribes."""
        for direction, (control, _) in self.control.items():
            yield "xy".index(direction), "platen force" if control == "force" else "platen displacement"

    def faults(self, scope: Scope) -> Iterator[Fault]:
        yield from super().faults(scope)
        plates = [one for one in scope.case.load if isinstance(one, Platen)]
        plate = [one for one in plates if (one.boundary, one.ends) == (self.boundary, self.ends)]
        controlled = {direction for one in plate for direction in one.control}
        if not self.control and (self.moment is None or not controlled):
            yield Fault((), "a platen needs a direction", "give force, displacement, or ux/uy/fx/fy")
        if self.moment is not None and self.turning != "free":
            hint = 'remove rotation, or write rotation = "free"'
            yield Fault(("moment",), "a moment needs a plate that is free to rotate", hint)
        if self.hinge is not None and self.turning == "fixed":
            yield Fault(("hinge",), "a hinge needs a plate that can rotate", 'rotation = "free"')
        if len(self.places) > 1 and self.ends is not None:
            message = "parts of boundaries of several bodies are not supported"
            yield Fault(("from",), message, "use one boundary, or whole boundaries")
        if scope.strain == "finite" and self.turning != "fixed" and len(controlled) < 2:
            # The direction in which a rotating plate would let its body slide rotates with it.
            message = "a plate that can rotate at finite strain needs a value in both directions"
            hint = "give ux or fx, and uy or fy; a force of 0.0 for a free direction"
            yield Fault((), message, hint)
        hint = "loads on one boundary act on one platen"
        if plate[0].turning != self.turning:
            message = (
                f'"{self.turning}" here, "{plate[0].turning}" in load "{plate[0].name}" on the same platen'
            )
            yield Fault(("rotation",), message, hint)
        elif plate[0].hinge != self.hinge:
            message = f'differs from that of load "{plate[0].name}" on the same platen'
            yield Fault(("hinge",), message, hint)


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

    def pivot_on(self, obstacle: AnyObstacle) -> tuple[float, float] | None:
        """The point about which it turns an obstacle, None if the case gives none."""
        return self.pivot or (obstacle.center if isinstance(obstacle, DiskObstacle) else None)

    def faults(self, scope: Scope) -> Iterator[Fault]:
        yield from super().faults(scope)
        if not self.control and not self.rotation:
            hint = "give force, displacement, or ux/uy/fx/fy"
            yield Fault((), "the motion of an obstacle needs a direction", hint)
        if self.rotation and scope.strain == "small":
            yield Fault(("rotation",), "an obstacle that turns needs finite strain", NEEDS_FINITE)
        obstacles = {one.name: one.obstacle for one in scope.case.contact}
        obstacle = obstacles.get(self.obstacle)
        if self.obstacle not in scope.names["contact"]:
            fitting = [name for name in obstacles if obstacles[name] is not None] or obstacles
            hint = suggestion(self.obstacle, fitting, "contacts with an obstacle")
            yield Fault(("obstacle",), f'there is no contact "{self.obstacle}"', hint)
        elif self.obstacle in obstacles and obstacle is None:
            message = f'contact "{self.obstacle}" has a master and no obstacle'
            yield Fault(("obstacle",), message, 'a load of kind "platen" moves a boundary')
        loads = [one for one in scope.case.load if isinstance(one, ObstacleMotion)]
        earlier = [
            one for one in takewhile(lambda one: one is not self, loads) if one.obstacle == self.obstacle
        ]
        for direction, (control, _) in self.control.items():
            first = next((one for one in earlier if direction in one.control), self)
            other = first.control[direction][0]
            if other != control:
                message = (
                    f'{control} here, {other} in load "{first.name}" on the same obstacle in {direction}'
                )
                yield Fault((), message, "use one of the two in each direction")
        if obstacle is not None and self.rotation and scope.strain == "finite":
            pivot = self.pivot_on(obstacle)
            others = {one.pivot_on(obstacle) for one in earlier if one.rotation}
            if pivot is None:
                yield Fault(("rotation",), "needs a pivot", "give pivot")
            elif others - {None, pivot}:
                message = "differs from that of another load on the same obstacle"
                yield Fault(("pivot",), message, "one pivot for all")

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
