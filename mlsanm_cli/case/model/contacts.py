"""``[[contact]]``: contacts between bodies and with rigid obstacles."""

import math
from collections.abc import Iterator
from itertools import pairwise
from typing import Annotated, Literal, Self

from pydantic import Field

from mlsanm_cli.case.model.conditions import Boundaries, BoundaryPart, Place, listed
from mlsanm_cli.case.model.section import (
    LENGTH,
    NUMBER,
    Amount,
    AutoLength,
    Coefficient,
    Name,
    Positive,
    Scope,
    Section,
    Vector,
)
from mlsanm_cli.errors import Fault


class _Obstacle(Section):
    kind: str
    """Kind of obstacle."""

    @property
    def curvature(self) -> float:
        """Positive where the obstacle is convex; 0 of straight sides."""
        return 0.0


class PlaneObstacle(_Obstacle):
    """A rigid half-plane, bounded by a straight line."""

    kind: Literal["plane"]
    point: Annotated[Vector, LENGTH]
    """A point on its boundary."""
    normal: Annotated[Vector, NUMBER]
    """Outward normal, of any length."""

    def faults(self, scope: Scope) -> Iterator[Fault]:
        if self.normal == (0.0, 0.0):
            hint = "it points out of the obstacle, as in [0.0, 1.0]"
            yield Fault(("normal",), "has no direction", hint)


class DiskObstacle(_Obstacle):
    """A rigid disk, or with ``inside`` the wall of a circular hole."""

    kind: Literal["disk"]
    center: Annotated[Vector, LENGTH]
    """Centre."""
    radius: Annotated[Positive, LENGTH]
    """Radius."""
    inside: bool = False
    """Whether the rigid region is outside the circle."""

    @property
    def curvature(self) -> float:
        return (-1.0 if self.inside else 1.0) / self.radius


class PolylineObstacle(_Obstacle):
    """A rigid region bounded by straight sides, or by a smooth curve where points sample one."""

    kind: Literal["polyline"]
    points: Annotated[tuple[Vector, ...], Field(min_length=2), LENGTH]
    """Points along its boundary, with the obstacle on the left. Three or more consecutive turns of at most 15
    degrees that change gradually are treated as a smooth curve."""

    def faults(self, scope: Scope) -> Iterator[Fault]:
        for index, (a, b) in enumerate(pairwise(self.points), start=1):
            if math.dist(a, b) == 0.0:
                yield Fault(("points", index), "repeats the previous point")


AnyObstacle = PlaneObstacle | DiskObstacle | PolylineObstacle
Obstacle = Annotated[AnyObstacle, Field(discriminator="kind")]


class Regularization(Section):
    """The contact and friction law."""

    law: Literal["exact", "hyperbolic"] = "exact"
    """Exact Signorini and Coulomb conditions, or the regularised contact law (a smooth hyperbola), required
    by power series and Newton-Raphson; the same in all contacts. Hyperbolic by default if another parameter
    of this table, `solver.method` `"anm"` or `"newton"` or the monolithic formulation requires it; not with
    bonds, obstacles, interference, bodies held by contact only, or at finite strain."""
    eta: Annotated[Positive, NUMBER] = 1e-4
    """Regularisation parameter of the hyperbolic law, relative to the largest pressure."""
    stick: Annotated[Positive, NUMBER] = 1e-4
    """Slip at the onset of sliding, relative to the largest slip at full sliding (hyperbolic law only)."""


class Contact(BoundaryPart):
    """A possible contact between two boundaries, or between a boundary and a rigid obstacle. ``from`` and
    ``to`` restrict it to a part of the slave."""

    name: Name
    """Name of the contact."""
    slave: Boundaries
    """Boundary that carries the contact pressures, or a list of boundaries that join end to end. Choose the
    one with the finer nodes or the smaller radius."""
    master: Boundaries | None = None
    """Opposite boundary, or a list of boundaries that join end to end; give `master` or `obstacle`."""
    obstacle: Obstacle | None = None
    """Rigid obstacle instead of a master."""
    interference: Annotated[Positive, LENGTH] | None = None
    """Interference of a press fit: the largest overlap of the undeformed surfaces."""
    gap: Annotated[Amount, LENGTH] = 0.0
    """Initial gap in addition to the drawn one: a number or an expression in the coordinates x, y of the
    slave, for crowned, wavy or rough profiles."""
    friction: Annotated[Coefficient, NUMBER] = 0.0
    """Coulomb's coefficient of friction, or `"bonded"`: touching surfaces are tied together and also carry
    tension."""
    accuracy: Annotated[float, Field(gt=0.0, le=0.1), NUMBER] = 1e-3
    """Tolerance of the contact grid: error of the pressures relative to the largest pressure."""
    reach: Annotated[AutoLength, LENGTH] = "auto"
    """Search distance: nodes with a larger initial gap are ignored; the run fails if one of them closes.
    Without effect at finite strain, where contacts may move anywhere."""
    regularization: Regularization = Regularization.model_construct()

    @property
    def bonded(self) -> bool:
        return self.friction == "bonded"

    def regularized(self) -> Self:
        """The contact with the regularised law."""
        law = self.regularization.model_copy(update={"law": "hyperbolic"})
        return self.model_copy(update={"regularization": law})

    @property
    def coefficient(self) -> float:
        """Coulomb's coefficient; inf for bonded surfaces."""
        return math.inf if self.friction == "bonded" else self.friction

    @property
    def boundaries(self) -> tuple[str, ...]:
        """Its boundaries of elastic bodies: those of the slave and of the master, if there is one."""
        return tuple(name for side in self.sides for name in side.boundaries)

    @property
    def sides(self) -> tuple[Place, ...]:
        """The slave and, if there is one, the master."""
        master = () if self.master is None else (Place(listed(self.master)),)
        return (Place(listed(self.slave), self.ends), *master)

    @property
    def names(self) -> tuple[str, ...]:
        return tuple(side.label for side in self.sides)

    def faults(self, scope: Scope) -> Iterator[Fault]:
        yield from self.exclusive("master", "obstacle")
        if self.obstacle is not None and self.bonded:
            hint = "fix the boundary with a [[support]], or move it with a platen"
            yield Fault(("friction",), "bonding to a rigid obstacle is not possible", hint)
        elif self.master is not None and self.obstacle is None:
            yield from self._pair_faults(scope)
        if self.interference is not None and self.name in scope.names("load"):
            message = f'a load is called "{self.name}" too, which is ambiguous in stages'
            yield Fault(("name",), message)
        yield from self._law_faults(scope)
        yield from scope.refused(self.bonded, ("friction",), "bonded surfaces", "a coefficient")
        hint = "include it in the shape or position of the body"
        yield from scope.refused(self.gap, ("gap",), "an additional gap", hint)
        yield from scope.refused(self.interference, ("interference",), "an interference", "move the obstacle")
        law, key = self.regularization.law, ("regularization", "law")
        yield from scope.refused(law != "exact", key, f'the "{law}" contact law', 'law = "exact"')

    def _pair_faults(self, scope: Scope) -> Iterator[Fault]:
        slave, master = (side.boundaries for side in self.sides)
        common = [name for name in master if name in slave]
        if common:
            single = len(self.boundaries) == 2
            part = f"{common[0]} is part of the slave too"
            yield Fault(("master",), "slave and master are the same boundary" if single else part)
            return
        if self.sides[0].body == self.sides[1].body:
            message = f"self-contact (body {self.sides[0].body}) is not supported yet"
            yield Fault((), message, "slave and master must belong to two bodies")
        if self.bonded:
            for key in ("interference", "gap", "reach", "regularization"):
                if getattr(self, key) != type(self).model_fields[key].default:
                    yield Fault((key,), "does not apply to bonded surfaces", "remove it")
        pair = {*self.boundaries}, self.ends
        for other in [c for c in self.earlier(scope.case.contact) if ({*c.boundaries}, c.ends) == pair][:1]:
            yield Fault((), f'the same two boundaries as contact "{other.name}"')

    def _law_faults(self, scope: Scope) -> Iterator[Fault]:
        """All contacts have one law, the hyperbolic one between elastic bodies drawn without overlap."""
        if self.bonded:
            return
        law, first, key = self.regularization.law, scope.case.touching[0].regularization.law, "regularization"
        if law != first:
            message = f'"{law}" here, "{first}" in another contact'
            hint = "use one law in all contacts; mixed laws are not supported yet"
            yield Fault((key, "law"), message, hint)
        if law == "exact":
            return
        if self.obstacle is not None or self.interference is not None:
            yield Fault((key, "law"), "obstacles and interference need the exact law", 'law = "exact"')
        for bond in [contact.name for contact in scope.case.contact if contact.bonded]:
            yield Fault((key, "law"), f"bonds (contact {bond}) need the exact law", 'law = "exact"')
