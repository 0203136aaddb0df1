"""Where fields of forces may end outside a body: far away, or at a center in a hollow."""

from __future__ import annotations

import numpy as np

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.cloud.cloud import Cloud
from mlsanm_cli.cloud.curves import Curve
from mlsanm_cli.mechanics.near_field import ComplexArray, as_complex

CLOSE = 0.1
"""Centers are no nearer to the outline than this part of the places' extent, if others can be seen."""
HALVES = 0.5 ** np.arange(6)
GRAZING = 1e-9
"""Chords that directions differ from by less are not seen: walls at right angles at the end of a face."""
CHORDS = 200
"""Every boundary is looked at as so many chords."""


def void_center(cloud: Cloud, place: ComplexArray, inward: ComplexArray) -> list[complex | None]:
    """Where the fields of forces at places (e,) of a body's outline end: [None] where the way outwards is
    free, and nothing where the void has no place that all of them see."""
    free = _free(cloud, place, -inward)
    if np.isinf(free).all():
        return [None]
    middle = len(place) // 2
    away, wide = 0.5 * float(free.min()), float(np.abs(place - place[middle]).max())
    # Where a wall leans over one end of the places, that end is near to it, and the middle need not be: a
    # center close to a surface makes fields there that its nodes do not resolve.
    for size in min(0.5 * float(free[middle]), wide) * HALVES if away < CLOSE * wide else (away,):
        center = complex(place[middle] - size * inward[middle])
        if all_see(cloud, place, inward, center):
            return [center]
    return _seen_around(cloud, place, inward, free, wide)


def _seen_around(
    cloud: Cloud, place: ComplexArray, inward: ComplexArray, free: FloatArray, wide: float
) -> list[complex | None]:
    """Of the centers outwards of any of the places the one that is farthest from the outline: the mouth of a
    slot is seen from around its rounded edge and from its wall, what lies before their middle is not."""
    size = np.minimum(0.5 * free, wide)[:, None] * HALVES
    centers = (place[:, None] - size * inward[:, None]).ravel()
    outline = np.concatenate(
        [as_complex(one.curve.points(_looks(one.curve))) for one in cloud.surfaces.values()]
    )
    clear = np.array([np.abs(outline - center).min() for center in centers])
    for number in np.argsort(-clear):
        if clear[number] < CLOSE * wide:
            break
        if all_see(cloud, place, inward, complex(centers[number])):
            return [complex(centers[number])]
    return []


def all_see(cloud: Cloud, place: ComplexArray, inward: ComplexArray, center: complex | None) -> bool:
    """Whether the way from all places (e,) of a body's outline to a ``center``, or outwards without one, is
    free of the body."""
    if center is None:
        return bool(np.isinf(_free(cloud, place, -inward)).all())
    lines = center - place
    size = np.abs(lines)
    return bool((_free(cloud, place, lines / size) > size).all())


def _free(cloud: Cloud, place: ComplexArray, ahead: ComplexArray) -> FloatArray:
    """How far (e,) one sees from places (e,) along unit directions ``ahead`` (e,) before the outline comes
    into view; not counting what is no farther than one of its chords."""
    starts, ways = [], []
    for surface in cloud.surfaces.values():
        points = as_complex(surface.curve.points(_looks(surface.curve)))
        starts.append(points[:-1])
        ways.append(np.diff(points))
    start, way = np.concatenate(starts), np.concatenate(ways)
    across = (np.conj(ahead)[:, None] * way).imag
    apart = start - place[:, None]
    with np.errstate(divide="ignore", invalid="ignore"):
        distance = (np.conj(apart) * way).imag / across
        share = -(np.conj(ahead)[:, None] * apart).imag / across
    hit = (
        (np.abs(across) > GRAZING * np.abs(way))
        & (share >= 0.0)
        & (share <= 1.0)
        & (distance > np.abs(way).max())
    )
    return np.asarray(np.where(hit, distance, np.inf).min(axis=1))


def _looks(curve: Curve) -> FloatArray:
    """Arc lengths (c + 1,) of the ends of a boundary's chords."""
    return np.linspace(0.0, curve.length, CHORDS + 1)
