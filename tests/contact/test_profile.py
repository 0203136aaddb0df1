"""Half width of known pressure profiles."""

from __future__ import annotations

import numpy as np
import pytest

from mlsanm_cli.contact.geometry.profile import THRESHOLD, half_width


def test_a_triangle_is_exact() -> None:
    # Nodes 0.1 apart, peak 1 at 0.5, zero from 0 and 1 outwards: down to 1 % at 0.01 and 0.99... on the line.
    arc = np.linspace(-0.5, 1.5, 21)
    pressure = np.maximum(0.0, 1.0 - np.abs(arc - 0.5) / 0.5)
    assert half_width(arc, pressure) == pytest.approx(0.5 * (1.0 - THRESHOLD), rel=1e-12)


def test_crossings_lie_between_the_nodes() -> None:
    arc = np.array([0.0, 1.0, 2.0, 3.0])
    assert half_width(arc, np.array([0.0, 1.0, 0.0, 0.0])) == pytest.approx(0.99)
    # Uneven nodes, 100 falling to 0 over a distance of 4 on the right and 1 on the left.
    uneven = np.array([0.0, 1.0, 5.0, 6.0])
    assert half_width(uneven, np.array([0.0, 100.0, 0.0, 0.0])) == pytest.approx(0.5 * 0.99 * 5.0)


def test_outermost_crossings_count() -> None:
    arc = np.arange(7.0)
    two_peaks = np.array([0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0])
    assert half_width(arc, two_peaks) == pytest.approx(2.0 + 0.99)


def test_a_profile_that_reaches_the_last_node_ends_there() -> None:
    assert half_width(np.array([0.0, 0.5, 2.0]), np.ones(3)) == 1.0


def test_nothing_pressed_has_no_width() -> None:
    assert half_width(np.arange(3.0), np.zeros(3)) == 0.0
    assert half_width(np.arange(3.0), -np.ones(3)) == 0.0
    assert half_width(np.zeros(0), np.zeros(0)) == 0.0


def test_a_contact_across_the_start_of_a_closed_surface_is_one() -> None:
    arc = np.linspace(0.0, 10.0, 40, endpoint=False)
    away = np.minimum(arc, 10.0 - arc)
    pressure = np.sqrt(np.maximum(1.0 - away**2, 0.0))
    shifted = half_width(arc, np.roll(pressure, 12))
    assert abs(half_width(arc, pressure, 10.0) - shifted) < 1e-12
    assert abs(half_width(arc, np.roll(pressure, 12), 10.0) - shifted) < 1e-12
    assert half_width(arc, np.ones(40), 10.0) == 5.0
