"""Obstacles' closest points and normals against what their shapes say."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mlsanm_cli.cloud.curves import rectangle
from mlsanm_cli.cloud.spacing import Spacing, build_cloud
from mlsanm_cli.contact.geometry.obstacles import Chain, Plane, Round
from mlsanm_cli.contact.geometry.pairing import pair_surfaces

NUMBER = st.floats(-3.0, 3.0)
DOWN = np.array([[0.0, -1.0]])


@given(x=NUMBER, y=NUMBER)
def test_plane(x: float, y: float) -> None:
    partner, normal = Plane((1.0, 0.0), (0.6, 0.8)).closest(np.array([[x, y]]), DOWN)
    assert normal.tolist() == [[0.6, 0.8]]
    assert (partner[0] - [1.0, 0.0]) @ normal[0] == pytest.approx(0.0, abs=1e-14)
    away = np.array([x, y]) - partner[0]
    assert away @ [0.8, -0.6] == pytest.approx(0.0, abs=1e-14)


@given(x=NUMBER, y=NUMBER, inside=st.booleans())
def test_round(x: float, y: float, inside: bool) -> None:
    shape = Round((0.5, -0.5), 2.0, inside)
    partner, normal = shape.closest(np.array([[x, y]]), DOWN)
    assert np.hypot(*(partner[0] - [0.5, -0.5])) == pytest.approx(2.0)
    gap = (np.array([x, y]) - partner[0]) @ normal[0]
    distance = np.hypot(x - 0.5, y + 0.5)
    assert gap == pytest.approx(2.0 - distance if inside else distance - 2.0, abs=1e-13)


@given(x=NUMBER, y=NUMBER)
def test_chain_is_the_nearest_of_its_points(x: float, y: float) -> None:
    corners = np.array([[-1.0, 2.0], [-1.0, 0.0], [1.0, 0.0], [1.0, 2.0]])
    partner, normal = Chain(corners).closest(np.array([[x, y]]), DOWN)
    dense = np.concatenate([np.linspace(a, b, 2001) for a, b in pairwise(corners)])
    nearest = np.linalg.norm(dense - [x, y], axis=1).min()
    away = np.array([x, y]) - partner[0]
    assert np.hypot(*away) == pytest.approx(nearest, abs=1e-3)
    assert np.hypot(*normal[0]) == pytest.approx(1.0)
    # The obstacle lies on the left of the way: between the two upright sides.
    if y < 0.0:
        assert away @ normal[0] == pytest.approx(nearest, abs=1e-3)


def test_a_corner_that_points_outward_turns_the_normal() -> None:
    chain = Chain(np.array([[-1.0, 2.0], [-1.0, 0.0], [1.0, 0.0]]))
    _, normal = chain.closest(np.array([[-2.0, -1.0], [-2.0, 1.0], [0.0, -1.0]]), np.tile(DOWN, (3, 1)))
    assert normal == pytest.approx(np.array([[-(0.5**0.5), -(0.5**0.5)], [-1.0, 0.0], [0.0, -1.0]]))


def test_a_node_on_a_corner_belongs_to_the_side_that_its_surface_faces() -> None:
    chain = Chain(np.array([[-1.0, 2.0], [-1.0, 0.0], [1.0, 0.0], [1.0, 2.0]]))
    corners = np.array([[-1.0, 0.0], [1.0, 0.0]])
    for surface, normals in (
        ([[0.0, 1.0], [0.0, 1.0]], [[0.0, -1.0], [0.0, -1.0]]),
        ([[1.0, 0.0], [-1.0, 0.0]], [[-1.0, 0.0], [1.0, 0.0]]),
    ):
        assert chain.closest(corners, np.array(surface))[1] == pytest.approx(np.array(normals))


def test_nodes_well_beside_a_punch_have_no_partner() -> None:
    cloud = build_cloud(rectangle((-1.0, 1.0), (-1.0, 0.0)), Spacing(0.1), 0)
    punch = Chain(np.array([[-0.35, 1.0], [-0.35, 0.02], [0.35, 0.02], [0.35, 1.0]]))
    pairing = pair_surfaces("under", "block", cloud, cloud.surfaces["top"], punch)
    x = cloud.points[pairing.node, 0]
    assert np.sort(x) == pytest.approx(np.linspace(-0.4, 0.4, 9))
    corner = float(np.hypot(0.05, 0.02))
    assert pairing.gap == pytest.approx(np.where(np.abs(x) < 0.35, 0.02, corner))
    assert (pairing.bodies, pairing.names) == (("block",), ("block.top",))


def test_samples_of_a_smooth_curve_are_that_curve() -> None:
    """Waves from a table: places and normals of the curve itself, fourth and third order in the spacing."""
    off = []
    for count in (161, 321):
        x = np.linspace(0.0, 4.0, count)
        chain = Chain(np.column_stack([x, 1e-2 * np.cos(2.0 * np.pi * x)]))
        assert chain.smooth[1:-1].all()
        points = np.column_stack([np.linspace(0.3, 3.7, 97), np.full(97, -0.02)])
        partner, normal = chain.closest(points, np.tile([0.0, 1.0], (97, 1)))
        slope = -2e-2 * np.pi * np.sin(2.0 * np.pi * partner[:, 0])
        off.append(
            [
                np.abs(partner[:, 1] - 1e-2 * np.cos(2.0 * np.pi * partner[:, 0])).max(),
                np.abs(normal[:, 0] - slope / np.hypot(1.0, slope)).max(),
            ]
        )
    assert off[1][0] < 1e-8
    assert (np.log2(np.divide(off[0], off[1])) > [3.7, 2.7]).all()


@pytest.mark.parametrize(
    "points",
    [
        [[-1.0, 0.02], [0.0, 0.0], [1.0, 0.02]],
        [[-2.0, 0.1], [-1.0, 0.0], [1.0, 0.0], [2.0, 0.1]],
        [[x, 0.05 * abs(x)] for x in np.linspace(-1.0, 1.0, 21)],
        [[np.cos(t), np.sin(t)] for t in np.linspace(0.0, 2.0 * np.pi, 13)],
        [[k, 0.01 * (-1.0) ** (k * k // 3)] for k in range(40)],
    ],
    ids=["blunt wedge", "chamfers", "sampled wedge", "dodecagon", "ragged"],
)
def test_corners_that_are_meant_stay(points: list[list[float]]) -> None:
    assert not Chain(np.array(points)).smooth.any()


def test_rounded_ends_beside_a_flat_face_are_smooth_and_the_face_stays_flat() -> None:
    turn = np.deg2rad(np.arange(0.0, 91.0, 9.0))
    right = np.column_stack([5.0 + np.sin(turn), 1.0 - np.cos(turn)])
    chain = Chain(np.concatenate([right[::-1] * [-1.0, 1.0], right]))
    at = np.array([[0.3, -0.1], [5.0 + np.sin(0.5) * 1.2, 1.0 - np.cos(0.5) * 1.2]])
    partner, normal = chain.closest(at, np.tile([0.0, 1.0], (2, 1)))
    assert partner[0] == pytest.approx([0.3, 0.0], abs=1e-15)
    assert normal[0] == pytest.approx([0.0, -1.0], abs=1e-15)
    assert np.hypot(*(partner[1] - [5.0, 1.0])) == pytest.approx(1.0, abs=1e-4)
    assert normal[1] == pytest.approx([np.sin(0.5), -np.cos(0.5)], abs=1e-3)


def test_the_closest_of_many_sides_is_not_missed() -> None:
    """Sides of random lengths and directions, and two long ones."""
    rng = np.random.default_rng(3)
    x = np.concatenate([np.cumsum(rng.uniform(0.01, 0.2, 60)), 20.0 + np.arange(3.0)])
    points = np.column_stack([x, 0.2 * rng.normal(size=len(x))])
    seen = np.random.default_rng(1).uniform((-8.0, -3.0), (25.0, 2.0), (400, 2))
    partner = Chain(points).closest(seen, np.tile((0.0, 1.0), (400, 1)))[0]
    along = np.diff(points, axis=0)
    share = ((seen[:, None] - points[:-1]) * along).sum(axis=2) / (along**2).sum(axis=1)
    closest = points[:-1] + np.clip(share, 0.0, 1.0)[..., None] * along
    least = np.linalg.norm(seen[:, None] - closest, axis=2).min(axis=1)
    assert np.linalg.norm(seen - partner, axis=1) == pytest.approx(least, rel=1e-12)
