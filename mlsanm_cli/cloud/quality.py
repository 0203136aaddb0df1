"""Quality figures of a cloud."""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from mlsanm_cli.cloud.cloud import Cloud
from mlsanm_cli.cloud.membership import cross
from mlsanm_cli.cloud.search import nearest

BATCH_SIZE = 256
"""Triangles processed at once, largest first."""


def measure(cloud: Cloud) -> dict[str, float]:
    """Quality figures of a cloud: numbers of ``nodes`` and ``boundary_nodes``; over the local spacing the
    ``closest`` distance of two nodes and the radius of the largest ``hole``, an empty circle; ``growth``, the
    largest spacing difference of neighbours over their distance."""
    corners = cloud.points[cloud.triangles]
    a, b, c = corners[:, 0], corners[:, 1], corners[:, 2]
    ab, ac = b - a, c - a
    twice = 2.0 * cross(ab, ac)
    ab2, ac2 = (ab**2).sum(axis=1), (ac**2).sum(axis=1)
    x = (ac[:, 1] * ab2 - ab[:, 1] * ac2) / twice
    y = (ab[:, 0] * ac2 - ac[:, 0] * ab2) / twice
    center, radius = a + np.stack([x, y], axis=1), np.hypot(x, y)
    # Flat triangles along the outline have their centres outside. A centre is inside if it lies behind the
    # tangent at the nearest boundary node.
    normals = np.zeros_like(cloud.points)
    for surface in cloud.surfaces.values():
        normals[surface.index] += surface.normal
    boundary = cloud.boundary_nodes
    outline = cKDTree(cloud.points[boundary])
    # Upper bounds: the nearest node of a circumcentre is a corner of the triangle.
    most = radius / cloud.spacing[cloud.triangles].min(axis=1)
    largest, order = 0.0, np.argsort(-most)
    for some in np.split(order, range(BATCH_SIZE, len(order), BATCH_SIZE)):
        near = boundary[nearest(outline, center[some])[1]]
        inside = ((center[some] - cloud.points[near]) * normals[near]).sum(axis=1) < 0.0
        # Opened slits are not Delaunay: nodes may lie within circumcircles.
        away, node = nearest(cloud.tree, center[some])
        largest = float((away / cloud.spacing[node])[inside].max(initial=largest))
        if largest >= most[some[-1]]:
            break
    closest, growth = cloud.separation
    counts = {"nodes": len(cloud.points), "boundary_nodes": len(cloud.boundary_nodes)}
    return counts | {"closest": float(closest.min()), "hole": largest, "growth": growth}
