"""Profiles of loads along their boundaries, with their discontinuities; numbers and expressions at points."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import lru_cache

import numpy as np

from mlsanm_cli.app.scene.outlines import drawn
from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.case import Displacement, ExpressionError, Place, Pressure, Traction, value_at
from mlsanm_cli.case.model.shapes import AnyShape
from mlsanm_cli.cloud.curves import Curve
from mlsanm_cli.cloud.joined import BoundaryRun
from mlsanm_cli.errors import CaseError, CaseProblem
from mlsanm_cli.records import dataclass

SAMPLES = 4096
"""Samples along a boundary, a power of two."""
MIN_JUMP = 0.05
"""Least discontinuity that counts, relative to the largest value."""
BISECTIONS = 40
MIN_DISTANCE = 1e-3
"""Least distance of a jump from the end of the boundary and from other jumps, relative to the boundary."""
MAX_JUMPS = 64
"""Boundaries with more jumps are not cut at them."""


@dataclass(frozen=True)
class LoadProfile:
    """``values`` (SAMPLES + 1, c) of a load, relative to the largest, at even steps along the part of a
    ``run``, and the arc lengths of ``jumps`` along the part."""

    run: BoundaryRun
    values: FloatArray
    jumps: tuple[float, ...]


def runs_of(shape: AnyShape, place: Place) -> list[BoundaryRun]:
    """The runs of a place on the outline of a shape. Loaded boundaries need not join."""
    outline = drawn(shape)
    groups = [place.edges] if place.ends else [(edge,) for edge in place.edges]
    return [
        BoundaryRun(outline, *chain, place.ends)
        for edges in groups
        for chain in outline.chains(outline.numbers(*edges))
    ]


def profiles(shape: AnyShape, load: Pressure | Traction | Displacement) -> tuple[LoadProfile, ...]:
    """The profiles of a load that varies along the boundaries of a body of this ``shape``; empty if an
    expression has no value."""
    table: tuple[tuple[float, ...], ...] = ()
    given: Sequence[float | str | None]
    if isinstance(load, Displacement):
        given = load.components
    else:
        table = load.table or ()
        given = ((load.pressure,) if isinstance(load, Pressure) else load.traction) or ()
    expressions = tuple(amount for amount in given if isinstance(amount, str))
    return _profiles(shape, load.place, expressions, table) if expressions or table else ()


@lru_cache(maxsize=256)
def _profiles(
    shape: AnyShape, place: Place, expressions: tuple[str, ...], table: tuple[tuple[float, ...], ...]
) -> tuple[LoadProfile, ...]:
    found, start = [], 0.0
    rows = np.array(table)
    for run in runs_of(shape, place):
        curve = run.part

        def values(arc: FloatArray, curve: Curve = curve, start: float = start) -> FloatArray:
            if table:
                columns = [np.interp(start + arc, rows[:, 0], column) for column in rows[:, 1:].T]
                return np.stack(columns, axis=1)
            return amounts_at(expressions, curve.points(arc))

        arc = np.linspace(0.0, curve.length, SAMPLES + 1)
        try:
            sampled = values(arc)
            scale = float(np.abs(sampled).max())
            if scale > 0.0:
                jumps = _jumps(values, arc, sampled, MIN_JUMP * scale)
                found.append(LoadProfile(run, sampled / scale, jumps))
        except ExpressionError:
            # Reported when loads are evaluated at the nodes.
            return ()
        start += curve.length
    return tuple(found)


def _jumps(
    values: Callable[[FloatArray], FloatArray], arc: FloatArray, sampled: FloatArray, least: float
) -> tuple[float, ...]:
    """Arc lengths at which ``values``, ``sampled`` (s, c) at ``arc`` (s,), jump by more than ``least``, by
    bisection."""
    marks = [float(arc[0]), float(arc[-1])]
    for step in np.flatnonzero(np.abs(np.diff(sampled, axis=0)).max(axis=1) > least).tolist():
        low, high = float(arc[step]), float(arc[step + 1])
        for _ in range(BISECTIONS):
            middle = 0.5 * (low + high)
            first, second = np.abs(np.diff(values(np.array([low, middle, high])), axis=0)).max(axis=1)
            low, high = (low, middle) if first > second else (middle, high)
        place = 0.5 * (low + high)
        apart = min(abs(place - mark) for mark in marks) > MIN_DISTANCE * float(arc[-1])
        if apart and np.abs(np.diff(values(np.array([low, high])), axis=0)).max() > least:
            marks.append(place)
    return tuple(marks[2:]) if len(marks) <= MAX_JUMPS else ()


@dataclass(frozen=True)
class AmountField:
    """The value of a ``key`` of the case: a number or an expression in x and y."""

    key: str
    amount: float | str

    def at(self, points: FloatArray) -> FloatArray:
        """Values (e,) at ``points`` (e, 2). Raises CaseError if an expression has no value there."""
        try:
            return amounts_at([self.amount], points)[:, 0]
        except ExpressionError as error:
            raise CaseError((CaseProblem(self.key, str(error)),)) from error


def amounts_at(amounts: Sequence[float | str], points: FloatArray) -> FloatArray:
    """Numbers and expressions (c,) at ``points`` (n, 2), as columns (n, c). Raises ExpressionError."""
    columns = [
        np.array([value_at(amount, x, y) for x, y in points.tolist()])
        if isinstance(amount, str)
        else np.full(len(points), amount)
        for amount in amounts
    ]
    return np.stack(columns, axis=1)
