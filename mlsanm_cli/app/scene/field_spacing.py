"""Zones of finer nodes where temperatures and body forces vary within a few spacings."""

from __future__ import annotations

from collections.abc import Iterator
from functools import lru_cache

import numpy as np

from mlsanm_cli.app.scene.default_spacing import GROWTH
from mlsanm_cli.app.scene.load_spacing import LINEARITY_TOLERANCE
from mlsanm_cli.app.scene.outlines import drawn
from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.case import BodyForce, Case, ExpressionError, Temperature, value_at
from mlsanm_cli.case.model.case import Body
from mlsanm_cli.case.model.shapes import AnyShape
from mlsanm_cli.cloud.membership import inside_polygon
from mlsanm_cli.cloud.spacing import Zone

SAMPLES = 5
"""Samples per direction of a square."""
OVERLAP = 1.5
"""Size of the sampled region over that of the square, so that a kink lies inside one."""
MAX_SQUARES = 64
"""Largest number of squares of one size that are divided: along lines of discontinuity no size suffices."""
LEVELS = 12
CURVE_SAMPLES = 100
"""Chords per curve of an outline, to determine which points are inside."""


def field_zones(case: Case, body: Body, far: float) -> Iterator[Zone]:
    """Zones of all fields over a body for which the spacing ``far`` is too coarse."""
    for load in case.load:
        if isinstance(load, Temperature | BodyForce) and load.body == body.name:
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
            [_nonlinearity(*one) > LINEARITY_TOLERANCE * scale for one in zip(values, points, strict=True)]
        )
        if scale == 0.0 or not bent.any() or (level and bent.sum() > MAX_SQUARES):
            break
        size *= 0.5
        found += [Zone.around((x, y), size, size, GROWTH) for x, y in centers[bent].tolist()]
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
