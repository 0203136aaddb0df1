"""Corners where a fully held surface meets a free one: the stress is singular there.

Least squares in the strong form asks for second derivatives that are not square-integrable there; left
alone, it would prefer a smooth wrong solution and lose force on the way to the clamped side. So rows are
weighted by a power of the distance to the nearest such corner, in the manner of the weighted norms of Cox and
Fix (Computers & Mathematics with Applications 10, 1984) and of Lee, Manteuffel and Westphal (SIAM Journal on
Numerical Analysis 44, 2006). What is lost all the same shows in the force balance of every run.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from scipy.spatial import cKDTree

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.cloud.cloud import Cloud

POWER = 1.5
"""Corner displacements behave like distance^0.7, whose weighted second derivatives are integrable above 0.3.

Measured on a clamped beam of 8 x 1, degree 2: with spacing 0.05 the tip moves 0.16 of what it should without
weights, 0.82 with power 1, 0.93 with 1.5; at 2 the stress at the clamped side becomes useless.
"""

CLOSEST = 0.5
"""Distances are never taken below this part of the node spacing."""


def corner_weight(cloud: Cloud, held: Mapping[str, tuple[bool, bool]]) -> FloatArray:
    """Factor (n,) on the equilibrium and traction rows of every node: (distance / largest distance)^POWER."""
    corners = [
        np.intersect1d(one.index, other.index)
        for name, one in cloud.surfaces.items()
        for other_name, other in cloud.surfaces.items()
        if all(held.get(name, (False, False))) and not any(held.get(other_name, (False, False)))
    ]
    nodes = np.unique(np.concatenate([np.zeros(0, dtype=np.int64), *corners]))
    if not len(nodes):
        return np.ones(len(cloud.points))
    distance = np.maximum(cKDTree(cloud.points[nodes]).query(cloud.points)[0], CLOSEST * cloud.spacing)
    factor: FloatArray = (distance / distance.max()) ** POWER
    return factor
