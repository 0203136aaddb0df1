"""The advancing front that fills a region, in slices: between them signals are handled and limits kept."""

from __future__ import annotations

import time

import numpy as np

from mlsanm_cli.arrays import AnyArray, FloatArray, IntArray
from mlsanm_cli.kernels.fill import DONE, EMPTY, FULL_POINTS, FULL_TABLE, advance_front, spacing_at

SLICE_SECONDS = 0.05
"""Duration of a slice, after which signals are handled."""
FIRST_SLICE = 500
"""Number of nodes of the first slice."""
WEYL = 0x9E3779B97F4A7C15
MODULUS = 2**64

Strips = tuple[IntArray, IntArray, float, float]


def filled(
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

    ``edges`` (e, 4) are the boundary's chords, sorted into horizontal ``strips``; ``far`` and ``zones`` give
    the spacing. The same ``seed`` gives the same nodes, however long slices take. From ``limit`` nodes on the
    front stops, and the caller, who sees at least ``limit`` nodes, must refuse the cloud.
    """
    count = len(boundary)
    room = 2 * count + 1024
    points, h = np.empty((room, 2)), np.empty(room)
    points[:count], h[:count] = boundary, spacing_at(far, zones, boundary)
    following = _empty(room)
    keys, heads = _empty(8192), _empty(8192)
    state = (seed * 2 + 1) * WEYL % MODULUS
    progress = np.array([count, 0, 0, 0, state - MODULUS if 2 * state >= MODULUS else state], np.int64)
    parents = FIRST_SLICE
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
            # Too full for quick probing: a larger, empty table, into which every node goes again.
            room = 8 * int(progress[3] + progress[0] - progress[2])
            keys, heads = _empty(room), _empty(room)
            progress[2] = progress[3] = 0
        else:
            spent = time.monotonic() - begun
            parents = (
                int(
                    np.clip(
                        parents * SLICE_SECONDS / max(spent, 1e-3 * SLICE_SECONDS), parents / 8, 2 * parents
                    )
                )
                + 1
            )


def _empty(room: int) -> IntArray:
    return np.full(room, EMPTY, np.int64)


def _longer(array: AnyArray, fill: float) -> AnyArray:
    """The array with as many rows again."""
    grown = np.full((2 * len(array), *array.shape[1:]), fill, array.dtype)
    grown[: len(array)] = array
    return grown
