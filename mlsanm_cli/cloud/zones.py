"""The number of nodes of a spacing field, and zones that approximate a wanted one."""

from __future__ import annotations

import numpy as np

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.cloud.cloud import SymmetryLine
from mlsanm_cli.cloud.curves import Outline
from mlsanm_cli.cloud.membership import inside_polygon
from mlsanm_cli.cloud.spacing import Spacing, Zone
from mlsanm_cli.errors import RunError

NODES_PER_SQUARE = 0.89
"""Nodes per area h^2 of an advancing-front cloud, fitted to 16 uniform and graded clouds."""
MAX_CELLS = 500_000
NODES_PER_STEP = 0.44
"""Extra nodes per boundary node, from the same fit: half of a boundary node's area lies outside."""


def estimate_nodes(outline: Outline, spacing: Spacing, limit: float = 1e9) -> float:
    """Estimated number of nodes, at most ``limit``. From the integrals of 1/h^2 over the region, by quadtree,
    and of 1/h along its outline."""
    chains = [curve.points(np.linspace(0.0, curve.length, 65)) for curve in outline.curves]
    edges = np.concatenate([np.hstack([chain[:-1], chain[1:]]) for chain in chains])
    low, high = edges[:, :2].min(axis=0), edges[:, :2].max(axis=0)
    size = float((high - low).max())
    cells = low[None, :] + 0.5 * size
    total = 0.0
    while len(cells):
        h = spacing.at(cells)
        # Fine enough when a cell holds few nodes: the spacing is then nearly uniform in it.
        fine = size <= 4.0 * h
        inside = inside_polygon(edges, cells[fine])
        total += NODES_PER_SQUARE * float((size**2 / h[fine] ** 2)[inside].sum())
        if total > limit:
            return limit
        if len(cells) > MAX_CELLS:
            # With at least 16 nodes in each of so many cells, the rest need not be refined.
            coarse = inside_polygon(edges, cells[~fine])
            total += NODES_PER_SQUARE * float((size**2 / h[~fine] ** 2)[coarse].sum())
            break
        quarter = 0.25 * size
        corners = quarter * np.array([(-1.0, -1.0), (1.0, -1.0), (-1.0, 1.0), (1.0, 1.0)])
        cells = (cells[~fine][:, None, :] + corners).reshape(-1, 2)
        outside = ((cells < low - quarter) | (cells > high + quarter)).any(axis=1)
        cells = cells[~outside]
        size *= 0.5
    try:
        steps = sum(len(spacing.steps_along(curve)) - 1 for curve in outline.curves)
    except RunError:
        return limit
    return min(total + NODES_PER_STEP * steps, limit)


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
    """Circular refinement zones for nodes ``points`` (n, 2) of ``spacing`` (n,) that want ``wanted`` (n,). At
    most LIMIT zones, twice as many with a symmetry ``line``. Greedy: the node with the largest ratio of
    actual to wanted spacing becomes the centre of a zone, whose radius grows as long as most of the area
    inside wants that spacing; infinity wants nothing. ``planned`` is the spacing without these zones. With a
    ``line`` the zones are symmetric if ``planned`` and ``wanted`` are."""
    has, area, zones = planned.at(points), spacing**2, list[Zone]()
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
        added = tuple(Zone.around(place, h, radius, growth) for place in places)
        zones += added
        has = np.minimum(has, Spacing(planned.far, added).at(points))
    return tuple(zones)
