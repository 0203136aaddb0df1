"""The geometry that the checks of a case need.

The case layer does no geometry and reads no geometry files: the caller passes in a `GeometryInspector`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass

from mlsanm_cli.case.model.base import Point
from mlsanm_cli.case.model.case import Case
from mlsanm_cli.case.model.shapes import AnyShape
from mlsanm_cli.errors import Fault


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
