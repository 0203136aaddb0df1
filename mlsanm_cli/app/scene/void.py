"""Ends of the fields of forces outside a body: at infinity, or at a center in a hollow."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.cloud.cloud import Cloud
from mlsanm_cli.cloud.curves import Curve
from mlsanm_cli.mechanics.near_field import ComplexArray, as_complex
from mlsanm_cli.mechanics.symmetry import Image
from mlsanm_cli.roundoff import ROUND_OFF

MIN_CLEARANCE = 0.1
"""Least distance of centers from the outline, relative to the extent of the places, if others are visible."""
HALVES = 0.5 ** np.arange(6)
CHORDS = 200
"""Number of chords by which every boundary is approximated."""


def void_center(
    cloud: Cloud, place: ComplexArray, inward: ComplexArray, images: Sequence[Image] = ()
) -> list[complex | None]:
    """Where the fields of forces at places (e,) of an outline end: [None] at infinity if the outward rays are
    free, else a center visible from all places; empty if there is none. The ``images`` of the body are in the
    way as it is itself."""
    free = _free(cloud, place, -inward)
    for image in images:
        free = np.minimum(free, _free(cloud, image.points(place), -image.directions(inward)))
    if np.isinf(free).all():
        return [None]
    middle = len(place) // 2
    away, wide = 0.5 * float(free.min()), float(np.abs(place - place[middle]).max())
    # A wall that overhangs one end of the places is near that end, but not necessarily near the middle; the
    # nodes of a surface close to a center would not resolve its fields.
    for size in min(0.5 * float(free[middle]), wide) * HALVES if away < MIN_CLEARANCE * wide else (away,):
        center = complex(place[middle] - size * inward[middle])
        if all_see(cloud, place, inward, center, images):
            return [center]
    return _seen_around(cloud, place, inward, free, wide, images)


def _seen_around(
    cloud: Cloud,
    place: ComplexArray,
    inward: ComplexArray,
    free: FloatArray,
    wide: float,
    images: Sequence[Image],
) -> list[complex | None]:
    """The visible center farthest from the outline, of those outward of any place: the mouth of a slot is
    visible from its rounded edge and from its wall, the region outward of their middle is not."""
    size = np.minimum(0.5 * free, wide)[:, None] * HALVES
    centers = (place[:, None] - size * inward[:, None]).ravel()
    outline = np.concatenate(
        [as_complex(one.curve.points(_chord_ends(one.curve))) for one in cloud.surfaces.values()]
    )
    clear = np.array([np.abs(outline - center).min() for center in centers])
    for number in np.argsort(-clear):
        if clear[number] < MIN_CLEARANCE * wide:
            break
        if all_see(cloud, place, inward, complex(centers[number]), images):
            return [complex(centers[number])]
    return []


def all_see(
    cloud: Cloud,
    place: ComplexArray,
    inward: ComplexArray,
    center: complex | None,
    images: Sequence[Image] = (),
) -> bool:
    """Whether the segments from places (e,) of an outline to a ``center``, or the outward rays without one,
    are outside the body and its ``images``."""
    if images:
        ends = [None if center is None else complex(one.points(np.array(center))) for one in images]
        each = zip(images, ends, strict=True)
        seen = [all_see(cloud, one.points(place), one.directions(inward), end) for one, end in each]
        return all(seen) and all_see(cloud, place, inward, center)
    if center is None:
        return bool(np.isinf(_free(cloud, place, -inward)).all())
    lines = center - place
    size = np.abs(lines)
    return bool((_free(cloud, place, lines / size) > size).all())


def _free(cloud: Cloud, place: ComplexArray, ahead: ComplexArray) -> FloatArray:
    """Distance (e,) from places (e,) along unit directions ``ahead`` (e,) to the outline, ignoring hits
    within a chord length."""
    starts, ways = [], []
    for surface in cloud.surfaces.values():
        points = as_complex(surface.curve.points(_chord_ends(surface.curve)))
        starts.append(points[:-1])
        ways.append(np.diff(points))
    start, way = np.concatenate(starts), np.concatenate(ways)
    across = (np.conj(ahead)[:, None] * way).imag
    apart = start - place[:, None]
    with np.errstate(divide="ignore", invalid="ignore"):
        distance = (np.conj(apart) * way).imag / across
        share = -(np.conj(ahead)[:, None] * apart).imag / across
    hit = (
        (np.abs(across) > ROUND_OFF * np.abs(way))
        & (share >= 0.0)
        & (share <= 1.0)
        & (distance > np.abs(way).max())
    )
    return np.asarray(np.where(hit, distance, np.inf).min(axis=1))


def _chord_ends(curve: Curve) -> FloatArray:
    """Arc lengths (c + 1,) of the ends of the chords of a boundary."""
    return np.linspace(0.0, curve.length, CHORDS + 1)
