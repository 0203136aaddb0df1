"""``[[body]]``: bodies, their shapes and the spacing of their nodes. Outlines are checked in ``cloud``."""

import math
from collections.abc import Iterator, Sequence
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, Field, ValidationInfo, WithJsonSchema, model_validator

from mlsanm_cli.case.model.expressions import with_points
from mlsanm_cli.case.model.section import (
    ANGLE,
    LENGTH,
    NUMBER,
    AutoLength,
    Name,
    Positive,
    Scope,
    Section,
    Vector,
)
from mlsanm_cli.case.report import KeyPath, suggestion
from mlsanm_cli.errors import Fault
from mlsanm_cli.roundoff import ROUND_OFF


def _absolute(file: str, info: ValidationInfo) -> str:
    """The absolute path of a file named relative to the folder of the case."""
    return file if info.context is None else str((info.context / file).absolute())


class _Shape(Section):
    kind: str
    """Kind of shape."""

    @property
    def has_nodes(self) -> bool:
        """Whether the nodes are read from a file."""
        return False


class _Circle(Section):
    center: Annotated[Vector, LENGTH]
    """Centre of the circle."""
    radius: Annotated[Positive, LENGTH]
    """Radius of the circle."""


class _FileShape(_Shape):
    """A shape read from a file."""

    file: Annotated[str, Field(min_length=1), AfterValidator(_absolute)]
    """Path, relative to the case file."""
    corner: Annotated[float, Field(gt=0.0, lt=180.0), ANGLE] = 40.0
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
        return self.use == "nodes"


class Points(_FileShape):
    """Nodes with the names of their boundaries."""

    kind: Literal["points"]

    @property
    def has_nodes(self) -> bool:
        return True


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

    center: Annotated[Vector, LENGTH]
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
        if not 0.0 < self.angles[1] - self.angles[0] < 360.0:
            yield Fault(("angles",), "must increase by less than 360 degrees", "as in [0.0, 90.0]")


class Annulus(_Ring):
    """A whole ring; boundaries outer and inner."""

    kind: Literal["annulus"]


class Hole(_Circle):
    """A circular hole; its boundary is called ``name``."""

    name: Name | None = None
    """Name of its boundary; hole1, hole2 and so on by default."""


RADIUS_SCHEMA = {"type": "number", "minimum": 0.0}


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
                yield _twice(("names", self.names.index(name)) if name in self.names else ("corners",), name)
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


FileShape = Mesh | Points
DrawnShape = Rectangle | Disk | HalfDisk | Sector | Annulus | Polygon | OutlineShape
"""Shapes whose geometry is given in the case file."""
AnyShape = DrawnShape | FileShape


def side_names(shape: Polygon | OutlineShape) -> tuple[str, ...]:
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


class Refine(Section):
    """Local refinement near a point or a boundary. Where several overlap, the smallest spacing applies."""

    at: Annotated[Vector, LENGTH] | None = None
    """Point to refine around; give `at` or `along`."""
    along: str | None = None
    """Boundary of the body to refine along; give `at` or `along`."""
    spacing: Annotated[Positive, LENGTH]
    """Node spacing within `radius` of the point or boundary, at most that of the body."""
    radius: Annotated[float, Field(ge=0.0), LENGTH]
    """Distance up to which the spacing is constant; beyond it grows."""
    growth: Annotated[float, Field(gt=0.0, le=1.0), NUMBER] = 0.12
    """Increase of the spacing per unit length outside `radius`; values above 0.3 cause a warning."""

    def edge(self, body: str) -> str:
        """The boundary in ``along`` without the name of its body, which is optional there."""
        return (self.along or "").removeprefix(f"{body}.")

    def faults(self, scope: Scope) -> Iterator[Fault]:
        yield from self.exclusive("at", "along")


class Body(Section):
    """An elastic body: its material, its shape and the spacing of its nodes."""

    name: Name
    """Name of the body; its boundaries are addressed as `<body>.<boundary>`."""
    material: str
    """Name of its material."""
    spacing: Annotated[AutoLength, LENGTH] = "auto"
    """Node spacing away from refinements. `"auto"` is 1/20 of the body's size or 1/6 of its mean thickness,
    whichever is smaller, less for strongly orthotropic materials, and finer along arcs, in narrow
    parts, at ends of clamped sides, where loads vary or end within a side, near contacts close to another
    boundary, at corners other than right ones that touch an obstacle, and at finite strain along surfaces in
    contact."""
    seed: Annotated[int, Field(ge=0, lt=2**63)] = 0
    """Seed of the random generator that places the nodes; it changes the cloud, not its spacing."""
    shape: Annotated[AnyShape, Field(discriminator="kind")]
    refine: tuple[Refine, ...] = ()

    @property
    def has_nodes(self) -> bool:
        """Whether the nodes are read from a file."""
        return self.shape.has_nodes

    def faults(self, scope: Scope) -> Iterator[Fault]:
        if self.has_nodes:
            also = "" if isinstance(self.shape, Points) else ' (use = "outline" places new ones)'
            for name in ("spacing", "refine", "seed"):
                if getattr(self, name) != type(self).model_fields[name].default:
                    message = f"does not apply: the nodes are those of the file{also}"
                    yield Fault((name,), message, "remove it")
            return
        given = self.spacing if isinstance(self.spacing, float) else math.inf
        spacings: list[tuple[KeyPath, float]] = [(("spacing",), given)]
        for number, refine in enumerate(self.refine):
            spacings.append((("refine", number, "spacing"), refine.spacing))
            if refine.spacing > given:
                message = f"{refine.spacing:g} is larger than the body's spacing {given:g}"
                yield Fault(("refine", number, "spacing"), message, "a refinement can only reduce it")
        shape = scope.geometries.get(self.name)
        if shape is None:
            return
        far = max(map(abs, shape.centre)) + shape.size
        smallest = ROUND_OFF * far
        for key, spacing in spacings:
            if spacing < smallest:
                message = f"{spacing:g} is below round-off for coordinates up to {far:g}"
                yield Fault(key, message, f"at least {smallest:.2g}")
        if math.inf > given > shape.size > 0.0:
            yield Fault(("spacing",), f"{given:g} is larger than the body ({shape.size:g})")
        for number, refine in enumerate(self.refine):
            edge = refine.edge(self.name)
            if refine.along is not None and edge not in shape.boundaries:
                hint = suggestion(edge, shape.boundaries, "boundaries")
                message = f'body "{self.name}" has no boundary "{refine.along}"'
                yield Fault(("refine", number, "along"), message, hint)
