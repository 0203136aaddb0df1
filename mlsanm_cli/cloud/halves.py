"""Half of a mirror-symmetric body: nodes are placed there, the others are their images."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from scipy.spatial import cKDTree

from mlsanm_cli.arrays import FloatArray, IntArray
from mlsanm_cli.cloud.curves import Segment
from mlsanm_cli.cloud.mirror import Mirror, SymmetryLine
from mlsanm_cli.cloud.search import nearest
from mlsanm_cli.cloud.spacing import Spacing

SNAP_DISTANCE = 0.3
"""Nodes closer to the line than this fraction of the spacing are moved onto it."""
HOLE_RADIUS = 0.85
"""A point of the line farther than this many spacings from all nodes gets a node."""
HOLE_STEP = 0.1
"""Step of the search for such points, in spacings."""


def with_line_nodes(
    line: SymmetryLine, boundary: FloatArray, cuts: FloatArray, inner: FloatArray, spacing: Spacing
) -> tuple[FloatArray, int]:
    """Interior nodes ``inner`` (n, 2) of the half of a body with ``boundary`` nodes (b, 2), with holes along
    the ``cuts`` (k, 2, 2) filled, those on the ``line`` first, and the number of the latter."""
    inner = inner.copy()
    upon = np.abs(inner[:, line.axis] - line.at) < SNAP_DISTANCE * spacing.at(inner)
    inner[upon, line.axis] = line.at
    tree = cKDTree(np.concatenate([boundary, inner]))
    filled = [node for cut in cuts for node in _fillings(cut, tree, spacing)]
    added = np.array(filled).reshape(-1, 2)
    return np.concatenate([inner[upon], added, inner[~upon]]), int(upon.sum()) + len(added)


def halved(
    line: SymmetryLine, boundary: FloatArray, edges: IntArray, spacing: Spacing
) -> tuple[Mirror, FloatArray, FloatArray] | None:
    """Symmetry of ``boundary`` nodes (b, 2) joined by ``edges`` (e, 2), chords (c, 4) of the closed outline
    of the half on the positive side, and its cuts (k, 2, 2) along the ``line``, the last of the chords. None
    if the nodes are not mirror-symmetric, or if the line runs along the boundary."""
    image = line.images(boundary, spacing.at(boundary))
    if image is None:
        return None
    own = np.arange(len(boundary)) == image
    side = np.where(own, 0, np.sign(boundary[:, line.axis] - line.at)).astype(np.int64)
    ends = side[edges]
    if (ends == 0).all(axis=1).any():
        return None
    crossing = ends.prod(axis=1) < 0
    if not np.array_equal(image[edges[crossing, 0]], edges[crossing, 1]):
        return None
    points = boundary[edges]
    middle = points.mean(axis=1)
    middle[:, line.axis] = line.at
    adjacent = (ends.sum(axis=1) > 0) | crossing
    outside = ends[:, :, None] < 0
    chords = np.where(outside, middle[:, None], points)[adjacent]
    along = 1 - line.axis
    crossed = np.sort(np.concatenate([boundary[own, along], middle[crossing, along]]))
    if len(crossed) % 2:
        return None
    cuts = np.full((len(crossed) // 2, 2, 2), line.at)
    cuts[:, :, along] = crossed.reshape(-1, 2)
    chords = np.concatenate([chords, cuts]).reshape(-1, 4)
    return Mirror(line, image, side), chords, cuts


def _fillings(cut: FloatArray, tree: cKDTree, spacing: Spacing) -> Iterator[FloatArray]:
    """Nodes (2,) that fill the holes along a ``cut`` (2, 2) through the body, in ascending order."""
    segment = Segment((float(cut[0, 0]), float(cut[0, 1])), (float(cut[1, 0]), float(cut[1, 1])))
    steps = spacing.steps_along(segment)
    fine = np.interp(np.arange(0.0, len(steps) - 1.0, HOLE_STEP), np.arange(len(steps)), steps)
    places = segment.points(fine)
    sizes, last = spacing.at(places), -np.inf
    for k in np.flatnonzero(nearest(tree, places)[0] > HOLE_RADIUS * sizes):
        if fine[k] - last >= sizes[k]:
            last = fine[k]
            yield places[k]
