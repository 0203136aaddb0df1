"""Smoothing of displacements along contact grids."""

import numpy as np
import pytest

from mlsanm_cli.contact.geometry.panels import chebyshev
from mlsanm_cli.contact.response.smoothing import smoothing


def test_smoothing_keeps_resolved_waves_and_linear_displacements() -> None:
    angle = chebyshev(0.0, np.pi, 48)
    points = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    project = smoothing(points, np.pi, 0.19)
    assert project is not None
    kept = [np.ones(48), points[:, 0], points[:, 1], np.sin(2.0 * angle)]
    for values in kept:
        assert project @ values == pytest.approx(values, abs=2e-3)
    assert project @ points == pytest.approx(points, abs=1e-12)
    # Chebyshev polynomials resolve more towards the ends.
    middle = np.abs(angle - 0.5 * np.pi) < 0.3 * np.pi
    noise = np.sin(2.0 * np.pi * angle / (2.5 * 0.19))
    assert np.abs((project @ noise)[middle]).max() <= 0.3
    assert smoothing(points, np.pi, 0.01) is None


def test_around_a_closed_surface_both_ends_move_together() -> None:
    # Polynomials that ended elsewhere made a peak of pressure there.
    angle = chebyshev(0.0, 2.0 * np.pi, 48)
    points = np.stack([2.0 * np.cos(angle), np.sin(angle)], axis=1)
    project = smoothing(points, 10.0, 0.3, closed=True)
    assert project is not None
    assert project @ np.cos(4.0 * angle) == pytest.approx(np.cos(4.0 * angle), abs=1e-9)
    rough = project @ np.random.default_rng(3).normal(size=48)
    assert abs(rough[0] - rough[-1]) <= 0.02 * np.abs(rough).max()
