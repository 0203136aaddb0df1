"""Long compiled calls in batches, so that signals are handled meanwhile."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.spatial import cKDTree

from mlsanm_cli.arrays import AnyArray, FloatArray, IntArray

BATCH_SIZE = 8192
"""Points per batch: a few hundredths of a second."""
MAX_PAIRS = 2**18
"""Pairs processed at once: large for speed, small for memory."""


def nearest(tree: cKDTree, points: FloatArray, k: int | IntArray = 1) -> tuple[FloatArray, IntArray]:
    """Distances and indices of the ``k`` nodes of a ``tree`` nearest to ``points`` (n, 2): (n,) for k = 1,
    otherwise (n, k)."""
    if len(points) <= BATCH_SIZE:
        found = tree.query(points, k=k)
        return np.asarray(found[0]), np.asarray(found[1])
    pieces = [tree.query(points[at : at + BATCH_SIZE], k=k) for at in range(0, len(points), BATCH_SIZE)]
    return np.concatenate([piece[0] for piece in pieces]), np.concatenate([piece[1] for piece in pieces])


def in_batches(function: Callable[[AnyArray], AnyArray], rows: AnyArray, piece: int = BATCH_SIZE) -> AnyArray:
    """``function(rows)`` evaluated in batches; it must treat every row separately."""
    if len(rows) <= piece:
        return function(rows)
    return np.concatenate([function(rows[at : at + piece]) for at in range(0, len(rows), piece)])
