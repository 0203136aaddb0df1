"""Zones of refinement that give every node about the spacing it asks for."""

from __future__ import annotations

import numpy as np

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.cloud.spacing import Spacing, Zone

LIMIT = 24
TOLERANCE = 1.25
"""A node is content with a spacing this many times wider than asked for."""


def cover(
    points: FloatArray, spacing: FloatArray, wanted: FloatArray, planned: Spacing, growth: float
) -> tuple[Zone, ...]:
    """Round zones, LIMIT at most, for nodes ``points`` (n, 2) of ``spacing`` (n,) that want ``wanted`` (n,).

    Greedy: the node that is farthest from what it wants becomes the middle of a zone, whose radius grows as
    long as most of the area inside wants the same; infinity wants nothing. ``planned`` is the spacing
    without these zones.
    """
    has = planned.at(points)
    area = spacing**2
    zones: list[Zone] = []
    for _ in range(LIMIT):
        lack = has / wanted
        worst = int(np.argmax(lack))
        if lack[worst] <= TOLERANCE:
            break
        h = float(wanted[worst])
        distance = np.hypot(*(points - points[worst]).T)
        near = np.argsort(distance)
        alike = np.cumsum(area[near] * (wanted[near] <= TOLERANCE * h)) >= 0.7 * np.cumsum(area[near])
        # As far as every circle up to there is mostly alike.
        last = int(np.argmin(alike)) - 1 if not alike.all() else len(near) - 1
        middle = (float(points[worst, 0]), float(points[worst, 1]))
        zone = Zone.around(middle, h, max(float(distance[near[max(last, 0)]]), h), growth)
        zones.append(zone)
        has = np.minimum(has, Spacing(planned.far, (zone,)).at(points))
    return tuple(zones)
