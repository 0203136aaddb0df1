"""The plate with a hole against equilibrium, compatibility and its boundary conditions."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.formulas.kirsch import KirschHole
from mlsanm_cli.arrays import FloatArray

HOLE = KirschHole(0.7, 3.0)
STEP = 1e-4


def ring(radius: float) -> tuple[FloatArray, FloatArray]:
    """Points and outward directions (24, 2) on a circle."""
    angle = np.linspace(0.1, 6.3, 24)
    direction = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    return radius * direction, direction


def test_the_hole_is_free_and_its_sides_carry_three_times_the_tension() -> None:
    points, n = ring(0.7)
    xx, yy, xy = HOLE.stress(points).T
    assert np.abs(xx * n[:, 0] + xy * n[:, 1]).max() <= 1e-13
    assert np.abs(xy * n[:, 0] + yy * n[:, 1]).max() <= 1e-13
    assert HOLE.stress(np.array([[0.0, 0.7]]))[0] == pytest.approx([9.0, 0.0, 0.0], abs=1e-13)
    assert HOLE.stress(np.array([[0.7, 0.0]]))[0] == pytest.approx([0.0, -3.0, 0.0], abs=1e-13)


def test_far_away_the_tension_is_left() -> None:
    points, _ = ring(700.0)
    assert HOLE.stress(points) == pytest.approx(np.tile([3.0, 0.0, 0.0], (24, 1)), abs=1e-5)


def test_equilibrium_and_compatibility() -> None:
    points, _ = ring(1.1)
    move = STEP * np.eye(2)
    by_x, by_y = ((HOLE.stress(points + m) - HOLE.stress(points - m)) / (2.0 * STEP) for m in move)
    assert np.abs(by_x[:, 0] + by_y[:, 2]).max() <= 1e-6
    assert np.abs(by_x[:, 2] + by_y[:, 1]).max() <= 1e-6
    # Compatible without body force: the sum of the normal stresses is harmonic.
    total = [HOLE.stress(points + m)[:, :2].sum(axis=1) for m in (*move, *-move, 0.0 * move[0])]
    assert np.abs(sum(total[:4]) - 4.0 * total[4]).max() / STEP**2 <= 1e-4
