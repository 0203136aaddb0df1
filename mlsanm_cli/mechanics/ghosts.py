"""Ghost nodes outside the boundary nodes, so that a square scheme can impose equilibrium there too.

Clamped nodes need none, and ghosts next to them are harmful: where a fine zone lies on a clamped surface, a
mode of ghost displacements arises that hardly any equation controls.
"""

from __future__ import annotations

from collections.abc import Collection

import numpy as np

from mlsanm_cli.arrays import FloatArray, IntArray
from mlsanm_cli.cloud.cloud import Cloud
from mlsanm_cli.errors import NumericalError
from mlsanm_cli.startup import cKDTree

MIN_DISTANCE = 0.3
"""Least distance of ghosts from other nodes, in spacings."""


def ghost_owners(cloud: Cloud, clamped: Collection[str]) -> IntArray:
    """Boundary nodes (g,) with a ghost: those on no ``clamped`` surface."""
    held = [cloud.surfaces[name].index for name in clamped]
    return np.setdiff1d(cloud.boundary_nodes, np.concatenate([np.zeros(0, dtype=np.int64), *held]))


def ghost_points(cloud: Cloud, owners: IntArray) -> FloatArray:
    """Ghosts (g, 2) of the nodes ``owners`` (g,), one spacing away along the sum of their normals.

    Raises NumericalError if there is no room for them, as in a notch or next to a thin slit.
    """
    outward = np.zeros_like(cloud.points)
    for surface in cloud.surfaces.values():
        np.add.at(outward, surface.index, surface.normal)
    direction = outward[owners] / np.linalg.norm(outward[owners], axis=1, keepdims=True)
    spacing = cloud.spacing[owners]
    ghosts: FloatArray = cloud.points[owners] + spacing[:, None] * direction
    everything = np.concatenate([cloud.points, ghosts])
    if not len(ghosts):
        return ghosts
    distance = np.asarray(cKDTree(everything).query(ghosts, k=2)[0])[:, 1] / spacing
    worst = int(np.argmin(distance))
    if distance[worst] < MIN_DISTANCE:
        x, y = cloud.points[owners[worst]]
        raise NumericalError(
            f"there is no room for the ghost node outside ({x:.6g}, {y:.6g}): another node is only "
            f"{distance[worst]:.2g} spacings away from it",
            'make the spacing smaller there, or use mls.scheme = "least-squares"',
        )
    return ghosts
