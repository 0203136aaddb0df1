"""Refinement zones that approximate a wanted spacing field."""

from __future__ import annotations

import numpy as np

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.cloud.mirror import SymmetryLine
from mlsanm_cli.cloud.spacing import Spacing, Zone

LIMIT = 24
SPACING_TOLERANCE = 1.25
"""Accepted ratio of actual to wanted spacing."""
SNAP_DISTANCE = 0.5
"""Zone centres closer to the symmetry line than this fraction of the wanted spacing are moved onto it."""


def cover(
    points: FloatArray,
    spacing: FloatArray,
    wanted: FloatArray,
    planned: Spacing,
    growth: float,
    line: SymmetryLine | None = None,
) -> tuple[Zone, ...]:
    """Circular refinement zones for nodes ``points`` (n, 2) of ``spacing`` (n,) that want ``wanted`` (n,).

    At most LIMIT zones, twice as many with a symmetry ``line``. Greedy: the node with the largest ratio of
    actual to wanted spacing becomes the centre of a zone, whose radius grows as long as most of the area
    inside wants that spacing; infinity wants nothing. ``planned`` is the spacing without these zones. With a
    ``line`` the zones are symmetric if ``planned`` and ``wanted`` are.
    """
    has = planned.at(points)
    area = spacing**2
    zones: list[Zone] = []
    for _ in range(LIMIT):
        ratio = has / wanted
        worst = int(np.argmax(ratio))
        if ratio[worst] <= SPACING_TOLERANCE:
            break
        h = float(wanted[worst])
        middle = points[worst]
        if line is not None and abs(middle[line.axis] - line.at) < SNAP_DISTANCE * h:
            middle = np.where(np.arange(2) == line.axis, line.at, middle)
        distance = np.hypot(*(points - middle).T)
        near = np.argsort(distance)
        fine = area[near] * (wanted[near] <= SPACING_TOLERANCE * h)
        mostly = np.cumsum(fine) >= 0.7 * np.cumsum(area[near])
        # The largest circle such that this spacing is needed in most of it and of all smaller ones.
        last = int(np.argmin(mostly)) - 1 if not mostly.all() else len(near) - 1
        radius = max(float(distance[near[max(last, 0)]]), h)
        places = [middle] if line is None else np.unique([middle, *line.reflect(middle[None])], axis=0)
        added = tuple(Zone.around((float(x), float(y)), h, radius, growth) for x, y in places)
        zones += added
        has = np.minimum(has, Spacing(planned.far, added).at(points))
    return tuple(zones)
