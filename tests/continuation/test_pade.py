"""Denominators of Padé approximants and their poles."""

from __future__ import annotations

import numpy as np
import pytest

from mlsanm_cli.continuation import Branch
from mlsanm_cli.continuation.series import denominator, nearest_pole


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


def test_short_or_overflowing_series_have_none() -> None:
    assert denominator(np.ones((3, 4)), 1.0) is None
    with np.errstate(over="ignore"):
        assert denominator(np.full((8, 4), 1e300) * 1e300, 1.0) is None
