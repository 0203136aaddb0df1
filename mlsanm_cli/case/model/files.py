"""Shapes read from files."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from mlsanm_cli.case.model.base import ANGLE, Section

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
