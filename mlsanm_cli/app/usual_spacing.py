"""The spacing of bodies whose case leaves it to us.

Contacts do not ask for fine nodes, as their pressures act in closed form; what is left changes over the
distance from the contact to the nearest other boundary. Bodies that bend need some nodes across, and arcs
some along.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import numpy as np

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.cloud.curves import Arc, Curve, Outline
from mlsanm_cli.cloud.spacing import Zone
from mlsanm_cli.contact.obstacles import Shape

ALONG, ACROSS = 20.0, 6.0
"""Spacings over the size of a body, and over twice its area divided by its perimeter."""
IN_FRONT = 5.0
"""Spacings between a contact and the nearest other boundary."""
PER_RADIUS, IN_HOLLOWS = 5.0, 10.0
"""Spacings over the radius of an arc; around holes and in hollows stresses concentrate."""
CONFORMING, IN_EACH_OTHER = 1.5, 16.0
"""Arcs in each other whose radii differ by less than this factor, and spacings over these radii."""
GROWTH = 0.25
SAMPLES = 200
FLAT = 1e-6
"""Gaps that differ by less than this part of the length are the same."""


def usual_spacing(outline: Outline) -> float:
    """The spacing far from everything."""
    area = length = 0.0
    low, high = np.full(2, np.inf), np.full(2, -np.inf)
    for curve in outline.curves:
        points = _along(curve)
        low, high = np.minimum(low, points.min(axis=0)), np.maximum(high, points.max(axis=0))
        (x, y), (ahead_x, ahead_y) = points[:-1].T, points[1:].T
        area += 0.5 * float((x * ahead_y - ahead_x * y).sum())
        length += curve.length
    return float(min((high - low).max() / ALONG, 2.0 * area / length / ACROSS))


def arc_zones(outline: Outline, far: float) -> Iterator[Zone]:
    """Finer nodes along arcs of small radius."""
    for curve in outline.curves:
        if isinstance(curve, Arc):
            fine = curve.radius / (PER_RADIUS if curve.sweep > 0.0 else IN_HOLLOWS)
            if fine < far:
                yield Zone(curve, fine, 0.0, GROWTH)


def contact_zone(
    rest: Iterable[Curve], own: Curve, other: Curve | None, obstacle: Shape | None, far: float
) -> Iterator[Zone]:
    """Finer nodes of a body where its boundary ``own`` comes nearest to the ``other`` surface, or to a rigid
    ``obstacle``, if the ``rest`` of its outline or an end is close to that place."""
    if isinstance(own, Arc) and isinstance(other, Arc) and _conform(own, other):
        # Contact and bodies have one scale.
        yield Zone(own, own.radius / IN_EACH_OTHER, 0.0, GROWTH)
    points = _along(own)
    if other is not None:
        partner = other.points(other.closest(points))
    else:
        assert obstacle is not None
        partner, _ = obstacle.closest(points, own.normals(np.linspace(0.0, own.length, SAMPLES + 1)))
    apart = np.hypot(*(points - partner).T)
    nearest = np.flatnonzero(apart <= apart.min() + FLAT * own.length)
    place = points[nearest[len(nearest) // 2]]
    distances = [float(np.hypot(*(_along(curve) - place).T).min()) for curve in rest]
    if not own.closed:
        distances += np.hypot(*(points[[0, -1]] - place).T).tolist()
    distance = min(distances, default=np.inf)
    if FLAT * own.length < distance < IN_FRONT * far:
        yield Zone.around((float(place[0]), float(place[1])), distance / IN_FRONT, distance, GROWTH)


def _conform(one: Arc, other: Arc) -> bool:
    """Whether two arcs lie in each other, nearly alike."""
    unlike = max(one.radius, other.radius) / min(one.radius, other.radius)
    return one.sweep * other.sweep < 0.0 and unlike < CONFORMING


def _along(curve: Curve) -> FloatArray:
    """Points (s, 2) along a curve, both ends included."""
    return curve.points(np.linspace(0.0, curve.length, SAMPLES + 1))
