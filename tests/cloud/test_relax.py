"""Evening out: what moves, what stays, what gets better."""

from __future__ import annotations

import math

import numpy as np
import pytest

from mlsanm_cli.cloud.cloud import Cloud, SymmetryLine
from mlsanm_cli.cloud.curves import Arc, Outline, disk, rectangle
from mlsanm_cli.cloud.spacing import Spacing, Zone, build_cloud


def test_nodes_stay_where_they_are_wanted() -> None:
    plate, hole = rectangle((-5.0, 5.0), (-5.0, 5.0)), Arc((0.0, 0.0), 1.0, 0.0, -2.0 * np.pi)
    outline = Outline((*plate.names, "hole"), (*plate.curves, hole), (0, 4))
    for seed in range(3):
        cloud = build_cloud(outline, Spacing(0.25, (Zone(hole, 0.1, 0.0, 0.25),)), seed)
        away = np.hypot(*cloud.points.T) - 1.0
        next_to_it = (away > 0.01) & (away < 0.15)
        size = cloud.areas[next_to_it] / cloud.spacing[next_to_it] ** 2
        assert 0.85 <= size.mean() <= 1.1


H = 0.1


def away(cloud: Cloud, point: tuple[float, float]) -> float:
    return float(np.hypot(*(cloud.points - np.array(point)).T).min())


@pytest.mark.parametrize("line", [None, SymmetryLine(0, 0.0)])
@pytest.mark.parametrize(
    "point", [(0.0, 0.0), (0.0, 0.13), (0.37, 0.21), (math.cos(0.4), math.sin(0.4)), (0.0, -1.0)]
)
def test_a_node_lies_where_it_is_wanted(line: SymmetryLine | None, point: tuple[float, float]) -> None:
    plain = build_cloud(disk((0.0, 0.0), 1.0), Spacing(H), 0, line=line)
    cloud = build_cloud(disk((0.0, 0.0), 1.0), Spacing(H), 0, line=line, wanted=[point])
    assert away(cloud, point) <= 1e-12
    assert abs(len(cloud.points) - len(plain.points)) <= 10
    near = np.asarray(cloud.tree.query(cloud.points, k=2)[0])[:, 1]
    assert near.min() > 0.8 * H
    # Off the line a cloud cannot be its own image.
    assert (cloud.mirror is not None) == (line is not None and point[0] == 0.0)


def test_no_node_lies_too_close_to_others() -> None:
    wanted = [(0.333, 0.0), (-0.98, 0.0), (0.2, 0.97), (0.2, 0.5), (0.22, 0.5), (3.0, 0.0)]
    cloud = build_cloud(rectangle((-1.0, 1.0), (0.0, 1.0)), Spacing(H), 0, wanted=wanted)
    assert [away(cloud, point) <= 1e-12 for point in wanted] == [True, False, False, True, False, False]
    assert np.asarray(cloud.tree.query(cloud.points, k=2)[0])[:, 1].min() > 0.5 * H
