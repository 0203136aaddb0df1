"""Round shapes: disk, half a disk, ring and part of a ring.

Lengths are in the case's own unit.
"""

from __future__ import annotations

import math
from typing import Annotated, Literal

from mlsanm_cli.case.model.base import ANGLE, LENGTH, Positive, Section, Vector
from mlsanm_cli.case.model.chains import Point

_OUTWARD: dict[str, float] = {"right": 0.0, "upper": 0.5 * math.pi, "left": math.pi, "lower": 1.5 * math.pi}


class Annulus(Section):
    """A whole ring; ``radii`` are its inner and outer radius."""

    kind: Literal["annulus"]
    """What the shape is."""
    center: Annotated[Vector, LENGTH]
    """Centre of the circle."""
    radii: Annotated[Vector, LENGTH]
    """Inner and outer radius."""

    @property
    def boundaries(self) -> tuple[str, ...]:
        """Names of the boundaries."""
        return ("outer", "inner")

    @property
    def centre(self) -> Point:
        """Centre of the ring."""
        return self.center

    @property
    def size(self) -> float:
        """Largest extent."""
        return 2.0 * self.radii[1]

    def samples(self, boundary: str) -> tuple[Point, ...]:
        """Points that span the boundary: four on the circle."""
        quarters = tuple(0.5 * math.pi * k for k in range(4))
        return _on_arc(self.center, self.radii[boundary == "outer"], quarters)

    def normal(self, boundary: str) -> Point | None:
        """None: both boundaries are curved."""
        return None

    def curvature(self, boundary: str) -> float:
        """1/R, positive for a convex boundary."""
        return {"inner": -1.0 / self.radii[0], "outer": 1.0 / self.radii[1]}[boundary]


class Disk(Section):
    """A full disk; its only boundary is ``arc``."""

    kind: Literal["disk"]
    """What the shape is."""
    center: Annotated[Vector, LENGTH]
    """Centre of the circle."""
    radius: Annotated[Positive, LENGTH]
    """Radius of the circle."""

    @property
    def boundaries(self) -> tuple[str, ...]:
        """Names of the boundaries."""
        return ("arc",)

    @property
    def centre(self) -> Point:
        """Centre of the disk."""
        return self.center

    @property
    def size(self) -> float:
        """Largest extent."""
        return 2.0 * self.radius

    def samples(self, boundary: str) -> tuple[Point, ...]:
        """Points that span the boundary: four on the circle."""
        return _on_arc(self.center, self.radius, tuple(0.5 * math.pi * k for k in range(4)))

    def normal(self, boundary: str) -> Point | None:
        """None: the boundary is curved."""
        return None

    def curvature(self, boundary: str) -> float:
        """1/R, positive for a convex boundary."""
        return 1.0 / self.radius


class HalfDisk(Section):
    """Half a disk on one side of its centre; ``flat`` is the cut, ``arc`` the rest."""

    kind: Literal["half-disk"]
    """What the shape is."""
    center: Annotated[Vector, LENGTH]
    """Centre of the circle."""
    radius: Annotated[Positive, LENGTH]
    """Radius of the circle."""
    side: Literal["lower", "upper", "left", "right"]
    """The half that is kept."""

    @property
    def boundaries(self) -> tuple[str, ...]:
        """Names of the boundaries."""
        return ("arc", "flat")

    @property
    def centre(self) -> Point:
        """Centre of the whole disk."""
        return self.center

    @property
    def size(self) -> float:
        """Largest extent."""
        return 2.0 * self.radius

    def samples(self, boundary: str) -> tuple[Point, ...]:
        """Points that span the boundary: the ends of the cut, three on the arc."""
        middle = _OUTWARD[self.side]
        turns = (-0.5, 0.5) if boundary == "flat" else (-0.5, 0.0, 0.5)
        return _on_arc(self.center, self.radius, tuple(middle + math.pi * turn for turn in turns))

    def normal(self, boundary: str) -> Point | None:
        """Outward normal of the cut, None on the arc."""
        if boundary == "arc":
            return None
        normals = {"lower": (0.0, 1.0), "upper": (0.0, -1.0), "left": (1.0, 0.0), "right": (-1.0, 0.0)}
        return normals[self.side]

    def curvature(self, boundary: str) -> float:
        """1/R, positive for a convex boundary."""
        return 1.0 / self.radius if boundary == "arc" else 0.0


class Sector(Section):
    """A part of a ring: ``radii`` are its inner and outer radius, ``angles`` its range in degrees.

    Angles count counter-clockwise from the x axis; ``start`` and ``end`` are the straight sides.
    """

    kind: Literal["sector"]
    """What the shape is."""
    center: Annotated[Vector, LENGTH]
    """Centre of the circle."""
    radii: Annotated[Vector, LENGTH]
    """Inner and outer radius."""
    angles: Annotated[Vector, ANGLE]
    """From and to, counter-clockwise from the x axis."""

    @property
    def boundaries(self) -> tuple[str, ...]:
        """Names of the boundaries."""
        return ("outer", "end", "inner", "start")

    @property
    def centre(self) -> Point:
        """Centre of the ring."""
        return self.center

    @property
    def size(self) -> float:
        """Largest extent."""
        return 2.0 * self.radii[1]

    def samples(self, boundary: str) -> tuple[Point, ...]:
        """Points that span the boundary: the ends of a side, three on an arc."""
        first, last = (math.radians(angle) for angle in self.angles)
        if boundary in ("inner", "outer"):
            radius = self.radii[boundary == "outer"]
            return _on_arc(self.center, radius, (first, 0.5 * (first + last), last))
        angle = first if boundary == "start" else last
        return tuple(_on_arc(self.center, radius, (angle,))[0] for radius in self.radii)

    def normal(self, boundary: str) -> Point | None:
        """Outward normal of a straight side, None on an arc."""
        if boundary in ("inner", "outer"):
            return None
        sign, angle = (-1.0, self.angles[0]) if boundary == "start" else (1.0, self.angles[1])
        turn = math.radians(angle) + sign * 0.5 * math.pi
        # Sides along an axis have their normal along the other one, without round-off.
        return round(math.cos(turn), 15) + 0.0, round(math.sin(turn), 15) + 0.0

    def curvature(self, boundary: str) -> float:
        """1/R, positive for a convex boundary."""
        return {"inner": -1.0 / self.radii[0], "outer": 1.0 / self.radii[1]}.get(boundary, 0.0)


def _on_arc(center: Point, radius: float, angles: tuple[float, ...]) -> tuple[Point, ...]:
    return tuple((center[0] + radius * math.cos(a), center[1] + radius * math.sin(a)) for a in angles)
