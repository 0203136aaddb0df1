"""Division of a cloud into connected pieces of about equally many nodes.

By recursive bisection across the longer axis of inertia (Simon 1991, doi:10.1016/0956-0521(91)90014-V), all
parts of one level at a time; then parts that are not connected by the triangles are split. The pieces of a
cloud with a mirror are their own images or each other's.
"""

from __future__ import annotations

from collections.abc import Collection

import numpy as np
import scipy.sparse as sparse

from mlsanm_cli.arrays import BoolArray, FloatArray, IntArray
from mlsanm_cli.cloud.cloud import Cloud
from mlsanm_cli.cloud.search import nearest
from mlsanm_cli.startup import cKDTree, connected_components

WIDTH_PER_DEPTH = 1.0
"""Largest width of a piece over its depth inside the body: force and bending are lost in thin parts, and
large pieces inside suffice and cost less. With 0.7 to 1.5 errors are the same."""
MAX_NODES = 400.0
"""Nodes of the largest pieces."""
WIDTH_AT_HOLLOWS, MIN_NODES = 0.4, 2.0
"""Largest width of a piece over the distance to a hollow plus its radius, and least number of its nodes:
portal frames with fillets of two spacings lost 1 to 6 % with pieces of 8 to 24 nodes, depending on their
division, and lose up to 1.3 % now. A hole in a mesh of triangles 1.6 times as deep as wide, with 64 nodes
around it, lost up to 6 % of its peak stress at degree 2 and 17 % at degree 4 with 0.7, and 2.4 and 6.6 % with
0.4."""
PAIR_CLEARANCE = 3.5
"""Distance of pairs from supports and corners, in spacings."""
TIE_TOLERANCE = 1e-9
"""Relative difference below which moments of inertia and distances are equal."""
MIN_SHARE = 0.25
"""Pieces with less than this part of the requested size are joined to a neighbour."""


def divide(cloud: Cloud, size: int) -> IntArray:
    """Numbers (n,) of the pieces of about ``size`` nodes that the cloud's nodes belong to."""
    # A node at the root of a narrow slit may be a corner of no triangle, and is a piece of no area by itself.
    alone = np.bincount(cloud.triangles.ravel(), minlength=len(cloud.points)) == 0
    along = cloud.edges[alone[cloud.edges].any(axis=1)]
    pairs = np.concatenate([along, *(cloud.triangles[:, [i, j]] for i, j in ((0, 1), (1, 2), (2, 0)))])
    mirror = cloud.mirror
    depth = nearest(cKDTree(cloud.points[cloud.boundary_nodes]), cloud.points)[0] / cloud.spacing
    wanted = np.clip((WIDTH_PER_DEPTH * depth) ** 2, size, MAX_NODES)
    wanted = np.minimum(wanted, np.maximum((WIDTH_AT_HOLLOWS * cloud.room / cloud.spacing) ** 2, MIN_NODES))
    if mirror is None:
        return _divided(cloud.points, pairs, wanted)
    place = np.full(len(cloud.points), -1, dtype=np.int64)
    place[mirror.own] = np.arange(len(mirror.own))
    own = _divided(
        cloud.points[mirror.own], place[pairs][(place[pairs] >= 0).all(axis=1)], wanted[mirror.own]
    )
    labels = own[mirror.place]
    # What touches the mirror, or reaches across it, is one piece with its image.
    touching = np.zeros(own.max() + 1, dtype=bool)
    touching[labels[mirror.side == 0]] = True
    touching[labels[pairs[mirror.side[pairs].prod(axis=1) < 0]]] = True
    beyond = (mirror.side < 0) & ~touching[labels]
    labels[beyond] += own.max() + 1
    return _counted(labels)


def pair_up(cloud: Cloud, touching: Collection[str], held: Collection[str]) -> IntArray:
    """Numbers (n,) of pairs of neighbours along the surfaces ``touching`` others, -1 for all other nodes.

    Nodes near ``held`` surfaces and corners are in none: there pairs spoil the equilibrium of a support.
    """
    surfaces = cloud.surfaces
    ends = [s.index[[0, -1]] for s in surfaces.values() if not s.curve.closed]
    stops = np.unique(
        np.concatenate([np.zeros(0, dtype=np.int64), *ends, *(surfaces[h].index for h in held)])
    )
    far = np.ones(len(cloud.points), dtype=bool)
    if len(stops):
        far = nearest(cKDTree(cloud.points[stops]), cloud.points)[0] > PAIR_CLEARANCE * cloud.spacing
    mirror, labels, count = cloud.mirror, np.full(len(cloud.points), -1, dtype=np.int64), 0
    for name in sorted(touching):
        for run in _runs(surfaces[name].index, far):
            if mirror is not None:
                # One side after the other: images of pairs are pairs.
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


def _runs(index: IntArray, far: BoolArray) -> list[IntArray]:
    """Stretches of a surface's nodes ``index`` (b,) that are ``far`` (n,) from what must be left out."""
    cuts = np.flatnonzero(~far[index])
    return [run[far[run]] for run in np.split(index, cuts)]


def _divided(points: FloatArray, pairs: IntArray, wanted: FloatArray) -> IntArray:
    return _joined(_connected(_bisected(points, wanted), pairs), pairs, MIN_SHARE * wanted)


def _bisected(points: FloatArray, wanted: FloatArray) -> IntArray:
    """Numbers (n,) of parts of the ``points`` (n, 2), of about as many as is ``wanted`` (n,) by the one of
    its points that wants fewest."""
    labels, order = np.zeros(len(points), dtype=np.int64), np.arange(len(points))
    while True:
        count = np.bincount(labels)
        first = np.cumsum(count) - count
        # The points are in the order of their parts, as these are what they were cut into.
        parts = np.round(count / np.minimum.reduceat(wanted[order], first))
        chosen = parts[labels] >= 2.0
        if not chosen.any():
            return labels
        order = np.lexsort((_along(points, labels, count), labels))
        rank = np.empty(len(points), dtype=np.int64)
        rank[order] = np.arange(len(points)) - np.repeat(first, count)
        cut = np.round(count * (parts // 2) / np.maximum(parts, 1.0))
        late: BoolArray = chosen & (rank >= cut[labels])
        labels = _counted(2 * labels + late)


def _counted(labels: IntArray) -> IntArray:
    """The same numbers (n,) without those that nothing has."""
    return np.asarray((np.cumsum(np.bincount(labels) > 0) - 1)[labels], dtype=np.int64)


def _least(values: FloatArray, labels: IntArray, count: int) -> FloatArray:
    """The least of the ``values`` (n,) in each of ``count`` parts."""
    least = np.full(count, np.inf)
    np.minimum.at(least, labels, values)
    return least


def _along(points: FloatArray, labels: IntArray, count: IntArray) -> FloatArray:
    """Distance (n,) of every point from the middle of its part along the part's longer axis of inertia."""
    middle = np.stack([np.bincount(labels, one) for one in points.T], axis=1) / count[:, None]
    x, y = (points - middle[labels]).T
    xx, yy, xy = (np.bincount(labels, one) for one in (x * x, y * y, x * y))
    # Of regular meshes neither squares may be cut by round-off, nor may it choose among equally far nodes.
    least = TIE_TOLERANCE * (xx + yy)
    across, twice = (np.where(np.abs(one) > least, one, 0.0) for one in (xx - yy, 2.0 * xy))
    angle = 0.5 * np.arctan2(twice, across)
    along = np.cos(angle)[labels] * x + np.sin(angle)[labels] * y
    return np.asarray(np.round(along / (TIE_TOLERANCE * float(np.ptp(points, axis=0).max()))))


def _connected(labels: IntArray, pairs: IntArray) -> IntArray:
    """The same with parts split that the ``pairs`` (e, 2) of neighbours do not connect."""
    within = pairs[labels[pairs[:, 0]] == labels[pairs[:, 1]]]
    shape = (len(labels), len(labels))
    graph = sparse.coo_array((np.ones(len(within), dtype=np.int8), (within[:, 0], within[:, 1])), shape=shape)
    return np.asarray(connected_components(sparse.csr_array(graph), directed=False)[1], dtype=np.int64)


def _joined(labels: IntArray, pairs: IntArray, few: FloatArray) -> IntArray:
    """The same with parts of fewer points than the ``few`` (n,) of any of them joined to the neighbour they
    have most edges to."""
    while True:
        count = np.bincount(labels)
        small = count < _least(few, labels, len(count))
        one, other = labels[np.concatenate([pairs, pairs[:, ::-1]])].T
        adjacent = (one != other) & small[one]
        if not adjacent.any():
            return labels
        key, times = np.unique(one[adjacent] * len(count) + other[adjacent], return_counts=True)
        part, neighbour = key // len(count), key % len(count)
        order = np.lexsort((-times, part))
        first = order[np.unique(part[order], return_index=True)[1]]
        to = np.arange(len(count))
        # One at a time where two small ones would join each other.
        for at in first:
            if to[neighbour[at]] == neighbour[at]:
                to[part[at]] = neighbour[at]
        labels = _counted(to[labels])
