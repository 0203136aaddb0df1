"""The geometry inspector of the case layer, based on the outlines of bodies."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from mlsanm_cli.app.scene.conditions import conditions, prescribes
from mlsanm_cli.app.scene.outlines import drawn, imported_geometry
from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.case import (
    AnyShape,
    Case,
    Geometry,
    GeometryInspector,
    LoadedCase,
    Mesh,
    Place,
    Platen,
    Points,
    load_case,
    split_boundary,
)
from mlsanm_cli.case.model.conditions import Support
from mlsanm_cli.cloud.curves import Curve, Outline, Segment
from mlsanm_cli.errors import Fault
from mlsanm_cli.mechanics.rigid import ROTATION, RigidBodyModes, left_free, rigid_pattern
from mlsanm_cli.roundoff import FINE_ROUND_OFF, ROUND_OFF

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


def floating(case: Case) -> Iterator[Fault]:
    """A fault for every body without contact that can move freely; bodies in contact are checked later. A
    plate moved by a force restrains only the rotation of its boundary, unless it is free to rotate."""
    touching = {split_boundary(boundary)[0] for contact in case.contact for boundary in contact.boundaries}
    for index, body in enumerate(case.body):
        if body.name in touching:
            continue
        outline = drawn(body.shape)
        corners = np.concatenate([_points(curve) for curve in outline.curves])
        middle = 0.5 * (corners.min(axis=0) + corners.max(axis=0))
        center, size = (float(middle[0]), float(middle[1])), float(np.ptp(corners, axis=0).max())
        rows = [np.zeros((0, 3)), *_held(case, body.name, outline, center, size)]
        free = left_free(np.concatenate(rows), center, size)
        if free.components:
            what, needs = _described(free, size)
            hint = f"add a [[support]], a displacement or a platen: {needs}"
            yield Fault(("body", index), f"can move freely: nothing resists {what}", hint)


class _Inspector:
    geometry = staticmethod(geometry_of)
    floating = staticmethod(floating)


geometry_inspector: GeometryInspector = _Inspector()


def _held(
    case: Case, body: str, outline: Outline, center: tuple[float, float], size: float
) -> Iterator[FloatArray]:
    """Displacements (m, 3) resisted by supports and loads, under unit motions of the body in x, y and a
    rotation by 1/size."""

    def displacements(points: FloatArray) -> FloatArray:
        motions = np.stack([rigid_pattern(points, center, k) for k in range(3)], axis=2)
        motions[:, :, ROTATION] /= size
        return motions

    for support in case.support:
        if support.body == body and support.near is not None:
            yield displacements(np.array([support.near]))[:, list(support.holds)].reshape(-1, 3)
    for _, condition, place in conditions(case):
        if place.body != body:
            continue
        moved = displacements(_place_points(outline, place))
        if not isinstance(condition, Platen):
            holds = condition.holds if isinstance(condition, Support) else prescribes(condition)
            yield moved[:, list(holds)].reshape(-1, 3)
            continue
        for axis, (control, _) in condition.control.items():
            along = moved[:, "xy".index(axis)]
            if control == "displacement":
                yield along.mean(axis=0, keepdims=True)
            if condition.turning != "free":
                yield along - along.mean(axis=0)


def _place_points(outline: Outline, place: Place) -> FloatArray:
    if place.ends is not None:
        return np.array(place.ends)
    numbers = dict.fromkeys(outline.numbers(*place.edges))
    return np.concatenate([_points(outline.curves[number]) for number in numbers])


def _points(curve: Curve) -> FloatArray:
    return curve.points(np.linspace(0.0, curve.length, 2 if isinstance(curve, Segment) else SAMPLES))


def _normal(curve: Curve) -> tuple[float, float] | None:
    """The outward normal of a straight boundary."""
    if not isinstance(curve, Segment):
        return None
    x, y = curve.normals(np.zeros(1))[0].tolist()
    return (x if abs(x) > FINE_ROUND_OFF else 0.0, y if abs(y) > FINE_ROUND_OFF else 0.0)


def _described(free: RigidBodyModes, size: float) -> tuple[str, str]:
    """Free motions in words, and supports that would resist them."""
    x, y = (place if abs(place) > ROUND_OFF * size else 0.0 for place in free.center)
    about = f" about ({x:.6g}, {y:.6g})" if free.components == (ROTATION,) else ""
    words = {
        0: ("translation in x", "fix ux"),
        1: ("translation in y", "fix uy"),
        ROTATION: (f"rotation{about}", "fix a second point or a whole boundary"),
    }
    what, needs = zip(*(words[component] for component in free.components), strict=True)
    return " and ".join(what), ", ".join(needs)
