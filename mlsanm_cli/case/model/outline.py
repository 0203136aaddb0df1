"""The outline: sides one after the other, straight or smooth curves through points.

Lengths are in the case's own unit.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from itertools import pairwise
from typing import Annotated, Literal

from pydantic import Field

from mlsanm_cli.case.lines import KeyPath
from mlsanm_cli.case.model.base import LENGTH, Name, Section, Vector
from mlsanm_cli.case.model.chains import Piece, Point, Side, Smooth, extent, signed_area
from mlsanm_cli.case.model.polygon import Chained, Hole, box_centre, circles

JOINED = 1e-6
"""Ends nearer to each other than this part of the outline's size are one point: files round coordinates."""


class OutlineSide(Section):
    """A side: a straight line to a point, or a smooth curve through points.

    With neither it is the straight line from where the side before ends to where the next one begins.
    """

    name: Name | None = None
    """Name of the boundary; side1, side2 and so on by default. Sides of one name are one boundary."""
    to: Annotated[Vector, LENGTH] | None = None
    """The straight line from where the side before ends to this point."""
    points: Annotated[tuple[Vector, ...], Field(min_length=2), LENGTH] | None = None
    """A smooth curve through these points, a cubic spline; the only side may end where it begins."""
    file: Annotated[str, Field(min_length=1)] | None = None
    """CSV file of these points, with the header x,y; a relative path is relative to the case file."""


class OutlineShape(Chained):
    """Sides one after the other around the body, in either direction, and circular ``holes``.

    Every side begins where the one before ends; the first one begins where the last one ends.
    """

    kind: Literal["outline"]
    """What the shape is."""
    sides: Annotated[tuple[OutlineSide, ...], Field(min_length=1)]
    holes: tuple[Hole, ...] = ()

    @property
    def loops(self) -> tuple[tuple[Piece, ...], ...]:
        """The outer boundary counter-clockwise, then the holes clockwise; no outer one of sides that do not
        join."""
        outer = () if next(join_problems(self.sides), None) else outer_loop(self.sides)
        return outer, *((hole,) for hole in circles(self.holes))

    @property
    def boundaries(self) -> tuple[str, ...]:
        """Names of the boundaries, each once."""
        sides = [side_name(self.sides, number) for number in range(len(self.sides))]
        return tuple(dict.fromkeys([*sides, *(hole.name for hole in circles(self.holes))]))

    @property
    def centre(self) -> Point:
        """Middle of the box around the points."""
        return box_centre(given_points(self.sides))

    @property
    def size(self) -> float:
        """Largest extent."""
        return extent(given_points(self.sides))


def given_points(sides: tuple[OutlineSide, ...]) -> tuple[Point, ...]:
    """All points that sides are given by; the origin if there are none."""
    found = [point for side in sides for point in (side.points or (side.to,)) if point is not None]
    return tuple(found) or ((0.0, 0.0),)


def points_of(piece: Piece) -> tuple[Point, ...]:
    """The points of a side or a curve in order."""
    if isinstance(piece, Side):
        return piece.start, piece.end
    assert isinstance(piece, Smooth)
    return piece.points


def side_name(sides: tuple[OutlineSide, ...], number: int) -> str:
    """The name of the boundary that a side belongs to."""
    return sides[number].name or f"side{number + 1}"


def join_problems(sides: tuple[OutlineSide, ...]) -> Iterator[tuple[KeyPath, str, str]]:
    """Keys, messages and hints of sides that do not join end to end to a loop."""
    slack, count = JOINED * extent(given_points(sides)), len(sides)
    for number, side in enumerate(sides):
        key: KeyPath = ("sides", number)
        given = [part for part in ("to", "points", "file") if getattr(side, part) is not None]
        if len(given) > 1:
            yield (*key, given[1]), f'"{given[0]}" is given too', "one of to, points and file"
            return
        if side.file is not None:
            # Whoever read the case has told why its points are not here.
            yield (*key, "file"), "", ""
            return
        if side.points is not None:
            for place, (a, b) in enumerate(pairwise(side.points), start=1):
                if math.dist(a, b) <= slack:
                    yield (*key, "points", place), f"({b[0]:g}, {b[1]:g}) follows itself", "each point once"
                    return
    for number, side in enumerate(sides):
        before, name = sides[number - 1], side_name(sides, number)
        other, key = side_name(sides, number - 1), ("sides", number)
        start, end = first_point(side), last_point(before)
        if start is None and end is None:
            text = f'nothing tells where "{other}" ends and "{name}" begins'
            yield key, text, f'write to = [x, y] in "{other}"'
        elif start is not None and end is not None and math.dist(start, end) > slack:
            places = f"({start[0]:g}, {start[1]:g})", f"({end[0]:g}, {end[1]:g})"
            hint = "every side begins where the one before ends"
            if count == 1:
                hint = "end where it begins, or add a side without points, a straight line back"
            yield key, f'"{name}" begins at {places[0]}, "{other}" ends at {places[1]}', hint


def first_point(side: OutlineSide) -> Point | None:
    """Where a side begins by itself."""
    return None if side.points is None else side.points[0]


def last_point(side: OutlineSide) -> Point | None:
    """Where a side ends by itself."""
    return side.to if side.points is None else side.points[-1]


def outer_loop(sides: tuple[OutlineSide, ...]) -> tuple[Piece, ...]:
    """The sides as pieces, counter-clockwise; ends that are told twice are those of the curves."""
    count, chain = len(sides), list[Piece]()
    for number, side in enumerate(sides):
        name = side_name(sides, number)
        before, after = sides[number - 1], sides[(number + 1) % count]
        if side.points is not None:
            points = side.points
            if count == 1:
                # As disks do, so that a mirror finds nodes where it crosses the curve.
                top = max(range(len(points) - 1), key=lambda k: points[k][1])
                chain.append(Smooth(name, (*points[top:-1], *points[: top + 1]), closed=True))
                continue
            # Where two curves meet within round-off, they meet in one point.
            end = first_point(after)
            chain.append(Smooth(name, points if end is None else (*points[:-1], end)))
            continue
        start, end = last_point(before), first_point(after) or side.to
        assert start is not None
        assert end is not None
        chain.append(Side(name, start, end))
    along = [point for piece in chain for point in points_of(piece)[:-1]]
    return tuple(chain) if signed_area(along) > 0.0 else tuple(map(_turned, reversed(chain)))


def _turned(piece: Piece) -> Piece:
    if isinstance(piece, Side):
        return Side(piece.name, piece.end, piece.start)
    assert isinstance(piece, Smooth)
    return Smooth(piece.name, piece.points[::-1], piece.closed)
