"""Rigid obstacles that a boundary may contact instead of another body."""

import math
from collections.abc import Iterator
from itertools import pairwise
from typing import Annotated, Literal

from pydantic import Field

from mlsanm_cli.case.model.fields import LENGTH, NUMBER, Positive, Vector
from mlsanm_cli.case.model.section import Scope, Section
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
