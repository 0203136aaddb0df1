"""Figures that show whether a cloud is fit for use."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mlsanm_cli.cloud.cloud import Cloud
from mlsanm_cli.cloud.search import nearest
from mlsanm_cli.startup import cKDTree

BLOCK_SIZE = 256
"""Triangles that are examined together, the largest first."""


@dataclass(frozen=True)
class CloudQuality:
    """``closest``: smallest node distance over the local spacing; ``hole``: radius of the largest empty
    circle inside over the local spacing; ``growth``: largest change of spacing per unit distance between
    neighbours."""

    nodes: int
    boundary_nodes: int
    closest: float
    hole: float
    growth: float


def measure(cloud: Cloud) -> CloudQuality:
    """Quality figures of a cloud."""
    return CloudQuality(
        nodes=len(cloud.points),
        boundary_nodes=len(cloud.boundary_nodes),
        closest=cloud.separation.closest,
        hole=_largest_hole(cloud),
        growth=cloud.separation.growth,
    )


def _largest_hole(cloud: Cloud) -> float:
    """Largest distance from the centre of a triangle inside the body to the nearest node, over the
    spacing."""
    corners = cloud.points[cloud.triangles]
    a, b, c = corners[:, 0], corners[:, 1], corners[:, 2]
    ab, ac = b - a, c - a
    twice = 2.0 * (ab[:, 0] * ac[:, 1] - ab[:, 1] * ac[:, 0])
    ab2, ac2 = (ab**2).sum(axis=1), (ac**2).sum(axis=1)
    x = (ac[:, 1] * ab2 - ab[:, 1] * ac2) / twice
    y = (ab[:, 0] * ac2 - ac[:, 0] * ab2) / twice
    center, radius = a + np.stack([x, y], axis=1), np.hypot(x, y)
    # Flat triangles along the outline have their centres outside: they are no holes. A centre counts as
    # inside where the nearest boundary node does not see it in front of its surface.
    normals = np.zeros_like(cloud.points)
    for surface in cloud.surfaces.values():
        normals[surface.index] += surface.normal
    boundary = cloud.boundary_nodes
    outline = cKDTree(cloud.points[boundary])
    # The nearest node of a centre is a corner: no triangle comes out larger than by its finest one.
    most = radius / cloud.spacing[cloud.triangles].min(axis=1)
    largest, order = 0.0, np.argsort(-most)
    for some in np.split(order, range(BLOCK_SIZE, len(order), BLOCK_SIZE)):
        near = boundary[nearest(outline, center[some])[1]]
        inside = ((center[some] - cloud.points[near]) * normals[near]).sum(axis=1) < 0.0
        # Opened slits are not Delaunay: nodes may lie within circumcircles.
        away, node = nearest(cloud.tree, center[some])
        largest = float((away / cloud.spacing[node])[inside].max(initial=largest))
        if largest >= most[some[-1]]:
            break
    return largest
