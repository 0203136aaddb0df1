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
from dataclasses import field

import numpy as np
import scipy.sparse as sparse

from mlsanm_cli.arrays import FloatArray, IntArray
from mlsanm_cli.cloud.cloud import Cloud
from mlsanm_cli.mechanics.springs import FREE, Held, Springs, gripped, soft
from mlsanm_cli.values import dataclass

CUTS = 8
"""Cuts through a body; 4 to 16 gave the same."""


@dataclass(frozen=True)
class ForceSums:
    """How the rows of a body add up to forces and moments.

    It has ``rows`` (r) rows, those of surfaces from ``first_row`` on. ``springs`` beyond the ``limit`` count
    as holding.
    """

    cloud: Cloud
    held: Held
    held_nodes: Sequence[tuple[int, int]]
    first_row: Mapping[str, int]
    rows: int
    springs: Springs = field(default_factory=dict)
    limit: float = np.inf

    def through_cuts(self) -> FloatArray:
        """Factors (3 CUTS, r) by which the rows add up to force x, y and moment beyond every cut.

        A cut is a ramp from 0 to 1 of the distance from what is held, along the triangles of the nodes; on
        the held surfaces all ramps are 0, so that no reaction counts. Where nothing else holds, springs do;
        through a body that nothing holds the cuts go straight, half of them along either axis.
        """
        cloud = self.cloud
        grips = gripped(self.held, self.springs, self.limit)
        single = np.unique([node for node, _ in self.held_nodes]).astype(np.int64)
        start = [cloud.surfaces[name].index for name, components in grips.items() if any(components)]
        if not start and not len(single):
            start = [cloud.surfaces[name].index for name in self.springs]
        if start or len(single):
            distance = _distance(cloud, np.concatenate([single, *start]))
            length = float(distance.max())
            ramps = [np.clip(distance * CUTS / length - cut, 0.0, 1.0) for cut in range(CUTS)]
        else:
            length = float(np.ptp(cloud.points, axis=0).max())
            ramps = [ramp for coordinate in cloud.points.T for ramp in _straight(coordinate)]
        arm = (cloud.points - cloud.points.mean(axis=0)) / length
        return np.array([self._along(motion) for ramp in ramps for motion in _motions(ramp, arm)])

    def of_springs(self) -> FloatArray:
        """Factors (s, r) by which the rows add up to the whole force x, y and moment, where only springs up
        to the limit resist that.

        What the springs pull must then be what the other forces leave; the divergence of the stress adds
        nothing.
        """
        grips, giving = gripped(self.held, self.springs, self.limit), soft(self.springs, self.limit)
        resisted = [
            any(components[axis] for components in grips.values())
            or any(c == axis for _, c in self.held_nodes)
            for axis in (0, 1)
        ]
        sprung = [any(k[axis] for k in giving.values()) and not resisted[axis] for axis in (0, 1)]
        carried = (*sprung, bool(giving) and not any(resisted))
        arm = self.cloud.points - self.cloud.points.mean(axis=0)
        whole = _motions(np.ones(len(arm)), arm / np.ptp(arm, axis=0).max())
        sums = [self._along(whole[motion]) for motion in np.flatnonzero(carried)]
        return np.array(sums).reshape(-1, self.rows)

    def _along(self, motion: tuple[FloatArray, FloatArray]) -> FloatArray:
        """What the rows leave along a ``motion`` of the nodes: equilibrium inside less tractions outside."""
        count = len(self.cloud.points)
        row = np.zeros(self.rows)
        for component in (0, 1):
            row[component * count : (component + 1) * count] = self.cloud.areas * motion[component]
            for name, surface in self.cloud.surfaces.items():
                if not self.held.get(name, FREE)[component]:
                    first = self.first_row[name] + component * len(surface.index)
                    share = surface.weight * motion[component][surface.index]
                    row[first : first + len(surface.index)] -= share
        return row


def _straight(coordinate: FloatArray) -> list[FloatArray]:
    """Ramps from -1 to 1 along a ``coordinate`` (n,) of the nodes: its mirror image has the same."""
    low, size = float(coordinate.min()), float(np.ptp(coordinate))
    parts = CUTS // 2
    return [2.0 * np.clip((coordinate - low) * parts / size - cut, 0.0, 1.0) - 1.0 for cut in range(parts)]


def _motions(ramp: FloatArray, arm: FloatArray) -> tuple[tuple[FloatArray, FloatArray], ...]:
    """Shift in x, shift in y and rotation, as (x, y) of the nodes."""
    zero = np.zeros_like(ramp)
    return (ramp, zero), (zero, ramp), (-arm[:, 1] * ramp, arm[:, 0] * ramp)


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
    mirror = cloud.mirror
    if mirror is None or not np.isin(mirror.image[nodes], nodes).all():
        return distance
    # Of what is its own mirror image: the triangles need not be.
    return np.minimum(distance, distance[mirror.image])
