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

from collections.abc import Mapping, Sequence
from types import MappingProxyType

import numpy as np
import scipy.sparse as sparse

from mlsanm_cli.arrays import FloatArray, IntArray
from mlsanm_cli.cloud.cloud import Cloud
from mlsanm_cli.mechanics.springs import FREE, Held, Springs, gripped, soft

CUTS = 8
"""Cuts through a body; 4 to 16 gave the same."""


def force_sums(
    cloud: Cloud,
    held: Held,
    held_nodes: Sequence[tuple[int, int]],
    first_row: Mapping[str, int],
    rows: int,
    springs: Springs = MappingProxyType({}),
    limit: float = np.inf,
) -> FloatArray:
    """Factors (3 CUTS, r) by which the body's rows add up to force x, y and moment beyond every cut.

    ``first_row`` and ``rows`` (r) are those of the body. A cut is a ramp from 0 to 1 of the distance from
    what is held, along the triangles of the nodes; on the held surfaces all ramps are 0, so that no reaction
    counts. Through a body that nothing holds the cuts go straight, half of them along either axis.
    ``springs`` beyond the ``limit`` count as holding; the others where nothing else holds.
    """
    grips = gripped(held, springs, limit)
    single = np.unique([node for node, _ in held_nodes]).astype(np.int64)
    start = [cloud.surfaces[name].index for name, components in grips.items() if any(components)]
    if not start and not len(single):
        start = [cloud.surfaces[name].index for name in springs]
    if start or len(single):
        distance = _distance(cloud, np.concatenate([single, *start]))
        length = float(distance.max())
        ramps = [np.clip(distance * CUTS / length - cut, 0.0, 1.0) for cut in range(CUTS)]
    else:
        length = float(np.ptp(cloud.points, axis=0).max())
        ramps = [ramp for coordinate in cloud.points.T for ramp in _straight(coordinate)]
    arm = (cloud.points - cloud.points.mean(axis=0)) / length
    sums = [_sum(cloud, held, first_row, rows, motion) for ramp in ramps for motion in _motions(ramp, arm)]
    return np.array(sums)


def _straight(coordinate: FloatArray) -> list[FloatArray]:
    """Ramps from -1 to 1 along a ``coordinate`` (n,) of the nodes: its mirror image has the same."""
    low, size = float(coordinate.min()), float(np.ptp(coordinate))
    parts = CUTS // 2
    return [2.0 * np.clip((coordinate - low) * parts / size - cut, 0.0, 1.0) - 1.0 for cut in range(parts)]


def spring_sums(
    cloud: Cloud,
    held: Held,
    held_nodes: Sequence[tuple[int, int]],
    first_row: Mapping[str, int],
    rows: int,
    springs: Springs,
    limit: float,
) -> FloatArray:
    """Factors (s, r) by which the rows add up to the whole force x, y and moment, where only ``springs`` up
    to the ``limit`` resist that.

    What the springs pull must then be what the other forces leave; the divergence of the stress adds nothing.
    """
    grips, giving = gripped(held, springs, limit), soft(springs, limit)
    resisted = [
        any(components[axis] for components in grips.values()) or any(c == axis for _, c in held_nodes)
        for axis in (0, 1)
    ]
    sprung = [any(k[axis] for k in giving.values()) and not resisted[axis] for axis in (0, 1)]
    carried = (*sprung, bool(giving) and not any(resisted))
    arm = cloud.points - cloud.points.mean(axis=0)
    whole = _motions(np.ones(len(arm)), arm / np.ptp(arm, axis=0).max())
    return np.array(
        [_sum(cloud, held, first_row, rows, whole[motion]) for motion in np.flatnonzero(carried)]
    ).reshape(-1, rows)


def _motions(ramp: FloatArray, arm: FloatArray) -> tuple[tuple[FloatArray, FloatArray], ...]:
    """Shift in x, shift in y and rotation, as (x, y) of the nodes."""
    zero = np.zeros_like(ramp)
    return (ramp, zero), (zero, ramp), (-arm[:, 1] * ramp, arm[:, 0] * ramp)


def _sum(
    cloud: Cloud,
    held: Held,
    first_row: Mapping[str, int],
    rows: int,
    motion: tuple[FloatArray, FloatArray],
) -> FloatArray:
    """What the rows leave along a ``motion`` of the nodes: equilibrium inside less tractions outside."""
    count = len(cloud.points)
    row = np.zeros(rows)
    for component in (0, 1):
        row[component * count : (component + 1) * count] = cloud.areas * motion[component]
        for name, surface in cloud.surfaces.items():
            if not held.get(name, FREE)[component]:
                first = first_row[name] + component * len(surface.index)
                share = surface.weight * motion[component][surface.index]
                row[first : first + len(surface.index)] -= share
    return row


def _distance(cloud: Cloud, nodes: IntArray) -> FloatArray:
    """Distance (n,) of every node from ``nodes`` (s,), along the edges of the triangles."""
    ends = np.stack([cloud.triangles, np.roll(cloud.triangles, 1, axis=1)], axis=-1).reshape(-1, 2)
    lengths = np.linalg.norm(cloud.points[ends[:, 0]] - cloud.points[ends[:, 1]], axis=1)
    count = len(cloud.points)
    graph = sparse.csr_array((lengths, (ends[:, 0], ends[:, 1])), shape=(count, count))
    # Only bodies whose force sums are cut need it.
    from mlsanm_cli.parts import dijkstra

    found = dijkstra(graph, directed=False, indices=np.unique(nodes), min_only=True)
    distance: FloatArray = np.asarray(found, dtype=np.float64)
    reached = np.isfinite(distance)
    distance[~reached] = distance[reached].max()
    return distance
