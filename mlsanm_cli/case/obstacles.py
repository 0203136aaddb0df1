"""Rigid obstacles: shapes that a slave boundary can be pressed on instead of another body's boundary."""

from __future__ import annotations

import math
from typing import Annotated, Literal

from pydantic import Field

from mlsanm_cli.case.base import LENGTH, NUMBER, Positive, Section, Vector
from mlsanm_cli.case.lines import KeyPath
from mlsanm_cli.case.report import Report


class PlaneObstacle(Section):
    """All that lies behind a straight line through ``point``, which ``normal`` points away from."""

    kind: Literal["plane"]
    """Kind of obstacle."""
    point: Annotated[Vector, LENGTH]
    """A point of it."""
    normal: Annotated[Vector, NUMBER]
    """A vector of any length that points out of it."""

    @property
    def curvature(self) -> float:
        """Straight."""
        return 0.0


class DiskObstacle(Section):
    """A disk; with ``inside`` all around it instead, as the wall of a hole."""

    kind: Literal["disk"]
    """Kind of obstacle."""
    center: Annotated[Vector, LENGTH]
    """Its centre."""
    radius: Annotated[Positive, LENGTH]
    """Its radius."""
    inside: bool = False
    """Whether it is what lies around the circle, as around a hole."""

    @property
    def curvature(self) -> float:
        """Positive where the obstacle is convex."""
        return (-1.0 if self.inside else 1.0) / self.radius


class PolylineObstacle(Section):
    """Straight sides from point to point, the obstacle on their left."""

    kind: Literal["polyline"]
    """Kind of obstacle."""
    points: Annotated[tuple[Vector, ...], Field(min_length=2), LENGTH]
    """Its corners, the obstacle on the left of the way along them."""

    @property
    def curvature(self) -> float:
        """Straight."""
        return 0.0


AnyObstacle = PlaneObstacle | DiskObstacle | PolylineObstacle
Obstacle = Annotated[AnyObstacle, Field(discriminator="kind")]


def check_obstacle(obstacle: AnyObstacle, path: KeyPath, report: Report) -> None:
    """Adds a problem for a normal without direction, sides without length, and sides that fold back."""
    if isinstance(obstacle, PlaneObstacle) and obstacle.normal == (0.0, 0.0):
        report.add((*path, "normal"), "points nowhere", "it points out of the obstacle, as in [0.0, 1.0]")
    if isinstance(obstacle, PolylineObstacle):
        for index, (a, b) in enumerate(zip(obstacle.points[:-1], obstacle.points[1:], strict=True)):
            if math.dist(a, b) == 0.0:
                report.add((*path, "points", index + 1), "repeats the point before it")
