"""Checks of polygons: names, corners, rounding, sides that cross, holes."""

from __future__ import annotations

import math
from collections.abc import Iterator

from mlsanm_cli.case.chains import SMALL, corners, crossings, distance, inside, signed_area
from mlsanm_cli.case.lines import KeyPath
from mlsanm_cli.case.polygon import Polygon
from mlsanm_cli.case.report import Report


def check_polygon(shape: Polygon, path: KeyPath, report: Report) -> None:
    """Adds every problem of a polygon's geometry; later ones only where the earlier make sense."""
    for part in ("names", "rounding"):
        given = len(getattr(shape, part))
        if given not in (0, len(shape.points)):
            report.add((*path, part), f"has {given} items for {len(shape.points)} points", "one per point")
    _check_names(shape, path, report)
    problems = [*_point_problems(shape)] or [*_rounding_problems(shape)] or [*_outline_problems(shape)]
    for key, message, hint in problems or _hole_problems(shape):
        report.add((*path, *key), message, hint)


Problem = tuple[KeyPath, str, str]


def _check_names(shape: Polygon, path: KeyPath, report: Report) -> None:
    taken: set[str] = set()
    for name in shape.boundaries:
        if name in taken:
            place: KeyPath = ("names", shape.names.index(name)) if name in shape.names else ("holes",)
            report.add(
                (*path, *place), f'"{name}" is the name of two boundaries', "every boundary has its own"
            )
        taken.add(name)


def _point_problems(shape: Polygon) -> Iterator[Problem]:
    smallest = SMALL * shape.size
    for number, point in enumerate(shape.points):
        for other in range(number):
            if math.dist(point, shape.points[other]) <= smallest:
                text = f"({point[0]:g}, {point[1]:g}) is point {other + 1} again"
                yield ("points", number), text, "the last point joins the first by itself"
    if abs(signed_area(shape.points)) <= smallest * shape.size:
        yield ("points",), "the points lie on a line", ""


def _rounding_problems(shape: Polygon) -> Iterator[Problem]:
    vertices = corners(shape.points, shape.rounding)
    for corner, following in zip(vertices, (*vertices[1:], vertices[0]), strict=True):
        place: KeyPath = ("rounding", corner.number)
        if corner.radius and corner.cut <= SMALL * shape.size:
            yield place, "there is no corner to round at this point", "write 0.0"
            continue
        room = math.dist(corner.point, following.point)
        if corner.cut + following.cut > room * (1.0 + SMALL):
            larger = corner if corner.cut >= following.cut else following
            rest = room - (following if larger is corner else corner).cut
            text = f"a radius of {larger.radius:g} takes {larger.cut:g} of a side that has {rest:g} left"
            hint = f"at most {rest / larger.cut * larger.radius:.4g} here" if rest > 0.0 else "take less here"
            yield ("rounding", larger.number), text, hint


def _outline_problems(shape: Polygon) -> Iterator[Problem]:
    for one, other in dict.fromkeys(crossings(shape.loops[0], SMALL * shape.size)):
        yield ("points",), f'the boundaries "{one}" and "{other}" cross or touch', ""


def _hole_problems(shape: Polygon) -> Iterator[Problem]:
    outer, smallest = shape.loops[0], SMALL * shape.size
    for number, hole in enumerate(shape.holes):
        key: KeyPath = ("holes", number)
        nearest = min(outer, key=lambda piece: distance(piece, hole.center))
        room = distance(nearest, hole.center)
        if not inside(outer, hole.center) and room > smallest:
            yield (*key, "center"), "the hole lies outside the polygon", ""
        elif room <= hole.radius + smallest:
            text = f'the hole cuts the boundary "{nearest.name}", which is {room:g} from its center'
            yield (*key, "radius"), text, "holes lie inside, with material all around"
        for other in range(number):
            apart = math.dist(hole.center, shape.holes[other].center)
            if apart <= hole.radius + shape.holes[other].radius + smallest:
                yield (*key, "center"), f"the hole meets hole {other + 1}", "holes lie apart"
