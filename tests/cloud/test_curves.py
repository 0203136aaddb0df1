"""Curves and outlines: positions, normals, closest points."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.cloud.curves import Arc, Curve, Outline, Segment, disk, half_disk, rectangle, sector
from mlsanm_cli.cloud.splines import NodeSpline, Spline

OUTLINES = [
    rectangle((-1.0, 2.0), (0.5, 1.0)),
    disk((1.0, -1.0), 0.7),
    *(half_disk((0.3, 0.2), 1.5, side) for side in ("lower", "upper", "left", "right")),
    sector((0.5, -0.2), (1.0, 3.0), (0.2, 1.9)),
    sector((0.5, -0.2), (1.0, 3.0), (-1.0, 4.0)),
]
AREAS = [1.5, math.pi * 0.49, *[0.5 * math.pi * 2.25] * 4, 0.5 * 1.7 * 8.0, 0.5 * 5.0 * 8.0]

coordinate = st.floats(-2.0, 2.0)
curves = st.one_of(
    st.builds(Segment, st.tuples(coordinate, coordinate), st.tuples(st.floats(2.5, 4.0), coordinate)),
    st.builds(
        Arc,
        st.tuples(coordinate, coordinate),
        st.floats(0.1, 2.0),
        st.floats(-7.0, 7.0),
        st.one_of(st.floats(0.1, 2.0 * math.pi), st.floats(-2.0 * math.pi, -0.1)),
    ),
)


@given(curve=curves, point=st.tuples(coordinate, coordinate))
def test_closest_point_beats_every_sample(curve: Curve, point: tuple[float, float]) -> None:
    target = np.array([point])
    s = curve.closest(target)
    assert 0.0 <= s[0] <= curve.length
    found = np.hypot(*(curve.points(s) - target)[0])
    sampled = np.hypot(*(curve.points(np.linspace(0.0, curve.length, 501)) - target).T).min()
    assert found <= sampled + 1e-12


@given(curve=curves, fraction=st.floats(0.0, 0.99))
def test_normals_are_the_tangent_turned_to_the_right(curve: Curve, fraction: float) -> None:
    # The material is on the left, so the outward normal is on the right.
    s = np.array([fraction * curve.length])
    step = 1e-6 * curve.length
    tangent = (curve.points(s + step) - curve.points(s - step))[0] / (2.0 * step)
    assert math.hypot(*tangent) == pytest.approx(1.0, abs=1e-8)
    assert curve.normals(s)[0] == pytest.approx([tangent[1], -tangent[0]], abs=1e-7)


@pytest.mark.parametrize(("outline", "area"), list(zip(OUTLINES, AREAS, strict=True)))
def test_outlines_close_and_run_counter_clockwise(outline: Outline, area: float) -> None:
    ends = [curve.points(np.array([0.0, curve.length])) for curve in outline.curves]
    for this, following in zip(ends, ends[1:] + ends[:1], strict=True):
        assert np.abs(this[1] - following[0]).max() <= 1e-12
    chain = np.concatenate([c.points(np.linspace(0.0, c.length, 2001)[:-1]) for c in outline.curves])
    after = np.roll(chain, -1, axis=0)
    enclosed = 0.5 * float((chain[:, 0] * after[:, 1] - chain[:, 1] * after[:, 0]).sum())
    assert enclosed == pytest.approx(area, rel=1e-5)


@pytest.mark.parametrize(
    ("side", "towards"), [("lower", (0, -1)), ("upper", (0, 1)), ("left", (-1, 0)), ("right", (1, 0))]
)
def test_half_disks_bulge_to_their_side(side: str, towards: tuple[float, float]) -> None:
    outline = half_disk((0.3, 0.2), 1.5, side)
    assert outline.names == ("arc", "flat")
    arc, flat = outline.curves
    middle = np.array([0.5 * arc.length])
    assert arc.normals(middle)[0] == pytest.approx(towards, abs=1e-12)
    assert arc.points(middle)[0] == pytest.approx(np.array([0.3, 0.2]) + 1.5 * np.array(towards))
    assert flat.normals(np.zeros(1))[0] == pytest.approx([-towards[0], -towards[1]], abs=1e-12)


def circle(count: int, start: float = 0.0, sweep: float = 2.0 * np.pi) -> FloatArray:
    angle = start + np.linspace(0.0, sweep, count + 1)
    return np.stack([np.cos(angle), np.sin(angle)], axis=1)


def whole(spline: NodeSpline) -> Spline:
    return spline.between(0, len(spline.nodes) - 1)


@pytest.mark.parametrize(("closed", "sweep"), [(True, 2.0 * np.pi), (True, -2.0 * np.pi), (False, 2.0)])
def test_gaps_to_a_circle_known_by_its_nodes_converge(closed: bool, sweep: float) -> None:
    angle = sweep * np.linspace(0.05, 0.95, 301)
    points = 0.9 * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    errors = []
    for count in (16, 32, 64, 128):
        curve = whole(NodeSpline(circle(count, 0.0, sweep), closed))
        s = curve.closest(points)
        away = points - curve.points(s)
        normal = curve.normals(s)
        gap = np.abs((away * normal).sum(axis=1))
        exact = np.sign(sweep) * points / 0.9
        errors.append(
            [
                np.abs(gap - 0.1).max(),
                np.abs(normal - exact).max(),
                np.abs(curve.curvature(s) - np.sign(sweep)).max(),
                abs(curve.length - abs(sweep)),
            ]
        )
    rates = np.log2(np.array(errors[:-1]) / np.array(errors[1:]))[-1]
    assert (rates >= [3.8, 2.8, 1.8, 3.5]).all(), rates
    # Chords would be off by 1 - cos(pi / 64) = 1.2e-3 here.
    assert errors[2][0] <= 1e-6


def test_arc_length_and_parameter_are_inverse_and_arc_length_is_even() -> None:
    rng = np.random.default_rng(1)
    angle = np.sort(rng.uniform(0.0, 2.0 * np.pi, 40))
    ellipse = np.stack([2.0 * np.cos(angle), np.sin(angle)], axis=1)
    spline = NodeSpline(np.concatenate([ellipse, ellipse[:1]]), True)
    curve = whole(spline)
    s = np.linspace(0.0, curve.length, 777)[:-1]
    assert np.abs(curve.closest(curve.points(s)) - s).max() <= 1e-12
    step = np.hypot(*np.diff(curve.points(np.linspace(1.0, 1.001, 11)), axis=0).T)
    assert step == pytest.approx(1e-4, rel=1e-6)
    assert curve.points(curve.node_arcs) == pytest.approx(spline.nodes, abs=1e-12)


def test_the_closest_point_is_the_closest_of_many_and_its_normal_points_there() -> None:
    angle = np.linspace(0.0, 2.0 * np.pi, 61)
    wave = (1.0 + 0.2 * np.cos(5.0 * angle))[:, None] * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    points = np.random.default_rng(0).uniform(-1.5, 1.5, (400, 2))
    for curve in (whole(NodeSpline(wave, True)), NodeSpline(wave, True).between(7, 31)):
        s = curve.closest(points)
        distance = np.hypot(*(points - curve.points(s)).T)
        many = curve.points(np.linspace(0.0, curve.length, 20001))
        best = np.sqrt(((points[:, None] - many) ** 2).sum(axis=2).min(axis=1))
        assert (distance <= best + 1e-12).all()
        inner = (s > 1e-9) & (s < curve.length - 1e-9)
        away, normal = points - curve.points(s), curve.normals(s)
        tangential = np.abs(away[:, 0] * normal[:, 1] - away[:, 1] * normal[:, 0])
        assert tangential[inner].max() <= 1e-12
        assert inner.sum() > 100


def test_a_part_of_a_spline_is_the_same_curve() -> None:
    spline = NodeSpline(circle(40), True)
    part = spline.between(10, 20)
    s = np.linspace(0.0, part.length, 9)
    shift = spline.arcs[10]
    assert part.points(s) == pytest.approx(whole(spline).points(s + shift), abs=1e-14)
    assert part.normals(s) == pytest.approx(whole(spline).normals(s + shift), abs=1e-14)
    assert not part.closed
    assert whole(spline).closed
    # Beyond its ends a part has none but its ends.
    assert part.closest(np.array([[2.0, 0.0], [0.0, -2.0]])) == pytest.approx([0.0, part.length], abs=1e-12)
    assert len(part.zones()) == 10
