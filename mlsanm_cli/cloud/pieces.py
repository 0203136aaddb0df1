"""Division of a cloud into connected pieces of about equally many nodes, by recursive bisection across the
longer principal axis of inertia (Simon 1991, doi:10.1016/0956-0521(91)90014-V). The pieces of a cloud with a
mirror are symmetric or images of each other."""

from __future__ import annotations

from collections.abc import Collection

import numpy as np
import scipy.sparse as sparse
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from mlsanm_cli.arrays import BoolArray, FloatArray, IntArray
from mlsanm_cli.cloud.cloud import Cloud, nearest, radius_of
from mlsanm_cli.roundoff import ROUND_OFF

MAX_NODES = 400.0
"""Largest number of nodes of a piece."""
WIDTH_OVER_ROOM, MIN_NODES = 0.4, 2.0
"""Largest width of a piece over the distance to a hollow plus its radius, and its least number of nodes."""
CLEARANCE = 3.5
"""Distance of pairs from supports and corners, in spacings."""
MERGE_FRACTION = 0.25
"""Pieces below this fraction of the wanted size are merged with a neighbour."""


def divide(cloud: Cloud, size: int) -> IntArray:
    """Piece numbers (n,) of the cloud's nodes, for pieces of about ``size`` nodes."""
    # A node at the root of a narrow slit may be in no triangle; by itself it would be a piece of no area.
    alone = np.bincount(cloud.triangles.ravel(), minlength=len(cloud.points)) == 0
    along = cloud.edges[alone[cloud.edges].any(axis=1)]
    pairs = np.concatenate([along, *(cloud.triangles[:, [i, j]] for i, j in ((0, 1), (1, 2), (2, 0)))])
    mirror = cloud.mirror
    depth = nearest(cKDTree(cloud.points[cloud.boundary_nodes]), cloud.points)[0] / cloud.spacing
    # In thin bodies large pieces lose force and bending stiffness, deep inside they are as accurate.
    wanted = np.clip(depth**2, size, MAX_NODES)
    wanted = np.minimum(wanted, np.maximum((WIDTH_OVER_ROOM * cloud.room / cloud.spacing) ** 2, MIN_NODES))
    if mirror is None:
        return _divided(cloud.points, pairs, wanted)
    beside = pairs[(mirror.side[pairs] >= 0).all(axis=1)]
    own = _divided(cloud.points[mirror.own], mirror.place[beside], wanted[mirror.own])
    labels = own[mirror.place]
    # A piece that touches the line, or has edges across it, is merged with its image.
    touching = np.zeros(own.max() + 1, dtype=bool)
    touching[labels[mirror.side == 0]] = True
    touching[labels[pairs[mirror.side[pairs].prod(axis=1) < 0]]] = True
    beyond = (mirror.side < 0) & ~touching[labels]
    labels[beyond] += own.max() + 1
    return _counted(labels)


def pair_up(cloud: Cloud, touching: Collection[str], held: Collection[str]) -> IntArray:
    """Pair numbers (n,) of neighbours along the contact surfaces ``touching``, -1 for all other nodes. Nodes
    near ``held`` surfaces and corners stay single: pairs there spoil the equilibrium of a support."""
    surfaces = cloud.surfaces
    ends = [s.index[[0, -1]] for s in surfaces.values() if not s.curve.closed]
    ends += [surfaces[name].index for name in held]
    stops = np.unique(np.concatenate([np.zeros(0, dtype=np.int64), *ends]))
    if cloud.revolved:
        # The body continues behind the axis.
        stops = stops[radius_of(cloud.points[stops], cloud.points) > 0.0]
    far = np.ones(len(cloud.points), dtype=bool)
    if len(stops):
        far = nearest(cKDTree(cloud.points[stops]), cloud.points)[0] > CLEARANCE * cloud.spacing
    mirror, labels, count = cloud.mirror, np.full(len(cloud.points), -1, dtype=np.int64), 0
    for name in sorted(touching):
        index = surfaces[name].index
        for run in np.split(index, np.flatnonzero(~far[index])):
            run = run[far[run]]
            if mirror is not None:
                # One side at a time: images of pairs are pairs.
                run = run[mirror.side[run] > 0]
            pairs = len(run) // 2
            labels[run[: 2 * pairs]] = count + np.repeat(np.arange(pairs), 2)
            count += pairs
    if mirror is not None:
        beyond = np.flatnonzero((mirror.side < 0) & (labels[mirror.image] >= 0))
        labels[beyond] = count + labels[mirror.image[beyond]]
    used, found = np.unique(labels[labels >= 0], return_inverse=True)
    labels[labels >= 0] = found if len(used) else -1
    return labels


def _divided(points: FloatArray, pairs: IntArray, wanted: FloatArray) -> IntArray:
    """Piece numbers (n,) of connected ``points`` (n, 2); a piece has about the smallest ``wanted`` (n,) in
    it; ``pairs`` (e, 2) are neighbours."""
    labels, order = np.zeros(len(points), dtype=np.int64), np.arange(len(points))
    while True:
        count = np.bincount(labels)
        first = np.cumsum(count) - count
        # ``order`` sorts the points by part: each bisection keeps parts contiguous.
        parts = np.round(count / np.minimum.reduceat(wanted[order], first))
        chosen = parts[labels] >= 2.0
        if not chosen.any():
            break
        order = np.lexsort((_along(points, labels, count), labels))
        rank = np.empty(len(points), dtype=np.int64)
        rank[order] = np.arange(len(points)) - np.repeat(first, count)
        cut = np.round(count * (parts // 2) / np.maximum(parts, 1.0))
        late: BoolArray = chosen & (rank >= cut[labels])
        labels = _counted(2 * labels + late)
    within = pairs[labels[pairs[:, 0]] == labels[pairs[:, 1]]]
    linked = np.ones(len(within), dtype=np.int8), (within[:, 0], within[:, 1])
    graph = sparse.csr_array(sparse.coo_array(linked, shape=(len(labels), len(labels))))
    labels = np.asarray(connected_components(graph, directed=False)[1], dtype=np.int64)
    return _joined(labels, pairs, MERGE_FRACTION * wanted)


def _counted(labels: IntArray) -> IntArray:
    """Renumber ``labels`` (n,) without gaps."""
    return np.asarray((np.cumsum(np.bincount(labels) > 0) - 1)[labels], dtype=np.int64)


def _along(points: FloatArray, labels: IntArray, count: IntArray) -> FloatArray:
    """Coordinate (n,) of every point along the longer principal axis of its part."""
    middle = np.stack([np.bincount(labels, one) for one in points.T], axis=1) / count[:, None]
    x, y = (points - middle[labels]).T
    xx, yy, xy = (np.bincount(labels, one) for one in (x * x, y * y, x * y))
    # Round-off must not choose the axis of a square part of a regular mesh, nor among equally distant nodes.
    least = ROUND_OFF * (xx + yy)
    across, twice = (np.where(np.abs(one) > least, one, 0.0) for one in (xx - yy, 2.0 * xy))
    angle = 0.5 * np.arctan2(twice, across)
    along = np.cos(angle)[labels] * x + np.sin(angle)[labels] * y
    return np.asarray(np.round(along / (ROUND_OFF * float(np.ptp(points, axis=0).max()))))


def _joined(labels: IntArray, pairs: IntArray, few: FloatArray) -> IntArray:
    """Merge parts of fewer points than the smallest ``few`` (n,) in them with the neighbour they share most
    edges with."""
    while True:
        count = np.bincount(labels)
        least = np.full(len(count), np.inf)
        np.minimum.at(least, labels, few)
        small = count < least
        one, other = labels[np.concatenate([pairs, pairs[:, ::-1]])].T
        adjacent = (one != other) & small[one]
        if not adjacent.any():
            return labels
        key, times = np.unique(one[adjacent] * len(count) + other[adjacent], return_counts=True)
        part, neighbour = key // len(count), key % len(count)
        order = np.lexsort((-times, part))
        first = order[np.unique(part[order], return_index=True)[1]]
        to = np.arange(len(count))
        # If two small parts would merge into each other, only one does.
        for at in first:
            if to[neighbour[at]] == neighbour[at]:
                to[part[at]] = neighbour[at]
        labels = _counted(to[labels])
