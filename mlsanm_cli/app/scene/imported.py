"""The geometry inspector of the case layer, based on the outlines of bodies."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from mlsanm_cli.app.scene.outlines import drawn, imported_geometry
from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.case import (
    AnyShape,
    Geometry,
    GeometryInspector,
    LoadedCase,
    Mesh,
    Points,
    load_case,
)
from mlsanm_cli.cloud.curves import Curve, Segment
from mlsanm_cli.roundoff import FINE_ROUND_OFF

SAMPLES = 9
"""Points on a curve, which suffice for its bounding box and the rank of its rigid motions."""


def load_with_files(path: Path, overrides: tuple[str, ...] = ()) -> LoadedCase:
    """A validated case with checked geometry, also of bodies in files. Raises RunError and CaseError."""
    return load_case(path, overrides, geometry_inspector)


def geometry_of(shape: AnyShape) -> Geometry:
    """The geometry of a shape for the checks of a case. Raises GeometryError."""
    outline, digest = drawn(shape), ""
    points = np.concatenate([_points(curve) for curve in outline.curves])
    if isinstance(shape, Mesh | Points):
        body = imported_geometry(shape)
        points, digest = body.points, body.digest
    normals: dict[str, tuple[float, float] | None] = {}
    for full, curve in zip(outline.names, outline.curves, strict=True):
        name, normal = full.partition("/")[0], _normal(curve)
        normals[name] = normal if normals.get(name, normal) == normal else None
    low, high = points.min(axis=0), points.max(axis=0)
    x, y = (0.5 * (low + high)).tolist()
    return Geometry(normals, (x, y), float((high - low).max()), digest)


class _Inspector:
    geometry = staticmethod(geometry_of)


geometry_inspector: GeometryInspector = _Inspector()


def _points(curve: Curve) -> FloatArray:
    return curve.points(np.linspace(0.0, curve.length, 2 if isinstance(curve, Segment) else SAMPLES))


def _normal(curve: Curve) -> tuple[float, float] | None:
    """The outward normal of a straight boundary."""
    if not isinstance(curve, Segment):
        return None
    x, y = curve.normals(np.zeros(1))[0].tolist()
    return (x if abs(x) > FINE_ROUND_OFF else 0.0, y if abs(y) > FINE_ROUND_OFF else 0.0)
