"""Loads on boundaries and in bodies."""

from collections.abc import Iterator
from typing import Annotated, Any, Literal

from pydantic import Field

from mlsanm_cli.case.model.conditions import Boundaries, BoundaryPart, Kind, Place, listed
from mlsanm_cli.case.model.expressions import INCREASING, OrFile
from mlsanm_cli.case.model.section import (
    DENSITY,
    FORCE,
    LENGTH,
    MOMENT,
    STRESS,
    TEMPERATURE,
    Amount,
    AmountVector,
    Name,
    Point,
    Positive,
    Scope,
    Section,
    Unit,
    Vector,
    split_boundary,
)
from mlsanm_cli.errors import Fault


class Load(Section):
    """Keys and properties of every load. By default it acts on no boundary and on no body."""

    kind: str
    """Kind of load."""
    name: Name
    """Name of the load, used by stages."""

    @property
    def places(self) -> tuple[Place, ...]:
        """The loaded regions of boundaries, one per body; only platens have more than one."""
        return ()

    @property
    def owners(self) -> tuple[str, ...]:
        return tuple(place.body for place in self.places)

    @property
    def owner(self) -> str:
        """The first loaded body; "" if no body is loaded directly."""
        return next(iter(self.owners), "")

    def conditions(self, normal: Point | None) -> Iterator[tuple[int, Kind]]:
        """The components that it prescribes on a boundary; ``normal`` is that of a straight one."""
        yield from ()


class OnBoundary(BoundaryPart, Load):
    boundary: Boundaries
    """Loaded boundary, or a list of boundaries of one body."""

    @property
    def places(self) -> tuple[Place, ...]:
        names = listed(self.boundary)
        bodies = dict.fromkeys(split_boundary(name)[0] for name in names)
        surfaces = [tuple(name for name in names if split_boundary(name)[0] == body) for body in bodies]
        return tuple(Place(surface, self.ends) for surface in surfaces)

    @property
    def place(self) -> Place:
        return self.places[0]


TractionTable = Annotated[tuple[tuple[float, float, float], ...], OrFile("s", "tx", "ty"), INCREASING, STRESS]
PressureTable = Annotated[tuple[tuple[float, float], ...], OrFile("s", "pressure"), INCREASING, STRESS]


class Traction(OnBoundary):
    """Traction on a boundary: constant, an expression in x and y, or a table over the arc length."""

    kind: Literal["traction"]
    traction: Annotated[AmountVector, STRESS] | None = None
    """Components in x and y: numbers or expressions in x and y."""
    table: TractionTable | None = None
    """Rows [arc length, x component, y component], interpolated linearly, or a CSV file with the header
    s,tx,ty; instead of `traction`."""

    def conditions(self, normal: Point | None) -> Iterator[tuple[int, Kind]]:
        pulled = (0, 1) if self.traction is None else [k for k in (0, 1) if self.traction[k] != 0.0]
        yield from ((component, "traction") for component in pulled)

    def faults(self, scope: Scope) -> Iterator[Fault]:
        yield from self.exclusive("traction", "table")


class Pressure(OnBoundary):
    """Pressure on a boundary: constant, an expression in x and y, or a table over the arc length."""

    kind: Literal["pressure"]
    pressure: Annotated[Amount, STRESS] | None = None
    """Pressure, positive in compression: a number or an expression in x and y."""
    table: PressureTable | None = None
    """Rows [arc length, pressure], interpolated linearly, or a CSV file with the header s,pressure; instead
    of `pressure`."""
    follows: bool = False
    """Follower load (finite strain): pressure per current length along the current normal. Otherwise force
    and direction are those of the undeformed boundary."""

    def conditions(self, normal: Point | None) -> Iterator[tuple[int, Kind]]:
        # A pressure on a boundary parallel to an axis has no component along that axis.
        yield from ((k, "traction") for k in (0, 1) if normal is None or normal[k] != 0.0)

    def faults(self, scope: Scope) -> Iterator[Fault]:
        yield from self.exclusive("pressure", "table")
        yield from scope.finite_only(self.follows, ("follows",), "a follower load")
        thin = self.follows and not scope.confined
        yield from scope.refused(thin, ("follows",), "a follower pressure in plane stress", "follows = false")


class Displacement(OnBoundary):
    """Prescribed displacement of a boundary: both components, or ``ux`` or ``uy`` alone."""

    kind: Literal["displacement"]
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

    def conditions(self, normal: Point | None) -> Iterator[tuple[int, Kind]]:
        yield from ((k, "displacement") for k, value in enumerate(self.components) if value is not None)

    def faults(self, scope: Scope) -> Iterator[Fault]:
        yield from self.exclusive("displacement", *(self.given("ux", "uy")[:1] or ("ux", "uy")))


class _InBody(Load):
    body: str
    """The loaded body."""

    @property
    def owners(self) -> tuple[str, ...]:
        return (self.body,)


class BodyForce(_InBody):
    """Body force per unit volume."""

    kind: Literal["body-force"]
    body_force: Annotated[AmountVector, DENSITY] = Field(alias="body-force")
    """Components in x and y: numbers or expressions in x and y."""


class Force(BoundaryPart, Load):
    """Force and moment, per unit thickness, on a body or a boundary. The force is spread evenly over the area
    or length, the moment in proportion to the distance from its centroid."""

    kind: Literal["force"]
    body: str | None = None
    """The loaded body; instead of `boundary`."""
    boundary: Boundaries | None = None
    """Loaded boundary, or a list of boundaries of one body; instead of `body`."""
    force: Annotated[Vector, FORCE] | None = None
    """Force, x and y."""
    fx: Annotated[float, FORCE] | None = None
    """Force in x; instead of `force`."""
    fy: Annotated[float, FORCE] | None = None
    """Force in y; instead of `force`."""
    moment: Annotated[float, MOMENT] | None = None
    """Moment about the centroid, counter-clockwise."""

    @property
    def total(self) -> Point:
        return self.force or (self.fx or 0.0, self.fy or 0.0)

    @property
    def places(self) -> tuple[Place, ...]:
        return (Place(listed(self.boundary), self.ends),) if self.boundary is not None else ()

    @property
    def owners(self) -> tuple[str, ...]:
        return (self.body,) if self.body is not None else super().owners

    def spread(self, size: float, centre: Point, polar: float) -> Traction | BodyForce:
        """The equivalent load; ``size`` is the area or length loaded (volume or area in bodies of
        revolution), ``centre`` its centroid, ``polar`` the integral of the squared distance from it."""
        (x, y), (fx, fy), turn = centre, self.total, (self.moment or 0.0) / polar
        density: AmountVector = (fx / size, fy / size)
        if turn:
            density = (f"{fx / size!r} - {turn!r}*(y - {y!r})", f"{fy / size!r} + {turn!r}*(x - {x!r})")
        content: dict[str, Any] = {"name": self.name}
        if self.boundary is None:
            content |= {"kind": "body-force", "body": self.body, "body-force": density}
            return BodyForce.model_validate(content)
        content |= {"kind": "traction", "boundary": self.boundary, "traction": density}
        part = {"from": self.start, "to": self.to} if self.ends is not None else {}
        return Traction.model_validate(content | part)

    def faults(self, scope: Scope) -> Iterator[Fault]:
        yield from self.exclusive("body", "boundary")
        yield from self.exclusive("force", *(self.given("fx", "fy")[:1]), required=False)
        if not self.given("force", "fx", "fy", "moment"):
            yield Fault((), 'needs a "force", "fx", "fy" or "moment"')
        if self.boundary is None and self.given("start", "to"):
            yield Fault(("from",), "a body has no parts", "give a boundary")
        if scope.case.model.revolved and (self.total[0] or self.moment):
            yield Fault((), "forces on bodies of revolution have no component in x and no moment", "give fy")


class Centrifugal(_InBody):
    """Body force of a body that turns about the line x = 0: density times omega^2 x, outwards. With `plane =
    "axisymmetric"` the axis is that of revolution."""

    kind: Literal["centrifugal"]
    omega: Annotated[float, Unit("radian per time")]
    """Angular velocity in radian per time."""
    density: Annotated[Positive, Unit("mass per volume")]
    """Mass per volume, in units in which mass times length per time squared is a force."""

    @property
    def body_force(self) -> tuple[Amount, Amount]:
        return f"{self.density * self.omega**2!r}*x", 0.0

    def faults(self, scope: Scope) -> Iterator[Fault]:
        if not scope.case.model.revolved:
            hint = 'plane = "axisymmetric", or the force as a load of kind "body-force"'
            yield Fault((), "bodies of revolution only turn about their axis", hint)


class Temperature(_InBody):
    """Temperature change of a body whose material has a thermal expansion ``alpha``."""

    kind: Literal["temperature"]
    temperature: Annotated[Amount, TEMPERATURE]
    """Temperature change: a number or an expression in x and y."""

    def faults(self, scope: Scope) -> Iterator[Fault]:
        for body in scope.case.body:
            material = scope.case.material.get(body.material) if body.name == self.body else None
            if material is not None and material.alpha is None:
                message = f'material "{body.material}" of body "{body.name}" has no thermal expansion'
                yield Fault((), message, f"give alpha in [material.{body.material}]")
