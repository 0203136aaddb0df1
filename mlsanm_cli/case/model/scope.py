"""What the tables of a case are checked against: the other valid tables, and the geometry of the bodies."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Protocol

from mlsanm_cli.case.model.base import Point
from mlsanm_cli.case.model.case import Case
from mlsanm_cli.case.model.shapes import AnyShape, edge_names
from mlsanm_cli.errors import Fault


@dataclass(frozen=True)
class Geometry:
    """The geometry of a shape: the outward ``normals`` of its boundaries by name (None if curved), the centre
    and the larger side of its bounding box, and the SHA-256 of its file, if any."""

    normals: Mapping[str, Point | None]
    centre: Point
    size: float
    digest: str = ""


class GeometryInspector(Protocol):
    """Examines the geometry of a case. The case layer does no geometry and reads no geometry files."""

    def geometry(self, shape: AnyShape) -> Geometry:
        """The geometry of a shape. Raises GeometryError if it is not a valid body."""

    def floating(self, case: Case) -> Iterable[Fault]:
        """A fault for every body without contact that can move freely, with its key in the case."""


@dataclass(frozen=True)
class Scope:
    """The valid tables of a case. ``names`` are those of all items by section, also of invalid ones,
    ``incomplete`` the sections with invalid parts, ``geometries`` those of the valid shapes by body."""

    case: Case
    names: Mapping[str, tuple[str, ...]]
    incomplete: frozenset[str]
    geometries: Mapping[str, Geometry]

    @property
    def strain(self) -> str:
        """Small or finite strain, "" if the model is invalid."""
        return self.case.model.strain if self.complete("model") else ""

    @property
    def confined(self) -> bool:
        """Whether out-of-plane strains are prescribed; False if the model is invalid."""
        return self.complete("model") and self.case.model.confined

    def complete(self, *sections: str) -> bool:
        """Whether all items of the sections are valid, so that something missing there is missing."""
        return self.incomplete.isdisjoint(sections)

    def edges(self, body: str) -> tuple[str, ...]:
        """Names of the boundaries of a body, empty if they are unknown."""
        if body in self.geometries:
            return tuple(self.geometries[body].normals)
        return next((edge_names(one.shape) for one in self.case.body if one.name == body), ())
