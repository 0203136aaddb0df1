"""Shapes given by files of their own, and what the checks of a case need to know of geometry.

The case layer does no geometry and reads no such file: whoever loads a case passes in a `GeometryInspector`.
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
    """Angle above which the outline has a corner at a node."""
    sha256: str | None = None
    """SHA-256 of the file when the case was resolved; a file that has changed is refused."""


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
        """Whether the nodes are those of the file."""
        return self.use == "nodes"


class Points(_FileShape):
    """Nodes with names of boundaries."""

    kind: Literal["points"]
    """Kind of shape."""

    @property
    def has_nodes(self) -> bool:
        """Always."""
        return True


FileShape = Mesh | Points


@dataclass(frozen=True)
class Geometry:
    """The geometry of a shape: the outward ``normals`` of its boundaries by name, None where they are not
    straight, the middle and the larger side of its bounding box, and the SHA-256 of the file it is from."""

    normals: Mapping[str, Point | None]
    centre: Point
    size: float
    digest: str = ""


@dataclass(frozen=True)
class GeometryInspector:
    """Answers about the geometry of a case.

    ``geometry`` raises GeometryError for shapes that are no bodies; ``floating`` gives a fault for every body
    without contact that can move freely, with its key in the case.
    """

    geometry: Callable[[AnyShape], Geometry]
    floating: Callable[[Case], Iterable[Fault]]
