"""Corners of an outline that point into the material, and the nodes that fits need to know their fields."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from mlsanm_cli.cloud.curves import Outline
from mlsanm_cli.cloud.tips import MIN_REENTRANT_ANGLE

PER_ROOT = 20.0
"""Spacings along sides between two corners that point into the material: fits then know the fields of both. A
hub on a keyed shaft is within 0.7 %, with 13 it was 4 % off; a slit within 0.7 %, with 8 it was 1.3 %."""
ACROSS_ROOTS = 14.0
"""Spacings at such corners over their distance across the material, for the same reason. A gear tooth with
seven was 4 to 13 % too stiff, by the seed; with ten it is within 0.8 %."""


def across_roots(outline: Outline) -> Iterator[tuple[tuple[float, float], float]]:
    """The corners that point into the material and see others across it, and how far the nearest is."""
    place, into, least = [], [], []
    for loop in outline.loops:
        curves = outline.curves[loop]
        for one, other in zip(curves, (*curves[1:], *curves[:1]), strict=True):
            a, b = one.normals(np.array([one.length]))[0], other.normals(np.array([0.0]))[0]
            turn = float(np.arctan2(a[0] * b[1] - a[1] * b[0], a @ b))
            if turn < -MIN_REENTRANT_ANGLE:
                place.append(other.points(np.array([0.0]))[0])
                into.append(-(a + b) / np.hypot(*(a + b)))
                least.append(np.cos(0.5 * (np.pi - turn) - MIN_REENTRANT_ANGLE))
    if len(place) < 2:
        return
    at = np.array(place)
    way = at - at[:, None]
    away = np.hypot(*way.T)
    np.fill_diagonal(away, np.inf)
    seen = (way * np.array(into)[:, None]).sum(axis=2) > np.array(least)[:, None] * away
    apart = np.where(seen & seen.T, away, np.inf).min(axis=1)
    yield from zip(map(tuple, at.tolist()), apart.tolist(), strict=True)


def roots_of(outline: Outline) -> set[int]:
    """Numbers of the curves between two corners that point into the material."""
    found = set()
    for loop in outline.loops:
        numbers = range(len(outline.curves))[loop]
        ends = [outline.curves[k].normals(np.array([0.0, outline.curves[k].length])) for k in numbers]
        crossed = [
            a[1, 0] * b[0, 1] - a[1, 1] * b[0, 0] for a, b in zip(ends, ends[1:] + ends[:1], strict=True)
        ]
        inward = [turn < -MIN_REENTRANT_ANGLE for turn in crossed]
        found |= {number for k, number in enumerate(numbers) if inward[k] and inward[k - 1]}
    return found
