"""Shapes given by files of their own, and what the checks of a case need to know of geometry.

The case layer does no geometry and reads no such file: whoever loads a case passes in a `Survey`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from typing import TYPE_CHECKING, Annotated, Literal

from pydantic import Field

from mlsanm_cli.case.base import ANGLE, Point, Section
from mlsanm_cli.errors import Fault
from mlsanm_cli.values import dataclass

if TYPE_CHECKING:
    from mlsanm_cli.case.model import Case
    from mlsanm_cli.case.shapes import AnyShape

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
    """Kind of shape."""
    use: Literal["nodes", "outline"] = "nodes"
    """Whether the mesh's nodes become the body's, or its outline is filled with a cloud of `spacing`."""
    group: str | None = None
    """The group of elements that is the body; all of them by default."""

    @property
    def brings_nodes(self) -> bool:
        """Whether the body's nodes are those of the file."""
        return self.use == "nodes"


class Points(_FileShape):
    """Nodes with tags on the boundary."""

    kind: Literal["points"]
    """Kind of shape."""

    @property
    def brings_nodes(self) -> bool:
        """Always: the body's nodes are those of the file."""
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
class Survey:
    """Answers about the geometry of a case.

    ``geometry`` raises GeometryError for shapes that are no bodies; ``floating`` gives a fault for every body
    without contact that can move freely, with its key in the case.
    """

    geometry: Callable[[AnyShape], Geometry]
    floating: Callable[[Case], Iterable[Fault]]
