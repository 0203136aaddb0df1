"""Shapes read from files, and the geometry that the checks of a case need.

The case layer does no geometry and reads no geometry files: the caller passes in a `GeometryInspector`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Literal

from pydantic import Field

from mlsanm_cli.case.model.base import ANGLE, Point, Section
from mlsanm_cli.errors import Fault

if TYPE_CHECKING:
    from mlsanm_cli.case.model.case import Case
    from mlsanm_cli.case.model.shapes import AnyShape

Degrees = Annotated[float, Field(gt=0.0, lt=180.0)]


class _FileShape(Section):
    """A shape read from a file."""

    file: Annotated[str, Field(min_length=1)]
    """Path, relative to the case file."""
    corner: Annotated[Degrees, ANGLE] = 40.0
    """Angle between the outline's edges at a node above which the node is a corner."""
    sha256: str | None = None
    """SHA-256 of the file when the case was resolved; a changed file is an error."""


class Mesh(_FileShape):
    """A mesh of triangles and quadrilaterals."""

    kind: Literal["mesh"]
    """Kind of shape."""
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
    """Kind of shape."""

    @property
    def has_nodes(self) -> bool:
        """Always."""
        return True


FileShape = Mesh | Points


@dataclass(frozen=True)
class Geometry:
    """The geometry of a shape: the outward ``normals`` of its boundaries by name (None if curved), the centre
    and the larger side of its bounding box, and the SHA-256 of its file, if any."""

    normals: Mapping[str, Point | None]
    centre: Point
    size: float
    digest: str = ""


@dataclass(frozen=True)
class GeometryInspector:
    """Functions that examine the geometry of a case.

    ``geometry`` raises GeometryError for a shape that is not a valid body; ``floating`` returns a fault for
    every body without contact that can move freely, with its key in the case.
    """

    geometry: Callable[[AnyShape], Geometry]
    floating: Callable[[Case], Iterable[Fault]]
