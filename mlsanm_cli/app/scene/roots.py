"""Corners of an outline that point into the material, and the nodes that fits need to know their fields."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.cloud.curves import Curve, Outline
from mlsanm_cli.cloud.joined import turn
from mlsanm_cli.cloud.spacing import Zone
from mlsanm_cli.cloud.tips import SMOOTH_TURN
from mlsanm_cli.roundoff import COARSE_ROUND_OFF

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


def root_zones(
    outline: Outline, far: float, growth: float, touching: Sequence[Curve] | None
) -> Iterator[Zone]:
    """Zones at the corners of an outline with the spacing ``far`` that point into the material; ``touching``
    are its sides in contact, None at finite strain.

    Corners of sides in contact have no finer nodes than others across the material require: pressures would
    follow the trace of the singular field into the corner (a dovetail's peak was 5 % too high). Nor have
    those at finite strain, where they were not tried.
    """
    corners = _inward_corners(outline)
    if not corners:
        return
    at = np.concatenate([outline.curves[number].points(np.zeros(1)) for number in corners])
    for place, apart in zip(at, _apart(outline, corners, at).tolist(), strict=True):
        fine = apart / PER_ROOT_DISTANCE
        away = [(curve, curve.points(curve.closest(place[None]))[0] - place) for curve in touching or ()]
        if touching is not None and all(
            np.hypot(*way) > COARSE_ROUND_OFF * curve.length for curve, way in away
        ):
            fine = min(fine, far / ROOT_RATIO)
        if fine < far:
            x, y = place.tolist()
            yield Zone.around((x, y), fine, 0.0, growth)


def _inward_corners(outline: Outline) -> dict[int, tuple[int, float]]:
    """The corners that point into the material, by the number of the curve that begins there: that of the
    curve that ends there, and the angle between the two."""
    found = {}
    for loop in outline.loops:
        numbers = range(len(outline.curves))[loop]
        for before, number in zip((numbers[-1], *numbers), numbers, strict=False):
            angle = turn(outline.curves[before], outline.curves[number])
            if angle < -SMOOTH_TURN:
                found[number] = before, angle
    return found


def _apart(outline: Outline, corners: Mapping[int, tuple[int, float]], at: FloatArray) -> FloatArray:
    """Distance (c,) of every corner ``at`` (c, 2) to the nearest other one that is seen across the material,
    infinite without any."""
    into, least = [], []
    for number, (before, angle) in corners.items():
        one, other = outline.curves[before], outline.curves[number]
        normal = one.normals(np.array([one.length]))[0] + other.normals(np.zeros(1))[0]
        into.append(-normal / np.hypot(*normal))
        least.append(np.cos(0.5 * (np.pi - angle) - SMOOTH_TURN))
    way = at - at[:, None]
    away = np.hypot(*way.T)
    np.fill_diagonal(away, np.inf)
    seen = (way * np.array(into)[:, None]).sum(axis=2) > np.array(least)[:, None] * away
    return np.asarray(np.where(seen & seen.T, away, np.inf).min(axis=1))


def roots_of(outline: Outline) -> set[int]:
    """Numbers of the curves between two corners that point into the material."""
    corners = _inward_corners(outline)
    return {before for before, _ in corners.values() if before in corners}
