"""Loads and springs of a case: the amounts given as functions of place, their profiles along boundaries with
discontinuities, forces spread over bodies and boundaries, and all loads at the nodes of given clouds."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import lru_cache
from itertools import accumulate

import numpy as np

from mlsanm_cli.app.scene.outlines import run_of
from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.case import (
    AnyLoad,
    BodyForce,
    Case,
    Centrifugal,
    Displacement,
    ExpressionError,
    Force,
    Place,
    Pressure,
    Temperature,
    Traction,
    value_at,
)
from mlsanm_cli.cloud.cells import FINE, Halves
from mlsanm_cli.cloud.cloud import Cloud
from mlsanm_cli.cloud.curves import Curve, Outline
from mlsanm_cli.cloud.surface import BoundaryRun, Surface
from mlsanm_cli.errors import CaseError, CaseProblem
from mlsanm_cli.mechanics import scene as mechanics
from mlsanm_cli.mechanics.eigenstress import Heating
from mlsanm_cli.records import dataclass
from mlsanm_cli.roundoff import COARSE_ROUND_OFF, ROUND_OFF

SAMPLES = 4096
"""Samples along a boundary, a power of two."""
MIN_JUMP = 0.05
"""Least discontinuity that counts, relative to the largest value."""
BISECTIONS = 40
MIN_DISTANCE = 1e-3
"""Least distance of a jump from the end of the boundary and from other jumps, relative to the boundary."""
MAX_JUMPS = 64
"""Boundaries with more jumps are not cut at them."""
POINTS, WEIGHTS = np.polynomial.legendre.leggauss(4)
PANELS = 64
"""Gauss panels per curve, as the knots of splines are not known here."""
SAMPLES_PER_POINT = 32
"""Samples for each quadrature point if tractions are discontinuous between nodes."""

Amounts = Sequence[float | str | None]
"""Numbers and expressions in x and y; None where nothing is given."""
Table = tuple[tuple[float, ...], ...]
"""Rows of arc length and values, interpolated linearly."""
Profile = tuple[BoundaryRun, FloatArray, tuple[float, ...]]
"""Values (SAMPLES + 1, c) of a load, relative to the largest, at even steps along the part of a run, and the
arc lengths of jumps along the part."""


def amounts_of(load: AnyLoad) -> Amounts:
    """The amounts that a load gives: components, a pressure or a temperature change; of other loads none."""
    match load:
        case Temperature():
            return (load.temperature,)
        case Pressure():
            return (load.pressure,)
        case Traction():
            return load.traction or ()
        case Displacement():
            return load.components
        case BodyForce() | Centrifugal():
            return load.body_force
    return ()


def table_of(load: AnyLoad) -> Table:
    """The table of a load over the arc length of its boundary, empty without one."""
    return (load.table or ()) if isinstance(load, Pressure | Traction) else ()


def amounts_at(amounts: Amounts, points: FloatArray) -> FloatArray:
    """Amounts (c,) at ``points`` (n, 2), as columns (n, c); None is 0. Raises ExpressionError."""
    columns = [
        np.array([value_at(amount, x, y) for x, y in points.tolist()])
        if isinstance(amount, str)
        else np.full(len(points), amount or 0.0)
        for amount in amounts
    ]
    return np.stack(columns, axis=1)


def values_along(amounts: Amounts, table: Table, arc: FloatArray, points: FloatArray) -> FloatArray:
    """Values (n, c) of a ``table`` at arc lengths ``arc`` (n,), without one of ``amounts`` at ``points``."""
    if not table:
        return amounts_at(amounts, points)
    rows = np.array(table)
    return np.stack([np.interp(arc, rows[:, 0], column) for column in rows[:, 1:].T], axis=1)


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


def runs_of(outline: Outline, place: Place) -> list[BoundaryRun]:
    """The runs of a place on the outline of its body. Loaded boundaries need not join."""
    groups = [place.edges] if place.ends else [(edge,) for edge in place.edges]
    return [
        BoundaryRun(outline, *chain, place.ends)
        for edges in groups
        for chain in outline.chains(outline.numbers(*edges))
    ]


@lru_cache(maxsize=256)
def profiles(outline: Outline, load: Pressure | Traction | Displacement) -> tuple[Profile, ...]:
    """The profiles of a load that varies along boundaries of its body's ``outline``; empty if an expression
    has no value."""
    expressions = tuple(amount for amount in amounts_of(load) if isinstance(amount, str))
    table = table_of(load)
    found, start = [], 0.0
    for run in runs_of(outline, load.place) if expressions or table else ():
        curve = run.part

        def values(arc: FloatArray, run: BoundaryRun = run, start: float = start) -> FloatArray:
            return values_along(expressions, table, start + arc, run.part.points(arc))

        arc = np.linspace(0.0, curve.length, SAMPLES + 1)
        try:
            sampled = values(arc)
            scale = float(np.abs(sampled).max())
            if scale > 0.0:
                jumps = _jumps(values, arc, sampled, MIN_JUMP * scale)
                found.append((run, sampled / scale, jumps))
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


def spread(load: Force, outlines: Mapping[str, Outline], revolved: bool) -> Traction | BodyForce:
    """A body force or a traction of the resultants of a load of kind `force`. Raises CaseError for parts of
    boundaries that do not join."""
    outline = outlines[load.owner]
    curves = list(outline.curves)
    for place in load.places:
        curves = [outline.curves[number] for number in outline.numbers(*place.edges)]
        if place.ends is not None:
            curves = [run_of(outlines, place, f"load.{load.name}").part]
    share = ((np.arange(PANELS)[:, None] + 0.5 + 0.5 * POINTS) / PANELS).ravel()
    points = np.concatenate([curve.points(share * curve.length) for curve in curves])
    normals = np.concatenate([curve.normals(share * curve.length) for curve in curves])
    panel = np.tile(0.5 * WEIGHTS / PANELS, PANELS)
    weight = np.concatenate([panel * curve.length for curve in curves])
    if revolved:
        ring = np.pi * points[:, 0] * weight
        size = ring @ (points[:, 0] * normals[:, 0]) if load.body is not None else 2.0 * ring.sum()
        return load.spread(float(size), (0.0, 0.0), 1.0)
    # Integrals of 1, x and x^2: over an area, by the divergence theorem, from those of x . n.
    inside = load.body is not None
    flux = weight * (points * normals).sum(axis=1) if inside else weight
    one, two, three = (2.0, 3.0, 4.0) if inside else (1.0, 1.0, 1.0)
    size, second = flux.sum() / one, flux @ (points**2).sum(axis=1) / three
    x, y = (flux @ points / two / size).tolist()
    return load.spread(float(size), (x, y), float(second - size * (x * x + y * y)))


@dataclass(frozen=True)
class Acting:
    """Loads at factor 1, without those on platens, and ``springs[body][surface]``, traction per
    displacement."""

    surface_loads: tuple[mechanics.SurfaceLoad, ...]
    body_forces: tuple[mechanics.BodyForce, ...]
    heatings: tuple[Heating, ...]
    springs: Mapping[str, Mapping[str, tuple[float, float]]]


def temperature_of(load: Temperature) -> AmountField:
    """The temperature change of a load."""
    return AmountField(f"load.{load.name}.temperature", load.temperature)


def acting(
    case: Case,
    names: Mapping[Place, tuple[str, ...]],
    outlines: Mapping[str, Outline],
    clouds: Mapping[str, Cloud],
) -> Acting:
    """Evaluates all loads; ``names`` are those of the surfaces of places on the ``outlines`` as drawn. Raises
    CaseError for expressions without a value at a node, and for tables that do not cover their boundary."""
    problems = list[CaseProblem]()
    nodal = {body.name for body in case.body if body.has_nodes}
    surface_loads, body_forces = list[mechanics.SurfaceLoad](), list[mechanics.BodyForce]()
    heatings = list[Heating]()
    for number, load in enumerate(case.load):
        try:
            match load:
                case Traction() | Pressure() | Displacement():
                    cloud = clouds[load.owner]
                    surfaces = [cloud.surfaces[name] for name in names[load.place]]
                    jumps = [place for *_, places in profiles(outlines[load.owner], load) for place in places]
                    averaged = bool(jumps) and load.owner in nodal
                    surface_loads += _on_boundary(number, load, surfaces, cloud.points, averaged)
                case BodyForce() | Centrifugal():
                    values = amounts_at(load.body_force, clouds[load.body].points)
                    body_forces.append(mechanics.BodyForce(number, load.body, values))
                case Temperature():
                    field = temperature_of(load)
                    heatings.append(Heating(number, load.body, field, field.at(clouds[load.body].points)))
        except ExpressionError as error:
            problems.append(CaseProblem(f"load.{load.name}.{load.kind}", str(error)))
        except CaseError as error:
            problems += error.problems
    if problems:
        raise CaseError(tuple(problems))
    springs: dict[str, dict[str, tuple[float, float]]] = {body.name: {} for body in case.body}
    for support in case.support:
        if support.place is not None and support.spring is not None:
            own = springs[support.place.body]
            for surface in names[support.place]:
                x, y = own.get(surface, (0.0, 0.0))
                own[surface] = (x + support.spring[0], y + support.spring[1])
    return Acting(tuple(surface_loads), tuple(body_forces), tuple(heatings), springs)


def _on_boundary(
    number: int,
    load: Traction | Pressure | Displacement,
    surfaces: Sequence[Surface],
    points: FloatArray,
    averaged: bool,
) -> Iterator[mechanics.SurfaceLoad]:
    """A load at the nodes ``points`` (n, 2) of its surfaces, 0 in free directions, and tractions at the FINE
    quadrature points; ``averaged`` over the length of each if they are discontinuous between given nodes."""
    amounts, table, held = amounts_of(load), table_of(load), isinstance(load, Displacement)
    *starts, length = accumulate((surface.curve.length for surface in surfaces), initial=0.0)
    if table and (
        table[0][0] > COARSE_ROUND_OFF * length or table[-1][0] < (1.0 - COARSE_ROUND_OFF) * length
    ):
        message = f"goes from {table[0][0]:.6g} to {table[-1][0]:.6g}, the boundary from 0 to {length:.9g}"
        raise CaseError((CaseProblem(f"load.{load.name}.table", message),))
    for surface, start in zip(surfaces, starts, strict=True):
        curve, between = surface.curve, None

        def at(arc: FloatArray, points: FloatArray, curve: Curve = curve, start: float = start) -> FloatArray:
            values = values_along(amounts, table, arc + start, points)
            return -values * curve.normals(arc) if isinstance(load, Pressure) else values

        values = at(surface.arc_length, points[surface.index])
        if not held:
            if not curve.closed:
                # Tractions may be discontinuous at the end of a surface.
                just = np.array([ROUND_OFF, 1.0 - ROUND_OFF]) * curve.length
                values[[0, -1]] = at(just, curve.points(just))
            halves = Halves.of(surface, FINE)
            between = at(halves.arc, curve.points(halves.arc))
            if averaged:
                order = np.argsort(halves.arc)
                step = halves.length[order]
                share = (np.arange(SAMPLES_PER_POINT) + 0.5) / SAMPLES_PER_POINT
                arc = ((np.cumsum(step) - step)[:, None] + share * step[:, None]).ravel()
                sampled = at(arc, curve.points(arc))
                between[order] = sampled.reshape(-1, SAMPLES_PER_POINT, 2).mean(axis=1)
        yield mechanics.SurfaceLoad(number, load.owner, surface.name, values, held, between)
