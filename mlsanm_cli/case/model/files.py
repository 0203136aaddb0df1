"""Shapes that stand in files of their own: meshes and clouds of points.

The case layer reads no such file. Whoever loads a case hands in a `Survey`, which looks into the file and
tells what the checks of the case want to know of it.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Annotated, Literal, Protocol

from pydantic import Field

from mlsanm_cli.case.model.base import ANGLE, Section
from mlsanm_cli.case.model.chains import Point
from mlsanm_cli.errors import GeometryError

Degrees = Annotated[float, Field(gt=0.0, lt=180.0)]


class _FileShape(Section):
    """``corner`` is the angle (degrees) above which the outline has a corner at a node.

    ``sha256`` is the file's when the case was resolved: a file that has changed since is refused.
    """

    file: Annotated[str, Field(min_length=1)]
    """The file; a relative path is relative to the case file."""
    corner: Annotated[Degrees, ANGLE] = 40.0
    """Above this angle the outline has a corner at a node."""
    sha256: str | None = None
    """SHA-256 of the file when the case was resolved: a file that has changed since is refused."""


class Mesh(_FileShape):
    """A triangle or quad mesh: its nodes become the body's, or only its outline is taken.

    ``group`` names the elements that are the body, all by default.
    """

    kind: Literal["mesh"]
    """What the shape is."""
    use: Literal["nodes", "outline"] = "nodes"
    """Whether the mesh's nodes become the body's, or its outline is filled with a cloud of `spacing`."""
    group: str | None = None
    """The group of elements that is the body; all of them by default."""

    @property
    def has_nodes(self) -> bool:
        """Whether the body's nodes are those of the file."""
        return self.use == "nodes"


class Points(_FileShape):
    """Nodes with tags on the boundary."""

    kind: Literal["points"]
    """What the shape is."""

    @property
    def has_nodes(self) -> bool:
        """Always: the body's nodes are those of the file."""
        return True


FileShape = Mesh | Points


class Geometry(Protocol):
    """What the checks of a case ask of a shape, drawn or in a file."""

    @property
    def kind(self) -> str:
        """The kind of shape, as in the case file."""
        ...

    @property
    def boundaries(self) -> tuple[str, ...]:
        """Names of the boundaries."""
        ...

    @property
    def centre(self) -> Point:
        """A point in the middle."""
        ...

    @property
    def size(self) -> float:
        """Largest extent."""
        ...

    def samples(self, boundary: str) -> tuple[Point, ...]:
        """Points that span the boundary."""
        ...

    def normal(self, boundary: str) -> Point | None:
        """Outward normal of a straight boundary, None on a curved one."""
        ...


@dataclass(frozen=True)
class Surveyed:
    """The geometry found in a file of SHA-256 ``digest``.

    ``spans`` are points that span each boundary, ``directions`` the outward normals of straight ones, None
    for curved ones.
    """

    kind: str
    digest: str
    centre: Point
    size: float
    spans: Mapping[str, tuple[Point, ...]]
    directions: Mapping[str, Point | None]

    @property
    def boundaries(self) -> tuple[str, ...]:
        """Names of the boundaries."""
        return tuple(self.spans)

    def samples(self, boundary: str) -> tuple[Point, ...]:
        """Points that span the boundary."""
        return self.spans[boundary]

    def normal(self, boundary: str) -> Point | None:
        """Outward normal of a straight boundary, None on a curved one."""
        return self.directions[boundary]


Survey = Callable[[FileShape], Surveyed]
"""Looks into a shape's file; raises GeometryError where it cannot be used."""


def no_files(shape: FileShape) -> Surveyed:
    """The survey of those who can read none."""
    raise GeometryError(f"{shape.file} is not read here")
