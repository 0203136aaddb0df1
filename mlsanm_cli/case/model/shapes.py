"""Shapes of bodies: their keys. Geometry is computed and checked on outlines (``cloud``)."""

import math
from collections.abc import Iterator, Sequence
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, Field, ValidationInfo, WithJsonSchema, model_validator

from mlsanm_cli.case.model.section import ANGLE, LENGTH, Name, Positive, Scope, Section, Vector
from mlsanm_cli.case.model.tables import with_points
from mlsanm_cli.case.report import KeyPath
from mlsanm_cli.errors import Fault

Center = Annotated[Vector, LENGTH]
Radius = Annotated[Positive, LENGTH]
Degrees = Annotated[float, Field(gt=0.0, lt=180.0)]


def _absolute(file: str, info: ValidationInfo) -> str:
    """The absolute path of a file named relative to the folder of the case."""
    return file if info.context is None else str((info.context / file).absolute())


class _Shape(Section):
    kind: str
    """Kind of shape."""


class _Circle(Section):
    center: Center
    """Centre of the circle."""
    radius: Radius
    """Radius of the circle."""


class _FileShape(_Shape):
    """A shape read from a file."""

    file: Annotated[str, Field(min_length=1), AfterValidator(_absolute)]
    """Path, relative to the case file."""
    corner: Annotated[Degrees, ANGLE] = 40.0
    """Angle between the outline's edges at a node above which the node is a corner."""
    sha256: str | None = None
    """SHA-256 of the file when the case was resolved; a changed file is an error."""


class Mesh(_FileShape):
    """A mesh of triangles and quadrilaterals."""

    kind: Literal["mesh"]
    use: Literal["nodes", "outline"] = "nodes"
    """Use the nodes of the mesh, or only its outline, filled with nodes of the given `spacing`."""
    group: str | None = None
    """Group of elements that forms the body; all elements by default."""

    @property
    def has_nodes(self) -> bool:
        """Whether the nodes are read from the file."""
        return self.use == "nodes"


class Points(_FileShape):
    """Nodes with the names of their boundaries."""

    kind: Literal["points"]

    @property
    def has_nodes(self) -> bool:
        """Always."""
        return True


FileShape = Mesh | Points


RADIUS_SCHEMA = {"type": "number", "minimum": 0.0}


class Rectangle(_Shape):
    """A rectangle with sides along the axes; boundaries left, right, bottom, top."""

    kind: Literal["rectangle"]
    x: Annotated[Vector, LENGTH]
    """Range in x, the smaller number first."""
    y: Annotated[Vector, LENGTH]
    """Range in y, the smaller number first."""

    def faults(self, scope: Scope) -> Iterator[Fault]:
        for axis, (low, high) in (("x", self.x), ("y", self.y)):
            if not low < high:
                yield Fault((axis,), f"[{low:g}, {high:g}] is not a range", "the smaller number first")


class Disk(_Circle, _Shape):
    """A full disk; its only boundary is ``arc``."""

    kind: Literal["disk"]


class HalfDisk(_Circle, _Shape):
    """Half a disk; the boundary ``flat`` is the cut through the centre, ``arc`` the rest."""

    kind: Literal["half-disk"]
    side: Literal["lower", "upper", "left", "right"]
    """The half that is kept."""


class _Ring(_Shape):
    """A ring or a part of one."""

    center: Center
    """Centre of the circles."""
    radii: Annotated[Vector, LENGTH]
    """Inner and outer radius."""

    def faults(self, scope: Scope) -> Iterator[Fault]:
        if not 0.0 < self.radii[0] < self.radii[1]:
            yield Fault(("radii",), "must be the inner and the outer radius, both above 0")


class Sector(_Ring):
    """Part of a ring between two radii and two angles; boundaries outer, end, inner, start."""

    kind: Literal["sector"]
    angles: Annotated[Vector, ANGLE]
    """First and last angle, counter-clockwise from the x axis; the straight sides are `start` and `end`."""

    def faults(self, scope: Scope) -> Iterator[Fault]:
        yield from super().faults(scope)
        if not 0.0 < self.angles[1] - self.angles[0] < 360.0:
            yield Fault(("angles",), "must increase by less than 360 degrees", "as in [0.0, 90.0]")


class Annulus(_Ring):
    """A whole ring; boundaries outer and inner."""

    kind: Literal["annulus"]


class Hole(_Circle):
    """A circular hole; its boundary is called ``name``."""

    name: Name | None = None
    """Name of its boundary; hole1, hole2 and so on by default."""


class Polygon(_Shape):
    """A polygon with rounded corners and circular holes. Sides and arcs of one name are one boundary."""

    kind: Literal["polygon"]
    points: Annotated[tuple[Vector, ...], Field(min_length=3), LENGTH]
    """Corners in either direction; the last is joined to the first automatically."""
    names: tuple[Name, ...] = ()
    """Names of the sides, one per point: from that point to the next; side1, side2 ... by default."""
    rounding: Annotated[
        tuple[Annotated[float, Field(ge=0.0)], ...],
        WithJsonSchema({"anyOf": [{"type": "array", "items": RADIUS_SCHEMA}, RADIUS_SCHEMA]}),
        LENGTH,
    ] = ()
    """Radius of the arc at each point (0: sharp corner), or one radius for all; all sharp by default."""
    corners: tuple[Name | Literal[""], ...] = ()
    """Names of the arcs, one per point; "" for the default: the common name of both adjacent sides, else
    corner1 ..."""
    holes: tuple[Hole, ...] = ()

    @model_validator(mode="before")
    @classmethod
    def _rounded_alike(cls, data: Any) -> Any:
        """A single radius applies to all corners."""
        radius, points = (data.get(key) if isinstance(data, dict) else None for key in ("rounding", "points"))
        if isinstance(radius, bool) or not isinstance(radius, int | float) or not isinstance(points, tuple):
            return data
        # An invalid radius is kept once, to be reported once.
        return {**data, "rounding": (radius,) * (len(points) if 0.0 <= radius < math.inf else 1)}

    def faults(self, scope: Scope) -> Iterator[Fault]:
        for key in ("names", "rounding", "corners"):
            given = len(getattr(self, key))
            if given not in (0, len(self.points)):
                yield Fault((key,), f"has {given} items for {len(self.points)} points", "one per point")
        sides = side_names(self)
        # Names that the shape gives to sides, holes and the arcs between sides of different names.
        default = {*sides[len(self.names) :], *hole_names(self)}
        for number, radius in enumerate(self.rounding[: len(sides)]):
            named = number < len(self.corners) and self.corners[number]
            if radius and not named and sides[number - 1] != sides[number]:
                default.add(f"corner{number + 1}")
        for name in dict.fromkeys([*self.names, *filter(None, self.corners)]):
            if name in default:
                given_to_side = name in self.names
                yield _twice(("names", self.names.index(name)) if given_to_side else ("corners",), name)
        yield from _hole_faults(self, [name for name in sides if name not in self.names])


class OutlineSide(Section):
    """A side of an outline: a straight line to a point, or a smooth curve through points; with neither, the
    straight line from the end of the previous side to the start of the next one."""

    name: Name | None = None
    """Name of the boundary; side1, side2 and so on by default. Sides of one name are one boundary."""
    to: Annotated[Vector, LENGTH] | None = None
    """End of the straight line, which starts at the end of the previous side."""
    points: Annotated[tuple[Vector, ...], Field(min_length=2), LENGTH] | None = None
    """Points of a smooth curve (cubic spline); an only side repeats its first point at the end."""
    file: Annotated[str, Field(min_length=1)] | None = None
    """CSV file of these points with the header x,y; relative paths are relative to the case file."""

    _read = model_validator(mode="before")(with_points)

    def faults(self, scope: Scope) -> Iterator[Fault]:
        yield from self.exclusive("to", "points", "file", required=False)


class OutlineShape(_Shape):
    """Consecutive sides around the body, in either direction, and circular holes. Every side starts at the
    end of the previous one, the first at the end of the last."""

    kind: Literal["outline"]
    sides: Annotated[tuple[OutlineSide, ...], Field(min_length=1)]
    holes: tuple[Hole, ...] = ()

    def faults(self, scope: Scope) -> Iterator[Fault]:
        explicit = {side.name for side in self.sides}
        for number, (side, name) in enumerate(zip(self.sides, side_names(self), strict=True)):
            if side.name is None and name in explicit:
                yield _twice(("sides", number), name)
        yield from _hole_faults(self, side_names(self))


DrawnShape = Rectangle | Disk | HalfDisk | Sector | Annulus | Polygon | OutlineShape
"""Shapes whose geometry is given in the case file."""
AnyShape = DrawnShape | Mesh | Points
Shape = Annotated[AnyShape, Field(discriminator="kind")]


def side_names(shape: Polygon | OutlineShape) -> tuple[str, ...]:
    """Names of all sides, default ones included."""
    given = shape.names if isinstance(shape, Polygon) else tuple(side.name for side in shape.sides)
    count = len(shape.points) if isinstance(shape, Polygon) else len(shape.sides)
    given = (*given, *[None] * (count - len(given)))
    return tuple(name or f"side{number}" for number, name in enumerate(given, start=1))


def hole_names(shape: Polygon | OutlineShape) -> tuple[str, ...]:
    """Names of all holes, default ones included."""
    return tuple(hole.name or f"hole{number}" for number, hole in enumerate(shape.holes, start=1))


def _hole_faults(shape: Polygon | OutlineShape, sides: Sequence[str]) -> Iterator[Fault]:
    """Holes with the names of other holes or of ``sides``."""
    names = hole_names(shape)
    for number, name in enumerate(names):
        if name in [*sides, *names[:number]]:
            yield _twice(("holes", number), name)


def _twice(key: KeyPath, name: str) -> Fault:
    return Fault(key, f'"{name}" is the name of two boundaries', "rename one of them")
