"""Outlines traced through nodes: corners, names, straight lines, clouds of such nodes."""

from __future__ import annotations

import numpy as np
import pytest

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.cloud.cloud import SymmetryLine
from mlsanm_cli.cloud.curves import Outline, Segment, rectangle
from mlsanm_cli.cloud.loops import Loop, cloud_of_nodes, trace
from mlsanm_cli.cloud.spacing import Spacing, build_cloud
from mlsanm_cli.cloud.splines import Spline
from mlsanm_cli.errors import GeometryError

CORNER = np.radians(40.0)


def loop(count: int, *names: str) -> Loop:
    """``names`` spread evenly over the edges of the first nodes."""
    each = count // len(names)
    return Loop(np.arange(count), tuple(names[k // each] for k in range(count)))


def square(each: int = 4) -> FloatArray:
    side = np.arange(each) / each
    zero, one = np.zeros(each), np.ones(each)
    return np.concatenate(
        [np.stack(s, axis=1) for s in ((side, zero), (one, side), (1.0 - side, one), (zero, 1.0 - side))]
    )


def ring(count: int, radius: float = 1.0, turn: float = 1.0) -> FloatArray:
    angle = 0.1 + turn * 2.0 * np.pi * np.arange(count) / count
    return radius * np.stack([np.cos(angle), np.sin(angle)], axis=1)


def ends(traced: Outline) -> list[tuple[list[float], list[float]]]:
    return [
        (c.points(np.zeros(1))[0].round(12).tolist(), c.points(np.array([c.length]))[0].round(12).tolist())
        for c in traced.curves
    ]


def test_a_square_has_four_straight_sides_from_its_lowest_corner() -> None:
    points = np.roll(square(), 5, axis=0)
    traced = trace(points, [loop(16, "")], CORNER)
    assert traced.names == ("edge1", "edge2", "edge3", "edge4")
    assert all(isinstance(curve, Segment) for curve in traced.curves)
    assert ends(traced)[0] == ([0.0, 0.0], [1.0, 0.0])
    assert [len(nodes) for nodes in traced.nodes] == [5] * 4


def test_names_split_the_outline_and_repeated_ones_get_numbers() -> None:
    named = Loop(np.arange(16), ("wall",) * 8 + ("roof",) * 2 + ("",) * 2 + ("wall",) * 4)
    traced = trace(square(), [named], CORNER)
    assert traced.names == ("wall1", "wall2", "roof", "edge1", "wall3")
    assert ends(traced)[2] == ([1.0, 1.0], [0.5, 1.0])
    with pytest.raises(GeometryError, match='two boundaries would be called "edge1"'):
        trace(square(), [Loop(np.arange(16), ("edge1",) * 4 + ("",) * 12)], CORNER)


def test_a_change_of_name_alone_leaves_no_kink() -> None:
    traced = trace(ring(40), [loop(40, "upper", "lower")], CORNER)
    one, other = traced.curves
    assert isinstance(one, Spline)
    assert isinstance(other, Spline)
    assert one.spline is other.spline
    joint = one.normals(np.array([one.length])) - other.normals(np.zeros(1))
    assert np.abs(joint).max() <= 1e-12
    assert not one.closed


def test_holes_come_after_the_outer_boundary_and_face_the_material() -> None:
    points = np.concatenate([ring(30, 0.3, -1.0), ring(60)])
    inner, outer = Loop(np.arange(30), ("hole",) * 30), Loop(np.arange(30, 90), ("rim",) * 60)
    traced = trace(points, [inner, outer], CORNER)
    assert traced.names == ("rim", "hole")
    assert traced.starts == (0, 1)
    rim, hole = traced.curves
    assert rim.closed
    assert hole.closed
    s = np.array([0.1])
    assert (rim.normals(s) * rim.points(s)).sum() == pytest.approx(1.0, abs=1e-3)
    assert (hole.normals(s) * hole.points(s)).sum() == pytest.approx(-0.3, abs=1e-3)
    cloud = build_cloud(traced, Spacing(0.1), 0)
    assert cloud.areas.sum() == pytest.approx(np.pi * (1.0 - 0.09), rel=0.01)


def test_a_loop_with_one_corner_is_two_curves() -> None:
    angle = np.linspace(-0.75 * np.pi, 0.75 * np.pi, 31)
    drop = np.concatenate([[[-1.4, 0.0]], np.stack([np.cos(angle), np.sin(angle)], axis=1)])
    traced = trace(drop, [loop(32, "rim")], np.radians(60.0))
    assert traced.names == ("rim1", "rim2")
    assert traced.nodes[0][0] == traced.nodes[1][-1] == 0


def test_nodes_of_a_file_make_a_cloud_of_their_own_distances() -> None:
    grid = np.stack(np.meshgrid(np.arange(9) / 8.0, np.arange(9) / 8.0), axis=-1).reshape(-1, 2)
    points = np.concatenate([square(8), grid[(np.abs(grid - 0.5) < 0.49).all(axis=1)]])
    cloud = cloud_of_nodes(points, trace(points, [loop(32, "a", "b", "c", "d")], CORNER))
    assert cloud.areas.sum() == pytest.approx(1.0)
    assert 0.125 <= cloud.spacing.min() <= cloud.spacing.max() <= 0.17
    drawn = build_cloud(rectangle((0.0, 1.0), (0.0, 1.0)), Spacing(0.125), 0)
    for name, other in (("a", "bottom"), ("b", "right"), ("c", "top"), ("d", "left")):
        one, two = cloud.surfaces[name], drawn.surfaces[other]
        assert points[one.index] == pytest.approx(drawn.points[two.index])
        assert one.normal == pytest.approx(two.normal)
        assert one.weight == pytest.approx(two.weight)


def test_given_normals_are_used_where_they_belong_to_the_curve() -> None:
    points = np.concatenate([square(8), [[0.5, 0.5]]])
    traced = trace(points, [loop(32, "a", "b", "c", "d")], CORNER)
    normals = np.full((33, 2), np.nan)
    normals[3] = (0.1, -np.sqrt(0.99))
    normals[8] = (1.0, 0.0)
    cloud = cloud_of_nodes(points, traced, normals)
    assert cloud.surfaces["a"].normal[3] == pytest.approx(normals[3])
    assert cloud.surfaces["a"].normal[8] == pytest.approx([0.0, -1.0])
    assert cloud.surfaces["b"].normal[0] == pytest.approx([1.0, 0.0])


def test_nodes_that_come_with_a_body_are_their_own_images_if_they_are() -> None:
    side = square(4)
    inner = np.stack([one.ravel() for one in np.meshgrid(*[np.arange(1, 4) / 4] * 2)], axis=1)
    points = np.concatenate([side, inner])
    traced = trace(points, [loop(16, "")], CORNER)
    for axis in (0, 1):
        line = SymmetryLine(axis, 0.5)
        cloud = cloud_of_nodes(points, traced).mirrored(line)
        assert cloud is not None
        assert cloud.mirror is not None
        np.testing.assert_allclose(line.reflect(points), points[cloud.mirror.image], atol=1e-15)
        assert np.array_equal(cloud.mirror.side, np.sign(points[:, axis] - 0.5))
        assert np.array_equal(cloud.spacing, cloud.spacing[cloud.mirror.image])
        # An outline that runs along the line is in no half.
        assert cloud_of_nodes(points, traced).mirrored(SymmetryLine(axis, 0.0)) is None
    points[-1, 0] += 1e-6
    assert cloud_of_nodes(points, traced).mirrored(SymmetryLine(0, 0.5)) is None
