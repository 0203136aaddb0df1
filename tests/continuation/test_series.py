"""Pieces of path: evaluation, roots of the load factor, Padé form."""

from __future__ import annotations

import math

import numpy as np
import pytest

from mlsanm_cli.continuation.series import Branch, denominator, nearest_pole, root


def polynomial(*lam: float, length: float = 1.0) -> Branch:
    """Return a piece whose one unknown is twice its load factor."""
    coefficients = np.array(lam)
    return Branch(2.0 * coefficients[:, None], coefficients, length)


def test_parameter_at_is_exact_to_round_off() -> None:
    rng = np.random.default_rng(2)
    branch = polynomial(0.1, 1.0, -0.2, 0.05, 0.3, length=0.9)
    for level in rng.uniform(0.1, branch.load_factor(0.9), 50):
        assert branch.load_factor(branch.parameter_at(level)) == pytest.approx(level, rel=4e-16)


def test_both_ends_belong_to_the_piece() -> None:
    branch = polynomial(0.1, 0.7, 0.1, length=0.3)
    assert branch.parameter_at(0.1) == 0.0
    assert branch.parameter_at(float(np.nextafter(0.1, 0.0))) == 0.0
    assert branch.parameter_at(branch.load_factor(0.3)) == pytest.approx(0.3, rel=1e-14)


@pytest.mark.parametrize("level", [0.0999, 0.3381, -5.0, 5.0])
def test_load_factor_outside_is_refused(level: float) -> None:
    branch = polynomial(0.1, 0.7, 0.1, length=0.3)
    with pytest.raises(ValueError, match="not reached"):
        branch.parameter_at(level)


def test_first_of_two_crossings_beside_a_fold_is_found() -> None:
    # lam = 1 - (a - 1/2)^2: a fold at a = 1/2
    branch = polynomial(0.75, 1.0, -1.0)
    assert branch.parameter_at(0.84) == pytest.approx(0.1, rel=1e-13)


@pytest.mark.parametrize("fold", [0.0041, 0.0141, 0.5031, 0.98, 0.991, 0.997])
def test_crossings_hidden_between_samples_are_found(fold: float) -> None:
    for side in (1.0, -1.0):  # a maximum, a minimum
        branch = polynomial(side * (1.0 - fold**2), side * 2.0 * fold, -side)
        found = branch.parameter_at(side * (1.0 - 1e-7))
        assert found == pytest.approx(fold - np.sqrt(1e-7), abs=1e-10)
        assert branch.first_crossing(side * (1.0 + 1e-7)) is None


def test_round_off_bounds_the_digits_lost() -> None:
    # Denominator 1 - a/2, numerator terms of size 1e6 and opposite sign that cancel at a = 1
    big = 1e6
    branch = Branch(np.array([[0.0], [big], [-0.5 * big - big]]), np.zeros(3), 1.0, np.array([1.0, 0.5]))
    assert abs(branch.evaluate(1.0)[0][0]) <= branch.round_off(1.0, np.ones(1))
    assert branch.round_off(1.0, np.ones(1)) == pytest.approx(2.0 * big / 1.5 * 2.2e-16, rel=0.02)
    assert branch.round_off(1.0, np.full(1, big)) == pytest.approx(2.0 / 1.5 * 2.2e-16, rel=0.02)


def rational_series(poles: list[complex], size: int, order: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the series of vectors sum_i v_i/(1 - a/pole_i), real, and the vectors' sum at a = 0.9."""
    rng = np.random.default_rng(5)
    residues = rng.normal(size=(len(poles), size))
    values = np.array(poles)
    coefficients = np.real((1.0 / values) ** np.arange(order + 1.0)[:, None] @ residues)
    return coefficients, np.real((1.0 / (1.0 - 0.9 / values)) @ residues)


@pytest.mark.parametrize("size", [2, 40])
@pytest.mark.parametrize("order", [12, 20])
def test_common_poles_are_found(size: int, order: int) -> None:
    poles = [1.0 + 0.0j, -1.3 + 0.0j, 0.5 + 1.2j, 0.5 - 1.2j]
    coefficients, _ = rational_series(poles, size, order)
    coefficients[0] += 5.0  # the start point is free: only the path from there is rational
    lower = denominator(coefficients, 0.5)
    assert lower is not None
    assert lower[0] == 1.0
    assert nearest_pole(lower, 2.0) == pytest.approx(1.0, rel=1e-6)


def test_approximant_is_exact_where_the_series_diverges() -> None:
    poles = [-0.5 + 0.0j, -0.8 + 0.0j, -0.3 + 0.6j, -0.3 - 0.6j]
    coefficients, value = rational_series(poles, 10, 15)
    lower = denominator(coefficients, 0.3)
    assert lower is not None
    branch = Branch(coefficients, np.zeros(16), 1.0, lower)
    np.testing.assert_allclose(branch.evaluate(0.9)[0], value, rtol=1e-5)
    taylor = Branch(coefficients, np.zeros(16), 1.0)
    assert np.abs(taylor.evaluate(0.9)[0] - value).max() > 10.0


@pytest.mark.parametrize(
    ("function", "low", "high", "expected"),
    [
        (math.cos, 1.0, 2.0, math.pi / 2),
        (lambda x: x**3 - 2.0, 2.0, 0.0, 2.0 ** (1 / 3)),
        (lambda x: (x - 1.0) ** 9, 0.0, 3.3, 1.0),
        (lambda x: math.copysign(1.0, x - 0.3), 0.0, 1.0, 0.3),
        (lambda x: math.exp(-50.0 * x) - 1e-15, 0.0, 5.0, 15.0 * math.log(10.0) / 50.0),
        (lambda x: x, 0.0, 1.0, 0.0),
        (lambda x: x - 1.0, 0.0, 1.0, 1.0),
    ],
)
def test_roots_are_found_to_round_off(function, low, high, expected) -> None:  # type: ignore[no-untyped-def]
    asked: list[float] = []

    def counted(x: float) -> float:
        asked.append(x)
        return float(function(x))

    found = root(counted, low, high)
    assert function(found) == 0.0 or found == pytest.approx(expected, rel=1e-15)
    assert len(asked) <= 70
