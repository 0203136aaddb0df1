"""Obstacles' closest points and normals against what their shapes say."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mlsanm_cli.cloud.cloud import build_cloud
from mlsanm_cli.cloud.curves import rectangle
from mlsanm_cli.cloud.spacing import Spacing
from mlsanm_cli.contact.obstacles import Chain, Plane, Round
from mlsanm_cli.contact.pairing import pair_obstacle

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
    pairing = pair_obstacle("under", "block", cloud, cloud.surfaces["top"], punch)
    x = cloud.points[pairing.node, 0]
    assert np.sort(x) == pytest.approx(np.linspace(-0.4, 0.4, 9))
    corner = float(np.hypot(0.05, 0.02))
    assert pairing.gap == pytest.approx(np.where(np.abs(x) < 0.35, 0.02, corner))
    assert (pairing.bodies, pairing.names) == (("block",), ("block.top",))
