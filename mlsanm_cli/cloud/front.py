"""Advancing front that fills a region with nodes, in time slices so that signals and limits are served, and
relaxation: nodes repel each other until their distances match the spacing.

A filled cloud is irregular where fronts meet, and every irregularity is noise in the compliance.
"""

from __future__ import annotations

import time

import numpy as np
from scipy.spatial import cKDTree

from mlsanm_cli.arrays import FloatArray, IntArray
from mlsanm_cli.cloud.curves import Segment
from mlsanm_cli.cloud.mirror import Mirror, SymmetryLine
from mlsanm_cli.cloud.search import nearest
from mlsanm_cli.cloud.spacing import Spacing
from mlsanm_cli.errors import RunError
from mlsanm_cli.kernels.fill import DONE, EMPTY, FULL_POINTS, FULL_TABLE, advance_front, spacing_at

CANDIDATES = 15
"""Directions in which the front grows from a node."""
STRIPS = 512
"""Horizontal strips into which the chords of a boundary are sorted."""
SLICE_SECONDS = 0.05
"""Target duration of a slice, s: the delay of Ctrl-C."""
FIRST_PARENTS = 500
"""Parent nodes processed in the first slice."""
WEYL = 0x9E3779B97F4A7C15
MODULUS = 2**64


def fill_region(
    boundary: FloatArray, edges: FloatArray, spacing: Spacing, seed: int, limit: int
) -> FloatArray:
    """Nodes (n, 2) inside the closed boundary of chords ``edges`` (e, 4): the boundary nodes (b, 2) first,
    then the interior ones. The result depends on ``seed``, not on the timing of slices. Raises RunError if
    there would be ``limit`` nodes or more."""
    far, zones, strips = spacing.far, spacing.table(), _strips(edges)
    count = len(boundary)
    room = 2 * count + 1024
    points, h = np.empty((room, 2)), np.empty(room)
    points[:count], h[:count] = boundary, spacing_at(far, zones, boundary)
    following = np.full(room, EMPTY, np.int64)
    keys, heads = np.full((2, 8192), EMPTY, np.int64)
    state = (seed * 2 + 1) * WEYL % MODULUS
    progress = np.array([count, 0, 0, 0, state - MODULUS if 2 * state >= MODULUS else state], np.int64)
    parents, stopped = FIRST_PARENTS, None
    while stopped != DONE:
        begun = time.monotonic()
        stopped = advance_front(
            *(points, h, following, keys, heads, progress, edges, *strips),
            *(far, zones, CANDIDATES, limit, parents),
        )
        if stopped == FULL_POINTS:
            points, h = np.concatenate([points, np.empty_like(points)]), np.append(h, np.empty_like(h))
            following = np.append(following, np.full(len(following), EMPTY, np.int64))
        elif stopped == FULL_TABLE:
            # Hash table too full for fast probing: continue with a larger one; all nodes are re-entered.
            keys, heads = np.full((2, 8 * int(progress[3] + progress[0] - progress[2])), EMPTY, np.int64)
            progress[2] = progress[3] = 0
        else:
            spent = time.monotonic() - begun
            wanted = parents * SLICE_SECONDS / max(spent, 1e-3 * SLICE_SECONDS)
            parents = int(np.clip(wanted, parents / 8, 2 * parents)) + 1
    if progress[0] >= limit:
        raise RunError(f"more than {limit} nodes in one body", "use larger spacings or smaller refinements")
    return points[: progress[0]].copy()


def _strips(edges: FloatArray) -> tuple[IntArray, IntArray, float, float]:
    """Edges (e, 4) sorted into horizontal strips: (start, edge numbers, lowest y, strip height)."""
    low, high = np.minimum(edges[:, 1], edges[:, 3]), np.maximum(edges[:, 1], edges[:, 3])
    bottom = float(low.min())
    height = float(high.max() - bottom) / STRIPS * (1.0 + 1e-12)
    first, last = (np.clip(((y - bottom) / height).astype(np.int64), 0, STRIPS - 1) for y in (low, high))
    count = np.where(low == high, 0, last - first + 1)
    number = np.repeat(np.arange(len(edges)), count)
    strip = np.repeat(first, count) + np.arange(len(number)) - np.repeat(np.cumsum(count) - count, count)
    order = np.argsort(strip, kind="stable")
    start = np.searchsorted(strip[order], np.arange(STRIPS + 1))
    return start.astype(np.int64), number[order].astype(np.int64), bottom, height


SWEEPS = 10
SEARCH_INTERVAL = 5
"""Neighbours are searched again every so many sweeps."""
NEIGHBORS = 9
DOUBLINGS = 2
"""The repulsion is (spacing / distance)^(2^DOUBLINGS) = (h/d)^4."""
STEP = 0.05
MAX_STEP = 0.2
"""Longest step, in spacings: a node must not pass its neighbours or leave the body."""


def relax(
    points: FloatArray, fixed: int, spacing: Spacing, line: SymmetryLine | None = None, upon: int = 0
) -> FloatArray:
    """Move all but the first ``fixed`` nodes of ``points`` (n, 2) a little.

    A neighbour at distance d repels with (h/d)^4, h the mean spacing of both: with the spacing of the node
    alone, nodes would leave refined surfaces. With a symmetry ``line``, ``upon`` nodes on it follow the
    ``fixed`` ones, then nodes on one side; the images of the latter are appended to the result."""
    end = len(points)
    on, adjacent, moving = slice(fixed, fixed + upon), slice(fixed + upon, end), slice(fixed, end)
    points = points.copy() if line is None else np.concatenate([points, line.reflect(points[adjacent])])
    count = min(NEIGHBORS, len(points) - 1)
    if end == fixed or count < 1:
        return points
    h = spacing.at(points)
    for sweep in range(SWEEPS):
        if sweep % SEARCH_INTERVAL == 0:
            _, found = nearest(cKDTree(points), points[moving], np.arange(2, count + 2))
            neighbour = np.ascontiguousarray(found.T)
        h[moving] = own = spacing.at(points[moving])
        if line is not None:
            h[end:] = h[adjacent]
        # Separate coordinates with the neighbours along the first axis: numpy is slow on axes of length 2.
        x, y = np.ascontiguousarray(points.T)
        across, along = x[moving] - x[neighbour], y[moving] - y[neighbour]
        distance = np.sqrt(across**2 + along**2)
        push = 0.5 * (own + h[neighbour]) / distance
        for _ in range(DOUBLINGS):
            push *= push
        push /= distance
        force = np.stack([(push * across).sum(axis=0), (push * along).sum(axis=0)], axis=1)
        size = np.sqrt((force**2).sum(axis=1))
        length = np.minimum(STEP * size / (1.0 + 0.25 * size), MAX_STEP)
        points[moving] += (own * length)[:, None] * force / np.maximum(size, np.finfo(float).tiny)[:, None]
        if line is not None:
            points[on, line.axis] = line.at
            points[end:] = line.reflect(points[adjacent])
    return points


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
    added = np.zeros((0, 2))
    for (a, b), (c, d) in cuts.tolist():
        segment = Segment((a, b), (c, d))
        steps = spacing.steps_along(segment)
        fine = np.interp(np.arange(0.0, len(steps) - 1.0, HOLE_STEP), np.arange(len(steps)), steps)
        places = segment.points(fine)
        sizes, last = spacing.at(places), -np.inf
        for k in np.flatnonzero(nearest(tree, places)[0] > HOLE_RADIUS * sizes):
            if fine[k] - last >= sizes[k]:
                last, added = fine[k], np.append(added, places[[k]], axis=0)
    return np.concatenate([inner[upon], added, inner[~upon]]), int(upon.sum()) + len(added)


def halved(
    line: SymmetryLine, boundary: FloatArray, edges: IntArray, spacing: Spacing
) -> tuple[Mirror, FloatArray, FloatArray] | None:
    """Symmetry of ``boundary`` nodes (b, 2) joined by ``edges`` (e, 2), chords (c, 4) of the closed outline
    of the half on the positive side, and its cuts (k, 2, 2) along the ``line``, the last of the chords. None
    if the nodes are not mirror-symmetric, or if the line runs along the boundary."""
    mirror = line.mirror(boundary, spacing.at(boundary), edges)
    if mirror is None:
        return None
    ends = mirror.side[edges]
    crossing = ends.prod(axis=1) < 0
    if not np.array_equal(mirror.image[edges[crossing, 0]], edges[crossing, 1]):
        return None
    points = boundary[edges]
    middle = points.mean(axis=1)
    middle[:, line.axis] = line.at
    adjacent = (ends.sum(axis=1) > 0) | crossing
    chords = np.where(ends[:, :, None] < 0, middle[:, None], points)[adjacent]
    along = 1 - line.axis
    crossed = np.sort(np.concatenate([boundary[mirror.side == 0, along], middle[crossing, along]]))
    if len(crossed) % 2:
        return None
    cuts = np.full((len(crossed) // 2, 2, 2), line.at)
    cuts[:, :, along] = crossed.reshape(-1, 2)
    return mirror, np.concatenate([chords, cuts]).reshape(-1, 4), cuts
