"""Curves put together, cut and told apart again."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.cloud.cells import Halves
from mlsanm_cli.cloud.curves import Arc, Curve, Segment, annulus, disk, rectangle
from mlsanm_cli.cloud.splines import NodeSpline, Spline
from mlsanm_cli.cloud.surface import Joined, Surface, joined, joined_surface, normals_towards

FOOT = (
    Arc((-0.7, 0.3), 0.3, np.pi, 0.5 * np.pi),
    Segment((-0.7, 0.0), (0.7, 0.0)),
    Arc((0.7, 0.3), 0.3, 1.5 * np.pi, 0.5 * np.pi),
)


def wave() -> Spline:
    x = np.linspace(0.0, 3.0, 61)
    return NodeSpline(np.stack([x, 0.1 * np.cos(2.0 * np.pi * x)], axis=1), False).between(0, 60)


def surface(name: str, curve: Curve, first: int, count: int) -> Surface:
    arc = np.linspace(0.0, curve.length, count)
    return Surface(name, curve, first + np.arange(count), arc, curve.normals(arc))


def test_a_face_with_its_rounded_corners_is_one_smooth_curve() -> None:
    curve = joined(FOOT)
    assert isinstance(curve, Joined)
    assert curve.length == pytest.approx(1.4 + 0.3 * np.pi)
    assert not len(curve.corners)
    s = np.linspace(0.0, curve.length, 101)
    points, normals = curve.points(s), curve.normals(s)
    assert np.abs(curve.closest(points + 0.1 * normals) - s).max() < 1e-12
    # The way along the curve is at right angles to its normals, also across the joints.
    along = np.gradient(points, s, axis=0)
    assert np.abs((along * normals).sum(axis=1)).max() < 0.04
    curved = (s < 0.15 * np.pi) | (s > curve.length - 0.15 * np.pi)
    assert np.abs(curve.curvature(s) - np.where(curved, 1.0 / 0.3, 0.0)).max() < 1e-12


def test_sharp_joints_are_corners_with_two_normals() -> None:
    curve = joined(rectangle((0.0, 2.0), (0.0, 1.0)).curves, around=True)
    assert curve.closed
    assert sorted(curve.corners) == pytest.approx([0.0, 2.0, 3.0, 5.0])
    corner = np.array([2.0, 2.0])
    towards = np.array([[0.0, 1.0], [-1.0, 0.0]])
    assert normals_towards(curve, corner, towards) == pytest.approx(-towards)


@pytest.mark.parametrize(
    "curve", [Segment((0.0, 0.0), (2.0, 1.0)), FOOT[0], wave()], ids=["line", "arc", "spline"]
)
def test_parts_of_a_curve_join_to_the_curve(curve: Curve) -> None:
    ends = curve.length * np.array([0.0, 0.3, 0.55, 1.0])
    parts = [curve.part(a, b) for a, b in pairwise(ends.tolist())]
    s = np.linspace(0.0, parts[1].length, 21)
    assert parts[1].points(s) == pytest.approx(curve.points(s + ends[1]))
    assert parts[1].normals(s) == pytest.approx(curve.normals(s + ends[1]))
    assert parts[1].curvature(s) == pytest.approx(curve.curvature(s + ends[1]))
    beyond: FloatArray = curve.points(ends[[0, 3]])
    assert parts[1].closest(beyond) == pytest.approx([0.0, parts[1].length])
    again = joined(parts)
    assert type(again) is type(curve)
    assert again.length == pytest.approx(curve.length, rel=1e-14)


def test_a_circle_that_is_cut_is_a_circle_again() -> None:
    outline = disk((0.0, 0.0), 1.0).cut({0: [1.0, 5.0]})
    assert outline.names == ("arc/1", "arc/2")
    assert [curve.length for curve in outline.curves] == pytest.approx([4.0, 2.0 * np.pi - 4.0])
    assert not any(curve.closed for curve in outline.curves)
    assert joined(outline.curves, around=True).closed


def test_pieces_follow_each_other_along_one_loop() -> None:
    outline = rectangle((0.0, 2.0), (0.0, 1.0))
    assert outline.chains([3, 0]) == [((3, 0), False)]
    assert outline.chains([2, 1, 0, 3]) == [((0, 1, 2, 3), True)]
    assert len(annulus((0.0, 0.0), (1.0, 2.0)).chains([0, 1])) == 2
    assert outline.chains([0, 2]) == [((0,), False), ((2,), False)]
    assert outline.chains([0, 3, 2]) == [((2, 3, 0), False)]


def test_nodes_of_a_joined_surface() -> None:
    parts = [surface("a", FOOT[0], 0, 5), surface("b", FOOT[1], 4, 8), surface("c", FOOT[2], 11, 5)]
    whole = joined_surface("foot", parts, around=False)
    assert whole.index.tolist() == list(range(16))
    assert np.abs(whole.curve.normals(whole.arc_length) - whole.normal).max() < 1e-12
    assert whole.weight.sum() == pytest.approx(whole.curve.length)
    for part, place in whole.members:
        assert whole.index[place].tolist() == part.index.tolist()
    assert joined_surface("a", parts[:1], around=False) is parts[0]


def test_cells_close_along_waves_that_their_nodes_do_not_see() -> None:
    """Forces on rough bodies balanced to 0.2 % only, with two places on each half between nodes."""
    rough = surface("rough", wave(), 0, 5)
    halves = Halves.of(rough)
    normal = halves.length @ rough.curve.normals(halves.arc)
    first, last = rough.curve.points(np.array([0.0, rough.curve.length]))
    assert normal == pytest.approx([last[1] - first[1], first[0] - last[0]], abs=1e-6)


def around() -> Spline:
    angle = np.linspace(0.0, 2.0 * np.pi, 41)
    return NodeSpline((1.0 + 0.2 * np.cos(3.0 * angle))[:, None] * circle(angle), True).between(0, 40)


def circle(angle: FloatArray) -> FloatArray:
    return np.stack([np.cos(angle), np.sin(angle)], axis=1)


@pytest.mark.parametrize(
    "curve",
    [joined(rectangle((0.0, 2.0), (0.0, 1.0)).curves, around=True), around()],
    ids=["sides", "spline"],
)
def test_a_part_may_pass_the_start_of_a_closed_curve(curve: Curve) -> None:
    first, last = 0.7 * curve.length, 1.25 * curve.length
    part = curve.part(first, last)
    assert not part.closed
    assert part.length == pytest.approx(last - first)
    s = np.linspace(0.0, part.length, 1001)
    inside = np.mod(first + s, curve.length)
    assert part.points(s) == pytest.approx(curve.points(inside), abs=1e-9)
    places = np.random.default_rng(0).uniform(-1.0, 2.0, (200, 2))
    away = np.hypot(*(part.points(part.closest(places)) - places).T)
    best = np.sqrt(((places[:, None] - part.points(s)) ** 2).sum(axis=2).min(axis=1))
    assert (away <= best + 1e-12).all()
