"""Estimate of the number of nodes of a cloud before it is built."""

from __future__ import annotations

import numpy as np

from mlsanm_cli.cloud.curves import Outline
from mlsanm_cli.cloud.polygon import inside_polygon
from mlsanm_cli.cloud.spacing import Spacing
from mlsanm_cli.errors import RunError

NODES_PER_SQUARE = 0.89
"""Nodes per area h^2 of an advancing-front cloud, fitted to 16 uniform and graded clouds."""
MAX_CELLS = 500_000
NODES_PER_STEP = 0.44
"""Extra nodes per boundary node, from the same fit: half of a boundary node's area lies outside."""


def estimate_nodes(outline: Outline, spacing: Spacing, limit: float = 1e9) -> float:
    """Estimated number of nodes, at most ``limit``.

    From the integrals of 1/h^2 over the region, by quadtree, and of 1/h along its outline.
    """
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
            rest = NODES_PER_SQUARE * float((size**2 / h[~fine] ** 2)[coarse].sum())
            total += rest
            break
        quarter = 0.25 * size
        corners = np.array(
            [(-quarter, -quarter), (quarter, -quarter), (-quarter, quarter), (quarter, quarter)]
        )
        cells = (cells[~fine][:, None, :] + corners).reshape(-1, 2)
        outside = ((cells < low - quarter) | (cells > high + quarter)).any(axis=1)
        cells = cells[~outside]
        size *= 0.5
    try:
        steps = sum(len(spacing.steps_along(curve)) - 1 for curve in outline.curves)
    except RunError:
        return limit
    return min(total + NODES_PER_STEP * steps, limit)
