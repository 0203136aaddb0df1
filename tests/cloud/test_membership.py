"""Which points a body holds, told from its boundary nodes."""

from __future__ import annotations

import numpy as np
import pytest

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.cloud import membership
from mlsanm_cli.cloud.cloud import Cloud, build_cloud
from mlsanm_cli.cloud.curves import annulus, disk, rectangle
from mlsanm_cli.cloud.membership import boundary_chords, inside_polygon
from mlsanm_cli.cloud.spacing import Spacing


def ring(radius: float, angles: list[float]) -> list[list[float]]:
    return [[radius * np.cos(a), radius * np.sin(a)] for a in angles]


@pytest.fixture(scope="module")
def coarse() -> Cloud:
    """A disk of radius 1 with about 16 nodes around."""
    return build_cloud(disk((0.0, 0.0), 1.0), Spacing(0.4, ()), seed=0)


def test_points_between_a_chord_and_its_arc_are_inside(coarse: Cloud) -> None:
    angles = np.linspace(0.0, 6.2, 57).tolist()
    assert coarse.contains(np.array(ring(1.0, angles))).all()
    assert coarse.contains(np.array(ring(0.5, angles))).all()
    # The slack is a tenth of how far arcs lie over their chords, 0.02.
    assert not coarse.contains(np.array(ring(1.025, angles))).any()


def test_straight_sides_leave_no_slack() -> None:
    cloud = build_cloud(rectangle((0.0, 2.0), (0.0, 1.0)), Spacing(0.25, ()), seed=0)
    inside = np.array([[0.0, 0.0], [2.0, 1.0], [1.0, 1.0], [0.77, 0.0], [1.0, 0.5]])
    assert cloud.contains(inside).all()
    assert not cloud.contains(inside[:4] + np.array([[-1e-6, 0], [0, 1e-6], [0, 1e-6], [0, -1e-6]])).any()


def test_holes_are_outside() -> None:
    cloud = build_cloud(annulus((0.0, 0.0), (1.0, 2.0)), Spacing(0.3, ()), seed=0)
    held = cloud.contains(np.array([[0.0, 0.0], [0.9, 0.0], [1.5, 0.0], [0.0, -1.0], [2.1, 0.0]]))
    assert held.tolist() == [False, False, True, True, False]


def test_chords_close_every_loop() -> None:
    index = np.array([0, 1, 2, 2, 3, 0, 7, 8, 9])
    chords = boundary_chords(index, ["a"] * 3 + ["b"] * 3 + ["hole"] * 3)
    assert index[chords].tolist() == [[0, 1], [1, 2], [2, 3], [3, 0], [7, 8], [8, 9], [9, 7]]


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
