"""Curves through nodes: rates of convergence, arc length, closest points."""

from __future__ import annotations

import numpy as np
import pytest

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.cloud.splines import NodeSpline, Spline


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
