"""Zones of finer nodes where conditions on a boundary, temperatures or body forces change within a few
spacings.

Tractions and displacements that end where a boundary continues, or vary along it, have a length scale
independent of the size of the body: a pressure on a fiftieth of a block's side would fall between two nodes.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import lru_cache

import numpy as np

from mlsanm_cli.app.scene.conditions import conditions
from mlsanm_cli.app.scene.contact_spacing import SMOOTH
from mlsanm_cli.app.scene.default_spacing import GROWTH, LEVELS, MIN_SPACING, banded, zone_at
from mlsanm_cli.app.scene.load_profiles import LoadProfile, profiles, runs_of
from mlsanm_cli.app.scene.outlines import drawn
from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.case import (
    Body,
    BodyForce,
    Case,
    Centrifugal,
    Displacement,
    ExpressionError,
    Pressure,
    Temperature,
    Traction,
    value_at,
)
from mlsanm_cli.case.model.conditions import Support
from mlsanm_cli.case.model.shapes import AnyShape
from mlsanm_cli.cloud.curves import turn
from mlsanm_cli.cloud.joined import BoundaryRun
from mlsanm_cli.cloud.membership import inside_polygon
from mlsanm_cli.cloud.spacing import Zone

PER_LENGTH, PER_LENGTH_AT_ENDS, PER_LENGTH_AT_FIXED_ENDS = 8.0, 32.0, 256.0
"""Length of a loaded or fixed part over the spacing along it, and over that at its ends; at those of fixed
parts stresses are unbounded."""
LINEARITY_TOLERANCE = 0.02
"""Largest deviation of values from linear over a spacing, relative to the largest value."""
SAMPLES = 5
"""Samples per direction of a square."""
OVERLAP = 1.5
"""Size of the sampled region over that of the square, so that a kink lies inside one."""
MAX_SQUARES = 64
"""Largest number of squares of one size that are divided: along lines of discontinuity no size suffices."""
CURVE_SAMPLES = 100
"""Chords per curve of an outline, to determine which points are inside."""


def load_zones(case: Case, body: Body, far: float) -> Iterator[Zone]:
    """Zones of all conditions on the boundaries of a body for which the spacing ``far`` is too coarse."""
    for _, condition, place in conditions(case):
        sprung = isinstance(condition, Support) and condition.spring is not None
        loose = sprung or isinstance(condition, Pressure | Traction)
        at_edge = PER_LENGTH_AT_ENDS if loose else PER_LENGTH_AT_FIXED_ENDS
        for run in runs_of(body.shape, place) if place.body == body.name else ():
            yield from _edge_zones(run, far, at_edge)
    for load in case.load:
        if isinstance(load, Pressure | Traction | Displacement) and load.owner == body.name:
            for profile in profiles(body.shape, load):
                yield from _varying_zones(profile, far)


def _edge_zones(run: BoundaryRun, far: float, at_edge: float) -> Iterator[Zone]:
    """Zones along the part of a run, and at its ends where the boundary continues smoothly."""
    curve, first = run.part, run.range[0]
    if curve.closed:
        return
    places = np.array([0.0, curve.length])
    edges = [k for k in (0, 1) if _continues(run, first + float(places[k]), k)]
    if edges and curve.length < PER_LENGTH * far:
        yield Zone(curve, max(curve.length / PER_LENGTH, MIN_SPACING * far), 0.0, GROWTH)
    if curve.length < at_edge * far:
        for end in curve.points(places[edges]):
            yield zone_at(end, max(curve.length / at_edge, MIN_SPACING * far))


def _continues(run: BoundaryRun, at: float, end: int) -> bool:
    """Whether the boundary continues smoothly at arc length ``at`` of a run: inside it, or beyond its first
    (0) or last (1) ``end``."""
    if run.continues(at):
        return True
    number = run.numbers[-end]
    sides = (number, run.outline.neighbours(number)[end])[:: 1 if end else -1]
    return bool(np.cos(turn(*(run.outline.curves[side] for side in sides))) > SMOOTH)


def _varying_zones(profile: LoadProfile, far: float) -> Iterator[Zone]:
    """Zones along a boundary where a load varies, and at its discontinuities."""
    curve = profile.run.part
    arc = np.linspace(0.0, curve.length, len(profile.values))
    sizes = resolved_sizes(profile.values, curve.length, far)
    marks = np.array([0.0, *profile.jumps, curve.length])
    for k, jump in enumerate(profile.jumps, start=1):
        apart = float(min(marks[k] - marks[k - 1], marks[k + 1] - marks[k]))
        least = min(max(apart / PER_LENGTH_AT_ENDS, MIN_SPACING * far), far)
        # On each side of a jump the load is resolved by linear interpolation.
        near = np.abs(0.5 * (arc[1:] + arc[:-1]) - jump) < 0.5 * apart
        sizes = np.where(near, np.maximum(sizes, least), sizes)
        yield zone_at(curve.points(np.array([jump]))[0], least)
    yield from banded(curve, sizes, far)


def resolved_sizes(values: FloatArray, length: float, far: float) -> FloatArray:
    """Spacings (s,) of at most ``far`` over which ``values`` (s + 1, c) at even steps along a ``length`` are
    nearly linear, by repeated halving of the length; s is a power of two.

    >>> resolved_sizes(np.array([[0.0], [0.0], [0.0], [0.0], [1.0]]), 1.0, 0.5).tolist()
    [0.5, 0.5, 0.25, 0.25]
    """
    count = len(values) - 1
    sizes, width = np.full(count, far), count
    while width > 1:
        # Windows overlap by half, so that a kink lies inside one.
        starts = np.arange(0, count - width + 1, width // 2)
        rows = values[starts[:, None] + np.arange(width + 1)]
        share = np.linspace(0.0, 1.0, width + 1)[:, None]
        lines = (1.0 - share) * rows[:, :1] + share * rows[:, -1:]
        width //= 2
        for start in starts[np.abs(rows - lines).max(axis=(1, 2)) > LINEARITY_TOLERANCE].tolist():
            inside = slice(start, start + 2 * width)
            sizes[inside] = np.minimum(sizes[inside], width * length / count)
    return sizes


def field_zones(case: Case, body: Body, far: float) -> Iterator[Zone]:
    """Zones of all fields over a body for which the spacing ``far`` is too coarse."""
    for load in case.load:
        if isinstance(load, Temperature | BodyForce | Centrifugal) and load.body == body.name:
            given = [load.temperature] if isinstance(load, Temperature) else load.body_force
            for expression in given:
                if isinstance(expression, str):
                    yield from _zones(body.shape, expression, far)


@lru_cache(maxsize=64)
def _zones(shape: AnyShape, expression: str, far: float) -> tuple[Zone, ...]:
    """Zones of squares, halved until the field is linear in each."""
    curves, found = drawn(shape).curves, list[Zone]()
    along = [curve.points(np.linspace(0.0, curve.length, CURVE_SAMPLES + 1)) for curve in curves]
    edges = np.concatenate([np.hstack([points[:-1], points[1:]]) for points in along])
    low, high = edges[:, :2].min(axis=0), edges[:, :2].max(axis=0)
    size = float((high - low).max())
    count = int(np.ceil(size / far))
    size /= count
    ticks = size * (np.arange(count) - 0.5 * (count - 1))
    centers = 0.5 * (low + high) + np.stack(np.meshgrid(ticks, ticks), axis=-1).reshape(-1, 2)
    scale = 0.0
    for level in range(LEVELS):
        values, points = _sampled(expression, edges, centers, size)
        if not level:
            scale = float(np.nanmax(np.abs(values), initial=0.0))
        bent = np.array(
            [
                _nonlinearity(*square) > LINEARITY_TOLERANCE * scale
                for square in zip(values, points, strict=True)
            ]
        )
        if scale == 0.0 or not bent.any() or (level and bent.sum() > MAX_SQUARES):
            break
        size *= 0.5
        found += [zone_at(center, size, size) for center in centers[bent]]
        quarters = 0.5 * size * np.array([[-1.0, -1.0], [1.0, -1.0], [-1.0, 1.0], [1.0, 1.0]])
        centers = (centers[bent][:, None] + quarters).reshape(-1, 2)
    return tuple(found)


def _sampled(
    expression: str, edges: FloatArray, centers: FloatArray, size: float
) -> tuple[FloatArray, FloatArray]:
    """Values (k, s), nan outside the body, at points (k, s, 2) in squares (k, 2) of one size."""
    ticks = OVERLAP * size * np.linspace(-0.5, 0.5, SAMPLES)
    points = centers[:, None] + np.stack(np.meshgrid(ticks, ticks), axis=-1).reshape(-1, 2)
    values = np.full(points.shape[:2], np.nan)
    inside = inside_polygon(edges, points.reshape(-1, 2)).reshape(values.shape)
    for row, column in np.argwhere(inside).tolist():
        try:
            values[row, column] = value_at(expression, *points[row, column].tolist())
        except ExpressionError:
            # Reported when loads are evaluated at the nodes.
            continue
    return values, points


def _nonlinearity(values: FloatArray, points: FloatArray) -> float:
    """Largest deviation of values (s,) at points (s, 2) from the best linear function."""
    known = np.isfinite(values)
    if known.sum() <= SAMPLES:
        return 0.0
    basis = np.column_stack([np.ones(int(known.sum())), points[known] - points.mean(axis=0)])
    return float(np.abs(values[known] - basis @ np.linalg.lstsq(basis, values[known])[0]).max())
