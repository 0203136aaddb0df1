"""Loads that move rigid plates and obstacles."""

from collections.abc import Iterator, Sequence
from typing import Annotated, Any, Literal, Self

from pydantic import model_validator

from mlsanm_cli.case.model.conditions import Kind, PlateBoundaries
from mlsanm_cli.case.model.contacts import AnyObstacle, DiskObstacle
from mlsanm_cli.case.model.loads import (
    BodyForce,
    Centrifugal,
    Displacement,
    Force,
    Load,
    OnBoundary,
    Pressure,
    Temperature,
    Traction,
)
from mlsanm_cli.case.model.section import FORCE, LENGTH, MOMENT, RADIANS, Point, Rotation, Scope, Vector
from mlsanm_cli.case.report import suggestion
from mlsanm_cli.errors import Fault

Control = Literal["force", "displacement"]


class _RigidMotion(Load):
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
        controlled: dict[str, tuple[Control, float]] = {}
        moved = (None, None) if self.force else self.displacement or (self.ux, self.uy)
        for direction, f, u in zip("xy", self.force or (self.fx, self.fy), moved, strict=True):
            if u is not None:
                controlled[direction] = ("displacement", u)
            elif f is not None:
                controlled[direction] = ("force", f)
        return controlled

    def faults(self, scope: Scope) -> Iterator[Fault]:
        single, both = self.given("ux", "uy", "fx", "fy"), self.given("force", "displacement")
        for pair in (("force", "displacement"), ("ux", "fx"), ("uy", "fy")):
            yield from self.exclusive(*pair, required=False)
        if both and single:
            message = f'"{both[0]}" gives both components already'
            yield Fault((single[0],), message, "ux or fx, and uy or fy instead")


class Platen(OnBoundary, _RigidMotion):
    """A rigid plate bonded to a boundary. In a direction without force or displacement the boundary is free
    to slide along the plate."""

    boundary: PlateBoundaries
    """Boundary with the plate, or a list of boundaries that move together, also of several bodies."""
    kind: Literal["platen"]
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

    def beside(self, platens: Sequence[Self]) -> Self:
        """The load with the hinge and, unless it sets its own, the kind of rotation of others on its
        plate."""
        plate = [load for load in platens if (load.boundary, load.ends) == (self.boundary, self.ends)]
        hinges = [load.hinge for load in plate if load.hinge is not None]
        turning = [load.rotation for load in plate if "rotation" in load.model_fields_set]
        common: dict[str, Any] = {"hinge": hinges[0]} if hinges and self.hinge is None else {}
        if turning and "rotation" not in self.model_fields_set:
            common["rotation"] = 0.0 if isinstance(turning[0], float) else turning[0]
        return self.model_copy(update=common)

    @property
    def label(self) -> str:
        return " and ".join(place.label for place in self.places)

    @property
    def turning(self) -> Literal["fixed", "free", "prescribed"]:
        return "prescribed" if isinstance(self.rotation, float) else self.rotation

    def conditions(self, normal: Point | None) -> Iterator[tuple[int, Kind]]:
        for direction, (control, _) in self.control.items():
            yield "xy".index(direction), "platen force" if control == "force" else "platen displacement"

    def faults(self, scope: Scope) -> Iterator[Fault]:
        platens = [load for load in scope.case.load if isinstance(load, Platen)]
        plate = [load for load in platens if (load.boundary, load.ends) == (self.boundary, self.ends)]
        controlled = {direction for load in plate for direction in load.control}
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
        first, hint = plate[0], "loads on one boundary act on one platen"
        there = f'load "{first.name}" on the same platen'
        if first.turning != self.turning:
            turns = {load.turning: load.name for load in (first, self)}
            if turns.keys() == {"fixed", "prescribed"}:
                hint = f'{hint}; write rotation = 0.0 in load "{turns["fixed"]}"'
            yield Fault(("rotation",), f'"{self.turning}" here, "{first.turning}" in {there}', hint)
        elif first.hinge != self.hinge:
            yield Fault(("hinge",), f"differs from that of {there}", hint)


class ObstacleMotion(_RigidMotion):
    """Motion of the rigid obstacle of a contact. A direction without force or displacement is fixed."""

    obstacle: str
    """Contact to which the obstacle belongs."""
    kind: Literal["obstacle"]
    rotation: Annotated[float, RADIANS] = 0.0
    """Angle by which the obstacle turns, counter-clockwise, any number of turns (finite strain only)."""
    pivot: Annotated[Vector, LENGTH] | None = None
    """Centre of rotation in the undeformed position; it moves with the obstacle. The centre of a disk by
    default."""

    def pivot_on(self, obstacle: AnyObstacle) -> Point | None:
        """The point about which it turns an obstacle, None if the case gives none."""
        return self.pivot or (obstacle.center if isinstance(obstacle, DiskObstacle) else None)

    def faults(self, scope: Scope) -> Iterator[Fault]:
        if not self.control and not self.rotation:
            hint = "give force, displacement, or ux/uy/fx/fy"
            yield Fault((), "the motion of an obstacle needs a direction", hint)
        yield from scope.finite_only(self.rotation, ("rotation",), "an obstacle that turns")
        obstacles = {contact.name: contact.obstacle for contact in scope.case.contact}
        obstacle = obstacles.get(self.obstacle)
        if self.obstacle not in scope.names("contact"):
            fitting = [name for name in obstacles if obstacles[name] is not None] or obstacles
            hint = suggestion(self.obstacle, fitting, "contacts with an obstacle")
            yield Fault(("obstacle",), f'there is no contact "{self.obstacle}"', hint)
        elif self.obstacle in obstacles and obstacle is None:
            message = f'contact "{self.obstacle}" has a master and no obstacle'
            yield Fault(("obstacle",), message, 'a load of kind "platen" moves a boundary')
        motions = [load for load in scope.case.load if isinstance(load, ObstacleMotion)]
        earlier = [load for load in self.earlier(motions) if load.obstacle == self.obstacle]
        for direction, (control, _) in self.control.items():
            first = next((load for load in earlier if direction in load.control), self)
            other = first.control[direction][0]
            if other != control:
                message = (
                    f'{control} here, {other} in load "{first.name}" on the same obstacle in {direction}'
                )
                yield Fault((), message, "use one of the two in each direction")
        if obstacle is not None and self.rotation and scope.strain == "finite":
            pivot = self.pivot_on(obstacle)
            others = {load.pivot_on(obstacle) for load in earlier if load.rotation}
            if pivot is None:
                yield Fault(("rotation",), "needs a pivot", "give pivot")
            elif others - {None, pivot}:
                message = "differs from that of another load on the same obstacle"
                yield Fault(("pivot",), message, "one pivot for all")


# In the order of the reference.
_FirstKinds = Traction | Pressure | Displacement | Platen | Force
AnyLoad = _FirstKinds | BodyForce | Centrifugal | Temperature | ObstacleMotion
