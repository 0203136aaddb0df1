"""Advancing-front node placement with variable spacing.

Candidates lie on a circle of radius h(parent) and are rejected within min(h(parent), h(candidate)) of an
accepted node (Slak and Kosec 2019, doi:10.1137/18M1231456, but with the smaller of both spacings, which
leaves no holes where the spacing grows).
"""

from __future__ import annotations

import math

import numpy as np

from mlsanm_cli.arrays import FloatArray, IntArray
from mlsanm_cli.kernels.aot.jit import inner, kernel
from mlsanm_cli.kernels.aot.signature import Float1, Float2, FloatOut1, FloatOut2, Int1, IntOut1
from mlsanm_cli.kernels.dense import copy_to

EMPTY = -1
DONE, PAUSED, FULL_POINTS, FULL_TABLE = 0, 1, 2, 3


@inner
def _distance(zone: FloatArray, x: float, y: float) -> float:
    """Distance to a zone's segment (0, x0, y0, x1, y1, ...) or arc (1, cx, cy, radius, from, sweep, ...)."""
    if zone[0] == 0.0:
        ex, ey = zone[3] - zone[1], zone[4] - zone[2]
        length2 = ex * ex + ey * ey
        t = 0.0
        if length2 > 0.0:
            t = min(1.0, max(0.0, ((x - zone[1]) * ex + (y - zone[2]) * ey) / length2))
        return math.hypot(x - zone[1] - t * ex, y - zone[2] - t * ey)
    angle = (math.atan2(y - zone[2], x - zone[1]) - zone[4]) % (2.0 * math.pi)
    if angle <= zone[5]:
        from_center = math.hypot(x - zone[1], y - zone[2])
        radius: float = zone[3]
        return abs(from_center - radius)
    first: float = math.hypot(
        x - zone[1] - zone[3] * math.cos(zone[4]), y - zone[2] - zone[3] * math.sin(zone[4])
    )
    end = zone[4] + zone[5]
    last: float = math.hypot(x - zone[1] - zone[3] * math.cos(end), y - zone[2] - zone[3] * math.sin(end))
    return min(first, last)


@inner
def _spacing(far: float, zones: FloatArray, x: float, y: float) -> float:
    """Minimum of the far spacing and the spacings of all zones, rows (..., spacing, radius, growth)."""
    h = far
    for z in range(zones.shape[0]):
        zone = zones[z]
        outside = _distance(zone, x, y) - zone[7]
        h = min(h, zone[6] + zone[8] * max(0.0, outside))
    return h


@kernel
def spacing_at(far: float, zones: Float2, points: Float2) -> Float1:
    """Spacing (n,) at ``points`` (n, 2); rows of ``zones`` (z, 9) as in :func:`_spacing`."""
    h = np.empty(points.shape[0])
    for i in range(points.shape[0]):
        h[i] = _spacing(far, zones, points[i, 0], points[i, 1])
    return h


@inner
def _key(level: int, i: int, j: int) -> int:
    return (level << 56) ^ ((i & 0xFFFFFFF) << 28) ^ (j & 0xFFFFFFF)


@inner
def _level(h: float, finest: float) -> int:
    """Grid level of a node: level l has spacings from finest 2^l on and cells of twice that width."""
    _, exponent = math.frexp(h / finest)
    level: int = max(0, exponent - 1)
    return level


@inner
def _cell(level: int, finest: float) -> float:
    cell: float = math.ldexp(finest, level + 1)
    return cell


@inner
def _slot(keys: IntArray, key: int) -> int:
    """Position of ``key`` in an open-addressing hash table, or of the free entry for it."""
    mixed = key * 0x9E3779B97F4A7C1
    slot: int = (mixed ^ (mixed >> 29)) % keys.shape[0]
    while keys[slot] != EMPTY and keys[slot] != key:
        slot = (slot + 1) % keys.shape[0]
    return slot


@inner
def _inside(
    loops: FloatArray,
    strip_start: IntArray,
    strip_edges: IntArray,
    low: float,
    step: float,
    x: float,
    y: float,
) -> bool:
    """Even-odd rule over the boundary edges (e, 4) that meet the horizontal strip of (x, y)."""
    strip = int((y - low) / step)
    if strip < 0 or strip >= strip_start.shape[0] - 1:
        return False
    inside = False
    for k in range(strip_start[strip], strip_start[strip + 1]):
        edge = loops[strip_edges[k]]
        if (edge[1] > y) != (edge[3] > y) and x < edge[0] + (y - edge[1]) / (edge[3] - edge[1]) * (
            edge[2] - edge[0]
        ):
            inside = not inside
    return inside


@inner
def _doubled(array: FloatArray) -> FloatArray:
    grown = np.empty((2 * array.shape[0], 2))
    for i in range(array.shape[0]):
        copy_to(grown[i], array[i])
    return grown


@kernel
def advance_front(
    points: FloatOut2,
    h: FloatOut1,
    following: IntOut1,
    keys: IntOut1,
    heads: IntOut1,
    progress: IntOut1,
    edges: Float2,
    strip_start: Int1,
    strip_edges: Int1,
    strip_low: float,
    strip_step: float,
    far: float,
    zones: Float2,
    candidates: int,
    limit: int,
    parents: int,
) -> int:
    """Place neighbours around up to ``parents`` more nodes; returns the reason for stopping.

    ``points`` (n, 2), spacings ``h`` (n,) and ``following`` (n,), the next node in the same cell, have room
    for new nodes; ``keys`` and ``heads`` (k,) are the hash table of cells, EMPTY at first. ``progress`` holds
    the number of nodes, the next parent, the numbers of nodes and of cells in the table, and the random
    state. ``edges`` (e, 4) are the boundary's chords, sorted into horizontal strips for the inside test.

    Returns DONE at the end or from ``limit`` nodes on, PAUSED after ``parents`` nodes, FULL_POINTS or
    FULL_TABLE if there may be no room for another parent; the caller then enlarges the arrays.
    """
    finest, steepest = far, 0.0
    for z in range(zones.shape[0]):
        finest = min(finest, zones[z, 6])
        steepest = max(steepest, zones[z, 8])
    count, parent, entered, used = progress[0], progress[1], progress[2], progress[3]
    state, near = np.uint64(progress[4]), np.empty((64, 2))
    stopped, last = PAUSED, parent + parents
    while parent < last:
        if parent == count or count >= limit:
            stopped = DONE
            break
        if count + candidates > points.shape[0]:
            stopped = FULL_POINTS
            break
        if 4 * (used + count - entered) >= keys.shape[0]:
            stopped = FULL_TABLE
            break
        state = state * np.uint64(6364136223846793005) + np.uint64(1442695040888963407)
        turn = float(state >> np.uint64(11)) / 9007199254740992.0
        # New nodes become the heads of their cells' lists.
        while entered < count:
            level = _level(h[entered], finest)
            cell = _cell(level, finest)
            key = _key(level, math.floor(points[entered, 0] / cell), math.floor(points[entered, 1] / cell))
            slot = _slot(keys, key)
            if keys[slot] == EMPTY:
                keys[slot] = key
                used += 1
            following[entered], heads[slot] = heads[slot], entered
            entered += 1
        # Candidates are one spacing away; nodes that reject them are within another spacing.
        size = h[parent]
        reach = 2.0 * size
        lowest = _level(max(finest, size - steepest * reach), finest)
        highest = _level(size + steepest * reach, finest)
        here_x, here_y, around = points[parent, 0], points[parent, 1], 0
        for level in range(lowest, highest + 1):
            cell = _cell(level, finest)
            i1, j1 = math.floor((here_x + reach) / cell), math.floor((here_y + reach) / cell)
            for i in range(math.floor((here_x - reach) / cell), i1 + 1):
                for j in range(math.floor((here_y - reach) / cell), j1 + 1):
                    slot = _slot(keys, _key(level, i, j))
                    node = EMPTY if keys[slot] == EMPTY else heads[slot]
                    while node != EMPTY:
                        dx, dy = points[node, 0] - here_x, points[node, 1] - here_y
                        if dx * dx + dy * dy < reach * reach:
                            if around == near.shape[0]:
                                near = _doubled(near)
                            near[around, 0], near[around, 1] = points[node, 0], points[node, 1]
                            around += 1
                        node = following[node]
        while near.shape[0] < around + candidates:
            near = _doubled(near)
        # Lower bound of the spacing at all candidates, with a margin for round-off; rejects most of them.
        least = size * max(0.0, 1.0 - steepest) * (1.0 - 1e-6)
        for c in range(candidates):
            angle = 2.0 * math.pi * (c + turn) / candidates
            x, y = here_x + size * math.cos(angle), here_y + size * math.sin(angle)
            distance2 = math.inf
            for k in range(around):
                dx, dy = near[k, 0] - x, near[k, 1] - y
                distance2 = min(distance2, dx * dx + dy * dy)
                if distance2 < least * least:
                    break
            if distance2 < least * least:
                continue
            own = _spacing(far, zones, x, y)
            radius = min(own, size) * (1.0 - 1e-9)
            if distance2 < radius * radius:
                continue
            if not _inside(edges, strip_start, strip_edges, strip_low, strip_step, x, y):
                continue
            points[count, 0], points[count, 1], h[count] = x, y, own
            near[around, 0], near[around, 1] = x, y
            count, around = count + 1, around + 1
        parent += 1
    progress[0], progress[1], progress[2], progress[3] = count, parent, entered, used
    progress[4] = np.int64(state)
    return stopped
