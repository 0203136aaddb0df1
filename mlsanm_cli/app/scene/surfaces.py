"""From what a case calls a boundary to the pieces of a body's outline: sides of one name, lists, parts.

A body's outline has one piece for each smooth stretch. Boundaries of several pieces and parts of boundaries
are sets of pieces; what holds or loads them does so piece by piece. A contact joins its pieces to one
surface.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import accumulate, pairwise
from typing import TYPE_CHECKING

import numpy as np

from mlsanm_cli.case import Case, Displacement, Place, Platen, Pressure, Traction
from mlsanm_cli.case.model.case import Body, Contact
from mlsanm_cli.case.model.files import FileShape, Mesh, Points
from mlsanm_cli.case.model.places import listed
from mlsanm_cli.case.model.shapes import (
    Annulus,
    AnyShape,
    Disk,
    HalfDisk,
    OutlineShape,
    Polygon,
    Rectangle,
    Sector,
    hole_names,
    side_names,
)
from mlsanm_cli.cloud import drawing
from mlsanm_cli.cloud.cloud import Cloud
from mlsanm_cli.cloud.curves import Arc, Curve, Outline, annulus, disk, half_disk, rectangle, sector
from mlsanm_cli.cloud.joined import SMOOTH, chain_of, cut, joined, part_of
from mlsanm_cli.cloud.surface import Surface, joined_surface
from mlsanm_cli.errors import CaseError, CaseProblem

if TYPE_CHECKING:
    from mlsanm_cli.app.scene.geometry_files import ImportedGeometry

FAR = 0.1
"""The ends of a part of a boundary are within this part of its length of it."""
IN_PLACE = 1e-4
"""Surfaces lie on each other where they are apart by less than this part of their length."""
AT_END = 1e-6
"""Ends of parts nearer than this part of a piece's length to its end are there."""


def imported_geometry(shape: FileShape) -> ImportedGeometry:
    """The body in a shape's file. Raises GeometryError, whose message begins with the file's name."""
    # What reads and traces files is imported for cases that have such bodies.
    from mlsanm_cli.app.scene.geometry_files import read_body

    return read_body(shape)


@lru_cache(maxsize=256)
def drawn(shape: AnyShape) -> Outline:
    """The outline of a shape: closed loops of named curves. Several pieces of one name are "name/1" and so
    on. Raises GeometryError for shapes that are no closed boundary of a body."""
    if isinstance(shape, Rectangle):
        return rectangle(shape.x, shape.y)
    if isinstance(shape, HalfDisk):
        return half_disk(shape.center, shape.radius, shape.side)
    if isinstance(shape, Sector):
        first, last = (math.radians(angle) for angle in shape.angles)
        return sector(shape.center, shape.radii, (first, last))
    if isinstance(shape, Annulus):
        return annulus(shape.center, shape.radii)
    if isinstance(shape, Mesh | Points):
        return imported_geometry(shape).traced.outline
    if isinstance(shape, Disk):
        return disk(shape.center, shape.radius)
    return _looped(shape)


def _looped(shape: Polygon | OutlineShape) -> Outline:
    holes = [
        (name, hole.center, hole.radius) for name, hole in zip(hole_names(shape), shape.holes, strict=True)
    ]
    if isinstance(shape, Polygon):
        outer = drawing.polygon(shape.points, shape.names, shape.rounding, shape.corners)
        return drawing.with_holes(outer, holes, "points")
    named = zip(side_names(shape), shape.sides, strict=True)
    outer = drawing.closed_chain([drawing.Side(name, side.to, side.points) for name, side in named])
    return drawing.with_holes(outer, holes, "sides")


def outline_of(case: Case, body: Body) -> Outline:
    """The body's outline, cut where parts of boundaries begin and end.

    Raises CaseError for parts without sense.
    """
    return cut(drawn(body.shape), _cuts(case, body))


def numbers_of(outline: Outline, edge: str) -> tuple[int, ...]:
    """The numbers of the curves that a boundary is made of."""
    return tuple(k for k, name in enumerate(outline.names) if name == edge or name.startswith(f"{edge}/"))


@dataclass(frozen=True)
class _Run:
    """Pieces of a body's ``outline`` by their ``numbers`` in order, ``around`` if they are a whole loop."""

    outline: Outline
    numbers: tuple[int, ...]
    around: bool

    @property
    def curves(self) -> tuple[Curve, ...]:
        return tuple(self.outline.curves[number] for number in self.numbers)

    @property
    def starts(self) -> list[float]:
        """Arc lengths where the pieces begin, and where the last one ends."""
        return [*accumulate((curve.length for curve in self.curves), initial=0.0)]

    def nearest(self, point: tuple[float, float]) -> tuple[float, float]:
        """The arc length nearest to a point, and how far that is."""
        best = (0.0, math.inf)
        for curve, start in zip(self.curves, self.starts, strict=False):
            s = curve.closest(np.array([point]))
            away = float(np.hypot(*(curve.points(s) - np.array(point))[0]))
            if away < best[1]:
                at = float(s[0])
                for end in (0.0, curve.length):
                    at = end if abs(at - end) <= AT_END * curve.length and not curve.closed else at
                best = start + at, away
        return best


def _run(case: Case, place: Place, key: str) -> _Run:
    """The pieces of a place in the outline as drawn. Raises CaseError where they do not join."""
    body = next(one for one in case.body if one.name == place.body)
    outline = drawn(body.shape)
    numbers = [number for edge in place.edges for number in numbers_of(outline, edge)]
    found = chain_of(outline, numbers)
    if found is None:
        groups = [f'"{name}"' for name in _groups(outline, numbers)]
        message = f"{', '.join(groups[:-1])} and {groups[-1]} do not join end to end"
        hint = "the pieces of one surface are consecutive along the outline"
        raise CaseError((CaseProblem(key, message, hint=hint),))
    return _Run(outline, *found)


def _groups(outline: Outline, numbers: Sequence[int]) -> list[str]:
    """The names of pieces that do join, group by group."""
    left, groups = sorted(set(numbers)), list[str]()
    while left:
        group = left[:1]
        while len(group) < len(left) and chain_of(outline, left[: len(group) + 1]) is not None:
            group = left[: len(group) + 1]
        left = left[len(group) :]
        groups.append("+".join(dict.fromkeys(outline.names[k].partition("/")[0] for k in group)))
    return groups


def curve_at(case: Case, place: Place, key: str) -> tuple[Curve, tuple[Curve, ...]]:
    """The curve of a contact's side, and the other curves of the body's outline. Raises CaseError."""
    run = _run(case, place, key)
    others = tuple(curve for k, curve in enumerate(run.outline.curves) if k not in run.numbers)
    own = joined(run.curves, run.around)
    if place.ends is not None:
        first, length = _range(run, place)
        own = part_of(own, first, first + length)
    return own, others


def surface_at(case: Case, cloud: Cloud, place: Place, key: str) -> Surface:
    """The nodes of a contact's side as one surface. Raises CaseError where its pieces do not join."""
    run, names = _run(case, place, key), surfaces_at(case, place)
    around = run.around and place.ends is None
    label = place.label.partition(".")[2]
    return joined_surface(label, [cloud.surfaces[name] for name in names], around)


@dataclass(frozen=True)
class SurfacePart:
    """A surface, the arc length ``first`` from the start of where a load acts to it, and the ``total``
    length there."""

    surface: Surface
    first: float
    total: float


def parts_at(case: Case, cloud: Cloud, place: Place) -> list[SurfacePart]:
    """The surfaces of a place with their arc lengths along it; pieces that do not join count on from each
    other in the order of the outline."""
    names = surfaces_at(case, place)
    surfaces = [cloud.surfaces[name] for name in names]
    starts = [*accumulate((surface.curve.length for surface in surfaces), initial=0.0)]
    return [SurfacePart(surface, start, starts[-1]) for surface, start in zip(surfaces, starts, strict=False)]


def surfaces_at(case: Case, place: Place) -> tuple[str, ...]:
    """The names of the surfaces that are a place, in order along the outline."""
    body = next(one for one in case.body if one.name == place.body)
    if place.ends is None:
        outline = drawn(body.shape)
        numbers = [number for edge in place.edges for number in numbers_of(outline, edge)]
        found = chain_of(outline, numbers)
        ordered = sorted(set(numbers)) if found is None else found[0]
        run = _Run(outline, tuple(ordered), False)
        return tuple(name for _, name, _, _ in _pieces(case, place, run))
    run = _run(case, place, "")
    first, length = _range(run, place)
    whole = run.starts[-1]
    found_names = []
    for _, name, start, end in _pieces(case, place, run):
        away = (0.5 * (start + end) - first) % whole
        if away < length:
            found_names.append((away, name))
    return tuple(name for _, name in sorted(found_names))


def _pieces(case: Case, place: Place, run: _Run) -> Iterator[tuple[int, str, float, float]]:
    """Numbers, names and arc lengths from start to end of the pieces of a run, cut as the outline is."""
    body = next(one for one in case.body if one.name == place.body)
    cuts = _cuts(case, body)
    for number, curve, start in zip(run.numbers, run.curves, run.starts, strict=False):
        name, places = run.outline.names[number], sorted(cuts.get(number, ()))
        if not places:
            yield number, name, start, start + curve.length
            continue
        ends = [*places, places[0] + curve.length] if curve.closed else [0.0, *places, curve.length]
        for k, (first, last) in enumerate(pairwise(ends), start=1):
            yield number, f"{name}/{k}", start + first, start + last


def _range(run: _Run, place: Place) -> tuple[float, float]:
    """Where along a run a part of it begins, and its length."""
    assert place.ends is not None
    (one, _), (other, _) = (run.nearest(end) for end in place.ends)
    if run.around or run.curves[0].closed:
        return one, (other - one) % run.starts[-1]
    return min(one, other), abs(other - one)


def _parted(case: Case) -> Iterator[tuple[str, Place]]:
    """Keys and places of all conditions on parts of boundaries."""
    for index, support in enumerate(case.support):
        if support.place is not None and support.ends is not None:
            yield f"support.{index}", support.place
    for load in case.load:
        if isinstance(load, Platen | Pressure | Traction | Displacement) and load.ends is not None:
            yield f"load.{load.name}", load.place
    for contact in case.contact:
        for place in sides_of(case, contact):
            if place.ends is not None:
                yield f"contact.{contact.name}", place


def sides_of(case: Case, contact: Contact) -> tuple[Place, ...]:
    """The slave and, if there is one, the master of a contact, with the rounded corners at their ends; of
    bonds only the parts that face each other, so that tractions may begin and end where a surface
    continues."""
    sides = contact.sides
    if not contact.bonded or len(sides) < 2:
        return tuple(
            _with_roundings(case, contact, place, role)
            for role, place in zip(("slave", "master"), sides, strict=False)
        )
    return _facing_part(case, contact, 0), _facing_part(case, contact, 1)


def _with_roundings(case: Case, contact: Contact, place: Place, role: str) -> Place:
    """The side of a contact with the rounded corners that it continues in: what presses on a face presses on
    the beginning of its roundings.

    Not with those that have conditions of their own, or lie between two sides in contact.
    """
    if place.ends is not None:
        return place
    run = _run(case, place, f"contact.{contact.name}.{role}")
    if run.around or run.curves[0].closed:
        return place
    outline, found = run.outline, list[tuple[str, int]]()
    loop = next(loop for loop in outline.loops if loop.start <= run.numbers[0] < loop.stop)
    count = loop.stop - loop.start
    for last, step in ((run.numbers[0], -1), (run.numbers[-1], 1)):
        adjacent, beyond = (loop.start + (last - loop.start + k * step) % count for k in (1, 2))
        curve = outline.curves[adjacent]
        if not isinstance(curve, Arc) or curve.sweep <= 0.0 or curve.closed:
            continue
        own = outline.curves[last]
        ends = (own.length, 0.0) if step > 0 else (0.0, curve.length)
        here, there = own.normals(np.array([ends[0]]))[0], curve.normals(np.array([ends[1]]))[0]
        names = [f"{place.body}.{outline.names[k].partition('/')[0]}" for k in (adjacent, beyond)]
        if float(here @ there) > math.cos(SMOOTH) and _is_free(case, contact, place, *names):
            found.append((names[0], adjacent))
    # Arcs of one name are taken together or not at all.
    taken = {number for _, number in found}
    more = {name for name, _ in found if {*numbers_of(outline, name.partition(".")[2])} <= taken}
    return Place((*place.boundaries, *sorted(more))) if more else place


def _is_free(case: Case, contact: Contact, place: Place, rounding: str, beyond: str) -> bool:
    """Whether nothing but given tractions acts on a ``rounding``, and no other contact on the side behind."""
    taken = [name for support in case.support for name in listed(support.boundary)]
    for load in case.load:
        if isinstance(load, Platen | Displacement):
            taken += [name for one in load.places for name in one.boundaries]
    others = [name for one in case.contact if one is not contact for name in one.boundaries]
    apart = contact.boundaries if beyond not in place.boundaries else ()
    return rounding not in (*taken, *others, *contact.boundaries) and beyond not in (*others, *apart)


def _facing_part(case: Case, contact: Contact, which: int) -> Place:
    """One side of a bond, from where to where the other one lies on it."""
    own, other = contact.sides[which], contact.sides[1 - which]
    if own.ends is not None:
        return own
    run = _run(case, own, f"contact.{contact.name}")
    facing = _run(case, Place(other.boundaries), f"contact.{contact.name}")
    theirs = joined(facing.curves, facing.around)
    if other.ends is not None:
        first, length = _range(facing, other)
        theirs = part_of(theirs, first, first + length)
    if theirs.closed:
        return own
    whole, closed = run.starts[-1], run.around or run.curves[0].closed
    tips = theirs.points(np.array([0.0, 0.5, 1.0]) * theirs.length).tolist()
    (start, *_), (middle, _), (end, *_) = places = [run.nearest((x, y)) for x, y in tips]
    if places[1][1] > IN_PLACE * whole:
        return own
    inside = [away <= IN_PLACE * whole and AT_END < at / whole < 1.0 - AT_END for at, away in places[::2]]
    if not any(inside):
        return own
    # Surfaces that face each other run past each other; on a closed one the part has the middle in it.
    low, high = sorted((start, end))
    if closed:
        low, high = (low, high) if low < middle < high else (high, low)
    else:
        low, high = (place if within else far for place, within, far in _ordered(start, end, inside, whole))
    curve = joined(run.curves, run.around)
    (a, b), (c, d) = curve.points(np.array([low, high])).tolist()
    return Place(own.boundaries, ((a, b), (c, d)))


def _ordered(
    start: float, end: float, inside: Sequence[bool], whole: float
) -> list[tuple[float, bool, float]]:
    """Both ends of a part in order along an open run, whether each is inside it, and the run's end there."""
    both = sorted([(start, inside[0]), (end, inside[1])])
    return [(*both[0], 0.0), (*both[1], whole)]


def bond_ends(case: Case, contact: Contact) -> list[tuple[float, float]]:
    """The points where a bond ends on a surface that continues."""
    found = []
    for place in sides_of(case, contact):
        if place.ends is None:
            continue
        run = _run(case, place, f"contact.{contact.name}")
        for point in place.ends:
            at, _ = run.nearest(point)
            if AT_END < at / run.starts[-1] < 1.0 - AT_END or run.curves[0].closed:
                found.append(point)
    return found


def _cuts(case: Case, body: Body) -> dict[int, list[float]]:
    """Where the curves of a body's outline as drawn are cut, by their numbers."""
    cuts: dict[int, list[float]] = {}
    for key, place in _parted(case):
        if place.body != body.name:
            continue
        run = _run(case, place, key)
        whole = run.starts[-1]
        assert place.ends is not None
        for name, end in zip(("from", "to"), place.ends, strict=True):
            at, away = run.nearest(end)
            if away > FAR * whole:
                message = f"({end[0]:g}, {end[1]:g}) is {away:g} away from the boundary"
                raise CaseError((CaseProblem(f"{key}.{name}", message, hint="a point on it, or near it"),))
            _add_cut(cuts, run, body, at)
        if _range(run, place)[1] <= AT_END * whole:
            message = "the part of the boundary between these points has no length"
            raise CaseError((CaseProblem(f"{key}.to", message, hint="two points apart"),))
    return cuts


def _add_cut(cuts: dict[int, list[float]], run: _Run, body: Body, at: float) -> None:
    """Cut a run at an arc length, at a node if the nodes are there already, unless it is cut there."""
    for number, curve, start in zip(run.numbers, run.curves, run.starts, strict=False):
        if not start <= at <= start + curve.length:
            continue
        s = at - start
        if body.has_nodes:
            assert isinstance(body.shape, Mesh | Points)
            nodes = imported_geometry(body.shape).cloud.surfaces[run.outline.names[number]].arc_length
            s = float(nodes[np.argmin(np.abs(nodes - s))])
        small = AT_END * curve.length
        known = [*cuts.get(number, ()), *(() if curve.closed else (0.0, curve.length))]
        if all(abs(s - other) > small for other in known):
            cuts.setdefault(number, []).append(s)
        return


def with_cuts(case: Case, body: Body, cloud: Cloud) -> Cloud:
    """A cloud whose nodes came with the body, with its surfaces cut as the outline is."""
    cuts = _cuts(case, body)
    if not cuts:
        return cloud
    outline = drawn(body.shape)
    surfaces: dict[str, Surface] = {}
    for number, name in enumerate(outline.names):
        whole, places = cloud.surfaces[name], sorted(cuts.get(number, ()))
        if not places:
            surfaces[name] = whole
            continue
        parts = cut(Outline((name,), (whole.curve,)), {0: places})
        for own, curve, nodes in zip(parts.names, parts.curves, _split(whole, places), strict=True):
            arc = whole.arc_length[nodes] - whole.arc_length[nodes[0]]
            arc = np.mod(arc, whole.curve.length)
            surfaces[own] = Surface(own, curve, whole.index[nodes], arc, whole.normal[nodes])
    return Cloud(cloud.points, cloud.spacing, surfaces, cloud.mirror)


def _split(surface: Surface, places: Sequence[float]) -> list[list[int]]:
    """The nodes of the parts of a surface cut at nodes at arc lengths ``places``."""
    at = [int(np.argmin(np.abs(surface.arc_length - place))) for place in places]
    count = len(surface.index)
    if surface.curve.closed:
        return [[k % count for k in range(a, b + 1)] for a, b in pairwise([*at, at[0] + count])]
    return [list(range(a, b + 1)) for a, b in pairwise([0, *at, count - 1])]
