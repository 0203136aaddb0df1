"""Zones that give every node the spacing it asks for."""

from __future__ import annotations

import numpy as np

from mlsanm_cli.cloud.mirror import SymmetryLine
from mlsanm_cli.cloud.spacing import LIMIT, SPACING_TOLERANCE, Spacing, Zone, cover

X = np.linspace(-1.0, 1.0, 41)
POINTS = np.stack(np.meshgrid(X, X), axis=-1).reshape(-1, 2)
HAS = np.full(len(POINTS), 0.05)


def test_nodes_get_what_they_want_and_little_more() -> None:
    wanted = np.where(np.hypot(*(POINTS - [0.4, 0.1]).T) < 0.3, 0.02, np.inf)
    spacing = Spacing(0.05)
    zones = cover(POINTS, HAS, wanted, spacing, 0.2)
    assert 1 <= len(zones) <= 12
    finer = spacing.with_zones(zones).at(POINTS)
    assert (finer <= SPACING_TOLERANCE * wanted).all()
    away = np.hypot(*(POINTS - [0.4, 0.1]).T) > 0.7
    np.testing.assert_array_equal(finer[away], 0.05)


def test_what_is_planned_already_is_not_asked_for_again() -> None:
    wanted = np.full(len(POINTS), np.inf)
    wanted[0] = 0.02
    planned = Spacing(0.05, (Zone.around((-1.0, -1.0), 0.02, 0.1, 0.2),))
    assert cover(POINTS, HAS, wanted, planned, 0.2) == ()
    assert cover(POINTS, HAS, np.full(len(POINTS), np.inf), Spacing(0.05), 0.2) == ()


def test_a_few_dense_nodes_do_not_make_a_wide_zone() -> None:
    # Many nodes on a speck want little spacings; by number alone they would outvote all others.
    speck = 1e-3 * POINTS
    points = np.concatenate([speck, POINTS])
    has = np.concatenate([np.full(len(speck), 5e-5), HAS])
    wanted = np.concatenate([np.full(len(speck), 2e-5), np.full(len(POINTS), np.inf)])
    (zone, *others) = cover(points, has, wanted, Spacing(0.05), 0.2)
    assert all(one.radius <= 0.01 for one in (zone, *others))
    assert len(others) < LIMIT


def test_what_is_wanted_symmetrically_is_given_symmetrically() -> None:
    x, y = np.abs(POINTS[:, 0]), POINTS[:, 1]
    adjacent, upon = np.hypot(x - 0.5, y - 0.1) < 0.25, np.hypot(x - 0.01, y + 0.6) < 0.2
    wanted = np.where(adjacent, 0.02, np.where(upon, 0.025, np.inf))
    spacing = Spacing(0.05)
    for line in (SymmetryLine(0, 0.0), SymmetryLine(1, 0.3)):
        points = POINTS if line.axis == 0 else POINTS[:, ::-1] + [0.0, 0.3]
        assert not spacing.with_zones(cover(points, HAS, wanted, spacing, 0.2)).symmetric(line)
        zones = cover(points, HAS, wanted, spacing, 0.2, line)
        assert spacing.with_zones(zones).symmetric(line)
        assert (spacing.with_zones(zones).at(points) <= SPACING_TOLERANCE * wanted).all()
        places = [row[1:3] for row in Spacing(0.05, zones).table()]
        assert any(place[line.axis] == line.at for place in places)
