"""Nodes along curves: equal increments of the integral of ds/h."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import quad

from mlsanm_cli.app.checks.refinement import MAX_ZONES, SPACING_TOLERANCE, cover
from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.cloud.cloud import SymmetryLine
from mlsanm_cli.cloud.curves import Arc, Curve, Segment
from mlsanm_cli.cloud.spacing import Spacing, Zone

LINE = Segment((-2.0, 0.0), (2.0, 0.0))


def density_integrals(spacing: Spacing, curve: Curve, s: FloatArray) -> FloatArray:
    """Integral of ds/h over every step, by adaptive quadrature."""
    return np.array(
        [
            quad(lambda t: 1.0 / float(spacing.at(curve.points(np.array([t])))[0]), a, b, limit=200)[0]
            for a, b in pairwise(s)
        ]
    )


@pytest.mark.parametrize("curve", [LINE, Arc((0.0, 1.0), 1.0, math.pi, math.pi)])
def test_steps_are_equal_in_the_integral_of_one_over_h(curve: Curve) -> None:
    spacing = Spacing(
        0.3, (Zone.around((0.1, 0.0), 0.01, 0.05, 0.15), Zone.around((1.0, 0.9), 0.05, 0.1, 0.1))
    )
    s = spacing.steps_along(curve)
    assert (s[0], s[-1]) == (0.0, curve.length)
    parts = density_integrals(spacing, curve, s)
    # Most are equal to 0.1 %; the samples see a kink of h between them to a few per cent only.
    assert np.median(np.abs(parts / np.median(parts) - 1.0)) <= 1e-3
    assert parts == pytest.approx(parts.mean(), rel=0.03)
    assert len(parts) == round(parts.sum())


@given(
    far=st.floats(0.1, 1.0),
    at=st.floats(-2.0, 2.0),
    fine=st.floats(1e-4, 0.05),
    radius=st.floats(0.0, 0.3),
    growth=st.floats(0.05, 0.5),
)
def test_ends_are_kept_and_steps_follow_the_spacing(
    far: float, at: float, fine: float, radius: float, growth: float
) -> None:
    spacing = Spacing(far, (Zone.around((at, 0.0), fine, radius, growth),))
    s = spacing.steps_along(LINE)
    assert (s[0], s[-1]) == (0.0, LINE.length)
    steps = np.diff(s)
    assert (steps > 0.0).all()
    inside = s[:-1, None] + np.linspace(0.0, 1.0, 41) * steps[:, None]
    h = spacing.at(LINE.points(inside.ravel())).reshape(inside.shape)
    # N increments instead of the integral's exact value stretch the steps by at most half of one in N.
    stretch = 1.03 * (1.0 + 0.51 / max(len(steps) - 0.5, 0.5))
    assert (steps <= h.max(axis=1) * stretch).all()
    assert (steps >= h.min(axis=1) / stretch).all() or len(steps) == 2


@given(at=st.floats(-1.5, 1.5), fine=st.floats(1e-4, 1e-2))
def test_a_fine_zone_stays_where_it_was_asked_for(at: float, fine: float) -> None:
    spacing = Spacing(0.5, (Zone.around((at, 0.0), fine, 20.0 * fine, 0.12),))
    x = spacing.steps_along(LINE) - 2.0
    middle = 0.5 * (x[1:] + x[:-1])
    within = middle[np.diff(x) < 1.05 * fine]
    assert 0.5 * (within[0] + within[-1]) == pytest.approx(at, abs=2.0 * fine)
    assert 0.5 * (within[-1] - within[0]) == pytest.approx(20.0 * fine, abs=3.0 * fine)


@pytest.mark.parametrize(
    ("far", "at", "fine", "growth"),
    [(1.0, 0.123_456, 1e-6, 0.2), *((0.004, at, 1e-4, 1.0) for at in (0.1, 0.104, 0.108, 0.112))],
)
def test_a_narrow_zone_is_not_missed(far: float, at: float, fine: float, growth: float) -> None:
    """Of a millionth of the spacing; or narrower than the distance of the first samples, 0.0156."""
    x = Spacing(far, (Zone.around((at, 0.0), fine, 10.0 * fine, growth),)).steps_along(LINE) - 2.0
    assert np.count_nonzero(np.abs(x - at) <= 10.0 * fine) == pytest.approx(21, abs=2)


def test_an_even_curve_is_cut_into_equal_steps() -> None:
    assert np.diff(Spacing(0.3).steps_along(LINE)) == pytest.approx(4.0 / 13.0, rel=1e-12)
    # Halves: the same number in every system of units.
    for unit in (1.0, 1e-3, 1e3, 0.0254):
        segment = Segment((0.0, 0.0), (unit, 0.0))
        assert len(Spacing(unit / 2.5).steps_along(segment)) == 3


def test_short_curves_keep_a_node_in_their_middle_and_circles_eight() -> None:
    assert len(Spacing(100.0).steps_along(LINE)) == 3
    assert len(Spacing(100.0).steps_along(Arc((0.0, 0.0), 1.0, 0.0, 2.0 * math.pi))) == 9


X = np.linspace(-1.0, 1.0, 41)
POINTS = np.stack(np.meshgrid(X, X), axis=-1).reshape(-1, 2)
HAS = np.full(len(POINTS), 0.05)


def test_nodes_get_what_they_want_and_little_more() -> None:
    wanted = np.where(np.hypot(*(POINTS - [0.4, 0.1]).T) < 0.3, 0.02, np.inf)
    spacing = Spacing(0.05)
    zones = cover(POINTS, HAS, wanted, spacing)
    assert 1 <= len(zones) <= 12
    finer = spacing.with_zones(zones).at(POINTS)
    assert (finer <= SPACING_TOLERANCE * wanted).all()
    away = np.hypot(*(POINTS - [0.4, 0.1]).T) > 0.7
    np.testing.assert_array_equal(finer[away], 0.05)


def test_what_is_planned_already_is_not_asked_for_again() -> None:
    wanted = np.full(len(POINTS), np.inf)
    wanted[0] = 0.02
    planned = Spacing(0.05, (Zone.around((-1.0, -1.0), 0.02, 0.1, 0.2),))
    assert cover(POINTS, HAS, wanted, planned) == ()
    assert cover(POINTS, HAS, np.full(len(POINTS), np.inf), Spacing(0.05)) == ()


def test_a_few_dense_nodes_do_not_make_a_wide_zone() -> None:
    # Many nodes on a speck want little spacings; by number alone they would outvote all others.
    speck = 1e-3 * POINTS
    points = np.concatenate([speck, POINTS])
    has = np.concatenate([np.full(len(speck), 5e-5), HAS])
    wanted = np.concatenate([np.full(len(speck), 2e-5), np.full(len(POINTS), np.inf)])
    (zone, *others) = cover(points, has, wanted, Spacing(0.05))
    assert all(one.radius <= 0.01 for one in (zone, *others))
    assert len(others) < MAX_ZONES


def test_what_is_wanted_symmetrically_is_given_symmetrically() -> None:
    x, y = np.abs(POINTS[:, 0]), POINTS[:, 1]
    adjacent, upon = np.hypot(x - 0.5, y - 0.1) < 0.25, np.hypot(x - 0.01, y + 0.6) < 0.2
    wanted = np.where(adjacent, 0.02, np.where(upon, 0.025, np.inf))
    spacing = Spacing(0.05)
    for line in (SymmetryLine(0, 0.0), SymmetryLine(1, 0.3)):
        points = POINTS if line.axis == 0 else POINTS[:, ::-1] + [0.0, 0.3]
        assert not spacing.with_zones(cover(points, HAS, wanted, spacing)).symmetric(line)
        zones = cover(points, HAS, wanted, spacing, line)
        assert spacing.with_zones(zones).symmetric(line)
        assert (spacing.with_zones(zones).at(points) <= SPACING_TOLERANCE * wanted).all()
        places = [row[1:3] for row in Spacing(0.05, zones).table()]
        assert any(place[line.axis] == line.at for place in places)
