"""Advancing front that fills a region with nodes, in time slices so that signals and limits are served."""

from __future__ import annotations

import time

import numpy as np

from mlsanm_cli.arrays import AnyArray, FloatArray, IntArray
from mlsanm_cli.kernels.fill import DONE, EMPTY, FULL_POINTS, FULL_TABLE, advance_front, spacing_at

SLICE_SECONDS = 0.05
"""Target duration of a slice, s: the delay of Ctrl-C."""
FIRST_PARENTS = 500
"""Parent nodes processed in the first slice."""
WEYL = 0x9E3779B97F4A7C15
MODULUS = 2**64

Strips = tuple[IntArray, IntArray, float, float]


def fill_region(
    boundary: FloatArray,
    edges: FloatArray,
    strips: Strips,
    far: float,
    zones: FloatArray,
    candidates: int,
    seed: int,
    limit: int,
) -> FloatArray:
    """Nodes (n, 2) inside the closed boundary: the boundary nodes (b, 2) first, then the interior ones.

    ``edges`` (e, 4) are the boundary's chords, sorted into horizontal ``strips``; ``far`` and ``zones``
    define the spacing. The result depends on ``seed``, not on the timing of slices. The front stops at
    ``limit`` nodes: the caller must reject a cloud of ``limit`` nodes or more.
    """
    count = len(boundary)
    room = 2 * count + 1024
    points, h = np.empty((room, 2)), np.empty(room)
    points[:count], h[:count] = boundary, spacing_at(far, zones, boundary)
    following = _empty(room)
    keys, heads = _empty(8192), _empty(8192)
    state = (seed * 2 + 1) * WEYL % MODULUS
    progress = np.array([count, 0, 0, 0, state - MODULUS if 2 * state >= MODULUS else state], np.int64)
    parents = FIRST_PARENTS
    while True:
        begun = time.monotonic()
        stopped = advance_front(
            *(points, h, following, keys, heads, progress, edges, *strips),
            *(far, zones, candidates, limit, parents),
        )
        if stopped == DONE:
            return points[: progress[0]].copy()
        if stopped == FULL_POINTS:
            points, h, following = _longer(points, 0.0), _longer(h, 0.0), _longer(following, EMPTY)
        elif stopped == FULL_TABLE:
            # Hash table too full for fast probing: continue with a larger one; all nodes are re-entered.
            room = 8 * int(progress[3] + progress[0] - progress[2])
            keys, heads = _empty(room), _empty(room)
            progress[2] = progress[3] = 0
        else:
            spent = time.monotonic() - begun
            wanted = parents * SLICE_SECONDS / max(spent, 1e-3 * SLICE_SECONDS)
            parents = int(np.clip(wanted, parents / 8, 2 * parents)) + 1


def _empty(room: int) -> IntArray:
    return np.full(room, EMPTY, np.int64)


def _longer(array: AnyArray, fill: float) -> AnyArray:
    """The array extended to twice its rows."""
    grown = np.full((2 * len(array), *array.shape[1:]), fill, array.dtype)
    grown[: len(array)] = array
    return grown
