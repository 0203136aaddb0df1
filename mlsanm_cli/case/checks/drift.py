"""Bodies that nothing holds: the stiffness of such a body is singular.

A rigid motion moves the point (x, y) by (tx - w y, ty + w x). Every component of a boundary that is held, or
pulled back by springs, forbids one combination of (tx, ty, w); a body is held when they have rank 3.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

from mlsanm_cli.case.checks.draft import Draft
from mlsanm_cli.case.model.base import split_boundary
from mlsanm_cli.case.model.files import Geometry
from mlsanm_cli.case.model.loads import Displacement, Platen
from mlsanm_cli.case.model.places import Place
from mlsanm_cli.case.report import Report

Row = tuple[float, float, float]

_NAMES = (
    ((1.0, 0.0, 0.0), "moving in x", "hold ux"),
    ((0.0, 1.0, 0.0), "moving in y", "hold uy"),
    ((0.0, 0.0, 1.0), "rotating", "hold a second point or a whole boundary"),
)
_SMALL = 1e-9


def check_drift(draft: Draft, report: Report) -> None:
    """Adds a problem for every body without contact that can move or rotate freely.

    What contacts leave free, only their surfaces tell. Only when the parts that could hold a body are sound:
    otherwise the message would mislead.
    """
    whole = all(
        len(items) == draft.count(section)
        for section, items in (
            ("body", draft.bodies),
            ("support", draft.supports),
            ("load", draft.loads),
            ("contact", draft.contacts),
        )
    )
    if not whole or any(report.touches((section,)) for section in ("body", "support", "load", "contact")):
        return
    in_contact = {
        split_boundary(boundary)[0] for contact in draft.contacts.values() for boundary in contact.boundaries
    }
    for index, body in draft.bodies.items():
        if body.name in in_contact:
            continue
        shape = draft.geometries[index]
        free = free_motions(list(held_rows(draft, body.name, shape)))
        if free:
            what = " and ".join(_describe(motion, shape) for motion in free)
            needs = ", ".join(dict.fromkeys(_remedy(motion) for motion in free))
            hint = f"add a [[support]], a displacement or a platen: {needs}"
            report.add(("body", index), f"can drift: nothing keeps it from {what}", hint)


def held_rows(draft: Draft, body: str, shape: Geometry) -> Iterator[Row]:
    """Forbidden combinations of (tx, ty, w * size) about the body's centre, without contact.

    A platen moved by a force has nothing to balance it, and only keeps its boundary from turning, unless it
    is free to turn.
    """
    for support in draft.supports.values():
        held = support.holds
        if support.body == body and support.near is not None:
            yield from _rows(shape, support.near, held)
        elif support.place is not None and support.place.body == body:
            for point in _samples(shape, support.place):
                yield from _rows(shape, point, held)
    for load in draft.loads.values():
        if not isinstance(load, Displacement | Platen) or body not in load.owners:
            continue
        points = _samples(shape, load.places[load.owners.index(body)])
        if isinstance(load, Displacement):
            held = (load.components[0] is not None, load.components[1] is not None)
            for point in points:
                yield from _rows(shape, point, held)
        else:
            yield from _platen_rows(shape, points, load)


def _samples(shape: Geometry, place: Place) -> tuple[tuple[float, float], ...]:
    """Points that span where something acts."""
    return place.ends or tuple(point for edge in place.edges for point in shape.samples(edge))


def _platen_rows(shape: Geometry, points: tuple[tuple[float, float], ...], load: Platen) -> Iterator[Row]:
    middle = (sum(p[0] for p in points) / len(points), sum(p[1] for p in points) / len(points))
    for direction, (control, _) in load.control.items():
        held = (direction == "x", direction == "y")
        at_middle = next(_rows(shape, middle, held))
        if control == "displacement":
            yield at_middle
        if load.turning != "free":
            for point in points:
                turn = next(_rows(shape, point, held))[2] - at_middle[2]
                yield (0.0, 0.0, turn)


def _rows(shape: Geometry, point: tuple[float, float], held: tuple[bool, bool]) -> Iterator[Row]:
    centre, size = shape.centre, shape.size
    x, y = (point[0] - centre[0]) / size, (point[1] - centre[1]) / size
    if held[0]:
        yield (1.0, 0.0, -y)
    if held[1]:
        yield (0.0, 1.0, x)


def free_motions(rows: list[Row]) -> list[Row]:
    """A basis of the motions that no row forbids, the plain ones where they will do.

    >>> free_motions([(1.0, 0.0, 0.0), (0.0, 1.0, 0.0)])
    [(0.0, 0.0, 1.0)]
    """
    basis = _null_space(rows)
    plain = [motion for motion, _, _ in _NAMES if all(abs(_dot(row, motion)) <= _SMALL for row in rows)]
    return plain if len(plain) == len(basis) else basis


def _null_space(rows: list[Row]) -> list[Row]:
    """Null space by elimination with full pivoting."""
    work = [list(row) for row in rows]
    pivots: list[tuple[int, int]] = []
    for step in range(3):
        rest = [(abs(work[i][j]), i, j) for i in range(step, len(work)) for j in _others(pivots)]
        if not rest or max(rest)[0] <= _SMALL:
            break
        _, i, j = max(rest)
        work[step], work[i] = work[i], work[step]
        pivot = work[step][j]
        work[step] = [value / pivot for value in work[step]]
        for k, row in enumerate(work):
            if k != step:
                work[k] = [value - row[j] * own for value, own in zip(row, work[step], strict=True)]
        pivots.append((step, j))
    basis: list[Row] = []
    for j in _others(pivots):
        motion = [0.0, 0.0, 0.0]
        motion[j] = 1.0
        for step, column in pivots:
            motion[column] = -work[step][j]
        basis.append((motion[0], motion[1], motion[2]))
    return basis


def _others(pivots: list[tuple[int, int]]) -> list[int]:
    return [j for j in range(3) if j not in [column for _, column in pivots]]


def _dot(a: Row, b: Row) -> float:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def _describe(motion: Row, shape: Geometry) -> str:
    for plain, name, _ in _NAMES:
        if motion == plain:
            return name
    tx, ty, w = motion
    if abs(w) <= _SMALL * math.hypot(tx, ty):
        return f"moving along ({tx:g}, {ty:g})"
    centre, size = shape.centre, shape.size
    x, y = centre[0] - ty / w * size, centre[1] + tx / w * size
    return f"rotating about ({x:.6g}, {y:.6g})"


def _remedy(motion: Row) -> str:
    for plain, _, remedy in _NAMES:
        if motion == plain:
            return remedy
    return _NAMES[2][2]
