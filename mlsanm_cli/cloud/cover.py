"""Zones of refinement that give every node about the spacing it asks for."""

from __future__ import annotations

import numpy as np

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.cloud.spacing import Spacing, Zone

LIMIT = 24
TOLERANCE = 1.25
"""A node is content with a spacing this many times wider than asked for."""


def cover(
    points: FloatArray,
    spacing: FloatArray,
    wanted: FloatArray,
    planned: Spacing,
    growth: float,
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
        ratio = has / wanted
        worst = int(np.argmax(ratio))
        if ratio[worst] <= TOLERANCE:
            break
        h = float(wanted[worst])
        middle = points[worst]
        distance = np.hypot(*(points - middle).T)
        near = np.argsort(distance)
        fine = area[near] * (wanted[near] <= TOLERANCE * h)
        mostly = np.cumsum(fine) >= 0.7 * np.cumsum(area[near])
        # As far as every circle up to there mostly needs this spacing.
        last = int(np.argmin(mostly)) - 1 if not mostly.all() else len(near) - 1
        radius = max(float(distance[near[max(last, 0)]]), h)
        zones.append(Zone.around((float(middle[0]), float(middle[1])), h, radius, growth))
        has = np.minimum(has, Spacing(planned.far, (zones[-1],)).at(points))
    return tuple(zones)
