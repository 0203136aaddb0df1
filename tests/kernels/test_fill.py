"""The advancing front against a slow twin, and its parts against their definitions."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial import cKDTree
from scipy.spatial.distance import cdist

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.cloud import spacing as slices
from mlsanm_cli.cloud.curves import Arc, Outline, Segment, disk, rectangle
from mlsanm_cli.cloud.membership import inside_polygon
from mlsanm_cli.cloud.spacing import CANDIDATES, Spacing, Zone, build_cloud, fill_region
from mlsanm_cli.errors import RunError
from mlsanm_cli.kernels.fill import spacing_at

SQUARE = rectangle((0.0, 1.0), (0.0, 1.0))


def front(outline: Outline, spacing: Spacing, seed: int) -> tuple[FloatArray, int]:
    """Nodes (n, 2) as the front leaves them, and how many of them lie on the boundary."""
    chain = np.concatenate([curve.points(spacing.steps_along(curve)[:-1]) for curve in outline.curves])
    edges = np.hstack([chain, np.roll(chain, -1, axis=0)])
    points = fill_region(chain, edges, spacing, seed, 10**6)
    return points, len(chain)


def slow_front(outline: Outline, spacing: Spacing, seed: int) -> FloatArray:
    """The front as described: every candidate compared with every accepted node and every edge."""
    chain = np.concatenate([curve.points(spacing.steps_along(curve)[:-1]) for curve in outline.curves])
    edges = np.hstack([chain, np.roll(chain, -1, axis=0)])
    points = [tuple(p) for p in chain]
    word = 2**64
    state = (seed * 2 + 1) * 0x9E3779B97F4A7C15 % word
    parent = 0
    while parent < len(points):
        state = (state * 6364136223846793005 + 1442695040888963407) % word
        turn = (state >> 11) / 2**53
        x, y = points[parent]
        h = float(spacing.at(np.array([[x, y]]))[0])
        for number in range(CANDIDATES):
            angle = 2.0 * math.pi * (number + turn) / CANDIDATES
            new = np.array([[x + h * math.cos(angle), y + h * math.sin(angle)]])
            radius = min(h, float(spacing.at(new)[0])) * (1.0 - 1e-9)
            if cdist(new, np.array(points)).min() >= radius and inside_polygon(edges, new)[0]:
                points.append((float(new[0, 0]), float(new[0, 1])))
        parent += 1
    return np.array(points)


zones = st.lists(
    st.builds(
        lambda x, y, h, r, g: Zone.around((x, y), h, r, g),
        st.floats(0.0, 1.0),
        st.floats(0.0, 1.0),
        st.floats(0.03, 0.2),
        st.floats(0.0, 0.1),
        st.floats(0.05, 0.4),
    ),
    max_size=2,
)


@settings(max_examples=8)
@given(far=st.floats(0.12, 0.3), zones=zones, seed=st.integers(0, 2**31), round_=st.booleans())
def test_front_is_its_slow_twin(far: float, zones: list[Zone], seed: int, round_: bool) -> None:
    outline = disk((0.5, 0.5), 0.6) if round_ else SQUARE
    spacing = Spacing(far, tuple(zones))
    points, _ = front(outline, spacing, seed)
    expected = slow_front(outline, spacing, seed)
    assert points.shape == expected.shape
    assert np.abs(points - expected).max() <= 1e-9


def test_a_front_that_outgrows_its_limit_is_refused() -> None:
    with pytest.raises(RunError, match="more than 200 nodes"):
        build_cloud(SQUARE, Spacing(0.02), 0, limit=200)
    whole = len(build_cloud(SQUARE, Spacing(0.1), 0).points)
    assert len(build_cloud(SQUARE, Spacing(0.1), 0, limit=whole + 1).points) == whole


def test_tables_that_grow_lose_no_node() -> None:
    # More than 8192 / 4 cells: the hash table is rebuilt several times on the way.
    points, boundary = front(SQUARE, Spacing(0.2, (Zone.around((0.5, 0.5), 0.004, 0.1, 0.05),)), 0)
    assert len(points) > 5000
    apart = np.asarray(cKDTree(points).query(points[boundary:], k=2)[0])[:, 1]
    h = Spacing(0.2, (Zone.around((0.5, 0.5), 0.004, 0.1, 0.05),)).at(points[boundary:])
    assert (apart >= (1.0 - 1e-9) * h / 1.05 / 1.05).all()


@pytest.mark.parametrize(
    "curve",
    [
        Segment((0.2, 0.3), (1.1, -0.4)),
        Segment((0.4, 0.4), (0.4, 0.4)),
        Arc((0.1, 0.2), 0.7, 0.4, 2.1),
        Arc((0.1, 0.2), 0.7, 5.5, 3.0),
        Arc((0.1, 0.2), 0.7, 1.0, -2.5),
        Arc((0.0, 0.0), 0.5, 1.0, 2.0 * math.pi),
    ],
)
def test_spacing_grows_with_the_distance_to_the_zone(curve: Segment | Arc) -> None:
    points = np.random.default_rng(2).uniform(-2.0, 2.0, (400, 2))
    s = np.linspace(0.0, curve.length, 20_001)
    on_curve = curve.points(s) if curve.length > 0.0 else np.array([curve.start])
    distance = cdist(points, on_curve).min(axis=1)
    zone = Zone(curve, 0.1, 0.3, 0.5)
    expected = np.minimum(0.8, 0.1 + 0.5 * np.maximum(0.0, distance - 0.3))
    assert np.abs(spacing_at(0.8, Spacing(0.8, (zone,)).table(), points) - expected).max() <= 1e-6


def test_of_several_zones_the_finest_holds() -> None:
    first, second = Zone.around((0.0, 0.0), 0.1, 0.1, 0.2), Zone.around((1.0, 0.0), 0.05, 0.2, 0.4)
    points = np.random.default_rng(0).uniform(-1.0, 2.0, (100, 2))
    both = Spacing(0.3, (first, second)).at(points)
    alone = np.minimum(Spacing(0.3, (first,)).at(points), Spacing(0.3, (second,)).at(points))
    assert np.array_equal(both, alone)
    assert len(np.unique(both)) > 30


def test_slices_change_no_node(monkeypatch: pytest.MonkeyPatch) -> None:
    spacing = Spacing(0.02, (Zone.around((0.3, 0.4), 0.002, 0.01, 0.1),))
    whole, _ = front(SQUARE, spacing, 3)
    monkeypatch.setattr(slices, "FIRST_PARENTS", 1)
    monkeypatch.setattr(slices, "SLICE_SECONDS", 1e-9)
    pieces, _ = front(SQUARE, spacing, 3)
    assert len(whole) > 3000
    assert np.array_equal(whole, pieces)
