"""Checks of polygons and outlines: names, corners, rounding, sides that cross, holes."""

from __future__ import annotations

import math
from collections.abc import Iterator

from mlsanm_cli.case.lines import KeyPath
from mlsanm_cli.case.model.chains import (
    SMALL,
    Piece,
    chords,
    corners,
    crossings,
    distance,
    inside,
    signed_area,
)
from mlsanm_cli.case.model.outline import OutlineShape, join_problems, side_name
from mlsanm_cli.case.model.polygon import Hole, Polygon, circles
from mlsanm_cli.case.report import Report

MOST_POINTS = 4000
"""Most points of an outline's sides: whether they cross takes seconds."""


def check_polygon(shape: Polygon, path: KeyPath, report: Report) -> None:
    """Adds every problem of a polygon's geometry; later ones only where the earlier make sense."""
    for part in ("names", "rounding", "corners"):
        given = len(getattr(shape, part))
        if given not in (0, len(shape.points)):
            report.add((*path, part), f"has {given} items for {len(shape.points)} points", "one per point")
    _check_names(shape, path, report)
    problems = (
        [*_point_problems(shape)]
        or [*_rounding_problems(shape)]
        or [*_crossing_problems(shape.loops[0], SMALL * shape.size, ("points",))]
    )
    for key, message, hint in problems or _hole_problems(shape.loops[0], shape.holes, shape.size):
        report.add((*path, *key), message, hint)


def check_outline(shape: OutlineShape, path: KeyPath, report: Report) -> None:
    """Adds every problem of an outline's geometry; later ones only where the earlier make sense."""
    given = {side.name for side in shape.sides}
    taken = {side_name(shape.sides, number) for number in range(len(shape.sides))}
    for number, side in enumerate(shape.sides):
        if side.name is None and side_name(shape.sides, number) in given:
            _add_twice(side_name(shape.sides, number), (*path, "sides", number), report)
    for number, hole in enumerate(circles(shape.holes)):
        if hole.name in taken:
            _add_twice(hole.name, (*path, "holes", number), report)
        taken.add(hole.name)
    problems = [*join_problems(shape.sides)]
    if not problems:
        outer, small = shape.loops[0], SMALL * shape.size
        ways = [a for _, a, _ in chords(outer)]
        if len(ways) > MOST_POINTS:
            problems = [(("sides",), f"have {len(ways)} points", f"{MOST_POINTS} at most")]
        elif abs(signed_area(ways)) <= small * shape.size:
            problems = [(("sides",), "the points lie on a line", "")]
        else:
            problems = [*_crossing_problems(outer, small, ("sides",))]
    for key, message, hint in problems or _hole_problems(shape.loops[0], shape.holes, shape.size):
        if message:
            report.add((*path, *key), message, hint)


def _add_twice(name: str, place: KeyPath, report: Report) -> None:
    report.add(place, f'"{name}" is the name of two boundaries', "name one of them otherwise")


Problem = tuple[KeyPath, str, str]


def _check_names(shape: Polygon, path: KeyPath, report: Report) -> None:
    """Names that are given may be those of several sides and arcs; those that are not are nobody else's."""
    given = [*shape.names, *filter(None, shape.corners)]
    holes = [hole.name for hole in circles(shape.holes)]
    sides = [f"side{k}" for k in range(len(shape.names) + 1, len(shape.points) + 1)]
    rounded = [k for k, radius in enumerate(shape.rounding) if radius and not _named(shape, k)]
    for name in dict.fromkeys(given):
        if name in [*holes, *sides, *(f"corner{k + 1}" for k in rounded)]:
            place: KeyPath = ("names", shape.names.index(name)) if name in shape.names else ("corners",)
            _add_twice(name, (*path, *place), report)
    for number, name in enumerate(holes):
        if name in [*holes[:number], *sides]:
            _add_twice(name, (*path, "holes"), report)


def _named(shape: Polygon, corner: int) -> bool:
    """Whether an arc has a name of its own, or that of both sides beside it."""
    if corner < len(shape.corners) and shape.corners[corner]:
        return True
    whole = len(shape.names) == len(shape.points)
    return whole and shape.names[corner - 1] == shape.names[corner % len(shape.names)]


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


def _crossing_problems(outer: tuple[Piece, ...], smallest: float, key: KeyPath) -> Iterator[Problem]:
    for one, other in dict.fromkeys(crossings(outer, smallest)):
        yield key, f'the boundaries "{one}" and "{other}" cross or touch', ""


def _hole_problems(outer: tuple[Piece, ...], holes: tuple[Hole, ...], size: float) -> Iterator[Problem]:
    smallest = SMALL * size
    for number, hole in enumerate(holes):
        key: KeyPath = ("holes", number)
        nearest = min(outer, key=lambda piece: distance(piece, hole.center))
        room = distance(nearest, hole.center)
        if not inside(outer, hole.center) and room > smallest:
            yield (*key, "center"), "the hole lies outside the polygon", ""
        elif room <= hole.radius + smallest:
            text = f'the hole cuts the boundary "{nearest.name}", which is {room:g} from its center'
            yield (*key, "radius"), text, "holes lie inside, with material all around"
        for other in range(number):
            apart = math.dist(hole.center, holes[other].center)
            if apart <= hole.radius + holes[other].radius + smallest:
                yield (*key, "center"), f"the hole meets hole {other + 1}", "holes lie apart"
