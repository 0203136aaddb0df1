"""Corners of an outline that point into the material, and the nodes that fits need to know their fields."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from mlsanm_cli.cloud.curves import Curve, Outline
from mlsanm_cli.cloud.spacing import Zone
from mlsanm_cli.cloud.tips import SMOOTH_TURN

PER_ROOT = 20.0
"""Spacings along sides between two corners that point into the material: fits then know the fields of both. A
hub on a keyed shaft is within 0.7 %, with 13 it was 4 % off; a slit within 0.7 %, with 8 it was 1.3 %."""
PER_ROOT_DISTANCE = 14.0
"""Spacings at such corners over their distance across the material, for the same reason. A gear tooth with
seven was 4 to 13 % too stiff, by the seed; with ten it is within 0.8 %."""
ROOT_RATIO = 4.0
"""The coarse spacing over that at such corners. What is lost there, other than at its mirror image by another
cloud, bends a body that should not: an eye on a shank left its axis by 5 % of its displacement, and by 0.1 to
2 % with any of four seeds now, where 8 is no better."""
ON_SIDE = 1e-6
"""Distance, relative to its length, below which a place is on a side."""


def root_zones(
    outline: Outline, far: float, growth: float, touching: Sequence[Curve] | None
) -> Iterator[Zone]:
    """Zones at the corners of an outline with the spacing ``far`` that point into the material; ``touching``
    are its sides in contact, None at finite strain.

    Corners of sides in contact have no finer nodes than others across the material require: pressures would
    follow the trace of the singular field into the corner (a dovetail's peak was 5 % too high). Nor have
    those at finite strain, where they were not tried.
    """
    for (x, y), apart in _sharp_roots(outline):
        fine = apart / PER_ROOT_DISTANCE
        if touching is not None and not any(_on(curve, x, y) for curve in touching):
            fine = min(fine, far / ROOT_RATIO)
        if fine < far:
            yield Zone.around((x, y), fine, 0.0, growth)


def _on(curve: Curve, x: float, y: float) -> bool:
    """Whether a place is on a curve."""
    place = np.array([[x, y]])
    away = curve.points(curve.closest(place)) - place
    return bool(np.hypot(*away.T)[0] <= ON_SIDE * curve.length)


def _sharp_roots(outline: Outline) -> Iterator[tuple[tuple[float, float], float]]:
    """The corners that point into the material, and the distance of the nearest other one that is seen across
    it, infinite without any."""
    place, into, least = [], [], []
    for loop in outline.loops:
        curves = outline.curves[loop]
        for one, other in zip(curves, (*curves[1:], *curves[:1]), strict=True):
            a, b = one.normals(np.array([one.length]))[0], other.normals(np.array([0.0]))[0]
            turn = float(np.arctan2(a[0] * b[1] - a[1] * b[0], a @ b))
            if turn < -SMOOTH_TURN:
                place.append(other.points(np.array([0.0]))[0])
                into.append(-(a + b) / np.hypot(*(a + b)))
                least.append(np.cos(0.5 * (np.pi - turn) - SMOOTH_TURN))
    if not place:
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
        inward = [turn < -SMOOTH_TURN for turn in crossed]
        found |= {number for k, number in enumerate(numbers) if inward[k] and inward[k - 1]}
    return found
