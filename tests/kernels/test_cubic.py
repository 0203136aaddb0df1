"""Interpolation over even grids against a polynomial through four rows."""

from __future__ import annotations

import numpy as np
import pytest

from mlsanm_cli.kernels.radial import cubic_rows


def test_interpolation_is_the_polynomial_through_four_rows() -> None:
    table = np.random.default_rng(0).normal(size=(9, 3))
    at = np.array([1.0, 1.3, 2.0, 4.6, 5.999, 6.0])
    expected = [
        np.polynomial.Polynomial.fit(rows, column[rows], 3)(x)
        for x in at
        for rows in [np.arange(min(int(x), 5) - 1, min(int(x), 5) + 3)]
        for column in table.T
    ]
    assert cubic_rows(table, at).ravel() == pytest.approx(expected, abs=1e-12)
    ends = cubic_rows(table, np.array([-3.0, 0.5, 8.0, np.nan]))
    assert ends[:3] == pytest.approx(cubic_rows(table, np.array([1.0, 1.0, 6.0])))
    assert np.isnan(ends[3]).all()
