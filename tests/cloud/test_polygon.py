"""Points in polygons, next to a slow twin."""

from __future__ import annotations

import numpy as np
import pytest

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.cloud import membership
from mlsanm_cli.cloud.membership import inside_polygon

EDGES = np.array(
    [
        *((0.0, 0.0, 2.0, 0.0), (2.0, 0.0, 2.5, 1.0), (2.5, 1.0, 1.0, 0.5), (1.0, 0.5, 0.0, 2.0)),
        *((0.0, 2.0, 0.0, 0.0), (0.2, 0.2, 0.2, 0.6), (0.2, 0.6, 0.6, 0.2), (0.6, 0.2, 0.2, 0.2)),
    ]
)
"""A polygon with an inward corner and a triangular hole."""


def is_inside(edges: FloatArray, x: float, y: float) -> bool:
    """One point: edges to its right that cross its level, counted one by one."""
    crossed = 0
    for x0, y0, x1, y1 in edges:
        if min(y0, y1) <= y < max(y0, y1) and x < x0 + (y - y0) / (y1 - y0) * (x1 - x0):
            crossed += 1
    return crossed % 2 == 1


@pytest.mark.parametrize("together", [1, 50, 2**18])
def test_the_same_as_point_by_point(together: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(membership, "MAX_PAIRS", together)
    points = np.random.default_rng(0).uniform(-0.5, 3.0, (300, 2))
    # Levels of corners are where an edge must count once.
    points[:60, 1] = np.repeat([0.0, 0.2, 0.5, 0.6, 1.0, 2.0], 10)
    expected = [is_inside(EDGES, x, y) for x, y in points]
    assert 40 < sum(expected) < 260
    assert np.array_equal(inside_polygon(EDGES, points), expected)
