"""Sums of a body's rows that say how forces and moments get through it.

Least squares weighs the residuals of equilibrium node by node. A force that is lost a little everywhere on
its way to the support costs hardly anything, less than the residuals of the places that are too coarse to
bend as they should: a clamped beam of 8 x 1 with six nodes across bent by a quarter of what it should. In the
norm that belongs to equilibrium, H^-1, long waves of the residual weigh more than short ones (Bramble,
Lazarov and Pasciak 1997, doi:10.1090/S0025-5718-97-00848-X). So sums of the residual over what lies beyond a
few cuts through the body are rows of their own: what equilibrium leaves there, less what the tractions leave.
They are combinations of the rows themselves and vanish with them, at every degree. The same beam then bends
by 0.9 of what it should.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence

import numpy as np
import scipy.sparse as sparse
from scipy.sparse.csgraph import dijkstra

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.cloud.cloud import Cloud

CUTS = 8
"""Cuts through a body; 4 to 16 gave the same."""


def force_sums(
    cloud: Cloud,
    held: Mapping[str, tuple[bool, bool]],
    held_nodes: Sequence[tuple[int, int]],
    first_row: Mapping[str, int],
    rows: int,
    springs: Collection[str] = (),
) -> FloatArray:
    """Factors (3 CUTS, r) by which the body's rows add up to force x, y and moment beyond every cut.

    ``first_row`` and ``rows`` (r) are those of the body. A cut is a ramp from 0 to 1 of the distance from
    what is held or on ``springs``, along the triangles of the nodes; on these surfaces all ramps are 0, so
    that no reaction counts.
    """
    count = len(cloud.points)
    distance = _distance(cloud, held, held_nodes, springs)
    length = float(distance.max())
    area = cloud.areas
    arm = (cloud.points - cloud.points.mean(axis=0)) / length
    sums = np.zeros((3 * CUTS, rows))
    for cut in range(CUTS):
        ramp = np.clip(distance * CUTS / length - cut, 0.0, 1.0)
        zero = np.zeros_like(ramp)
        motions = ((ramp, zero), (zero, ramp), (-arm[:, 1] * ramp, arm[:, 0] * ramp))
        for number, motion in enumerate(motions):
            row = sums[3 * cut + number]
            for component in (0, 1):
                row[component * count : (component + 1) * count] = area * motion[component]
                for name, surface in cloud.surfaces.items():
                    if not held.get(name, (False, False))[component]:
                        first = first_row[name] + component * len(surface.index)
                        share = surface.weight * motion[component][surface.index]
                        row[first : first + len(surface.index)] -= share
    return sums


def _distance(
    cloud: Cloud,
    held: Mapping[str, tuple[bool, bool]],
    held_nodes: Sequence[tuple[int, int]],
    springs: Collection[str],
) -> FloatArray:
    """Distance (n,) of every node from the held ones, along the edges of the triangles."""
    anchored = [*(name for name, components in held.items() if any(components)), *springs]
    start = [cloud.surfaces[name].index for name in anchored]
    start.append(np.array([node for node, _ in held_nodes], dtype=np.int64))
    ends = np.stack([cloud.triangles, np.roll(cloud.triangles, 1, axis=1)], axis=-1).reshape(-1, 2)
    lengths = np.linalg.norm(cloud.points[ends[:, 0]] - cloud.points[ends[:, 1]], axis=1)
    count = len(cloud.points)
    graph = sparse.csr_array((lengths, (ends[:, 0], ends[:, 1])), shape=(count, count))
    nodes = np.unique(np.concatenate(start))
    if not len(nodes):
        nodes = cloud.boundary_nodes[:1]
    found = dijkstra(graph, directed=False, indices=nodes, min_only=True)
    distance: FloatArray = np.asarray(found, dtype=np.float64)
    reached = np.isfinite(distance)
    distance[~reached] = distance[reached].max()
    return distance
