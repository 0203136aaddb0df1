"""Which points a body holds, told from its boundary nodes."""

from __future__ import annotations

import numpy as np
import pytest

from mlsanm_cli.cloud.cloud import Cloud
from mlsanm_cli.cloud.curves import annulus, disk, rectangle
from mlsanm_cli.cloud.spacing import Spacing, build_cloud


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
