"""Brent's method against scipy's, and where there is no root."""

from __future__ import annotations

import math
import sys
from collections.abc import Callable

import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import brentq

from mlsanm_cli.errors import NumericalError
from mlsanm_cli.roots import PRECISION, root

FUNCTIONS: tuple[tuple[Callable[[float], float], float, float], ...] = (
    (lambda a: a - 0.3, 0.0, 1.0),
    (lambda a: math.cos(a) - a, 0.0, 1.0),
    (lambda a: a**9 - 1e-3, 0.0, 1.0),
    (lambda a: math.exp(30.0 * a) - 5.0, -1.0, 1.0),
    (lambda a: math.atan(1e4 * (a - 0.7)), 0.0, 1.0),
    (lambda a: math.copysign(1.0, a - 0.123), 0.0, 1.0),
    (lambda a: 1.0 - a, 0.0, 3.0),
)


def watched(function: Callable[[float], float]) -> tuple[Callable[[float], float], list[float]]:
    """The function, and where it has been asked for."""
    seen: list[float] = []

    def counted(a: float) -> float:
        seen.append(a)
        return function(a)

    return counted, seen


@pytest.mark.parametrize(("function", "low", "high"), FUNCTIONS)
def test_the_root_is_scipys(function: Callable[[float], float], low: float, high: float) -> None:
    expected, told = brentq(
        function, low, high, xtol=1e-300, rtol=4.0 * sys.float_info.epsilon, full_output=True
    )
    counted, seen = watched(function)
    assert root(counted, low, high) == pytest.approx(expected, rel=2.0 * PRECISION, abs=0.0)
    assert len(seen) <= 1.2 * told.function_calls + 2
    assert root(function, high, low) == pytest.approx(expected, rel=2.0 * PRECISION, abs=0.0)


@given(st.floats(-2.0, 2.0), st.floats(0.1, 5.0), st.floats(0.1, 3.0))
def test_it_takes_few_evaluations_of_a_smooth_function(place: float, curve: float, width: float) -> None:
    seen: list[float] = []

    def function(a: float) -> float:
        seen.append(a)
        return math.sinh(curve * (a - place))

    found = root(function, place - width, place + 1.3 * width, absolute=1e-12)
    assert abs(found - place) <= 1e-12 + PRECISION * abs(place)
    assert len(seen) <= 40


def test_a_root_at_an_end_is_that_end() -> None:
    assert root(lambda a: a - 1.0, 1.0, 2.0) == 1.0
    assert root(lambda a: a - 2.0, 1.0, 2.0) == 2.0


def test_without_a_change_of_sign_or_numbers_there_is_none() -> None:
    with pytest.raises(ValueError, match="no change of sign"):
        root(lambda a: a + 1.0, 0.0, 1.0)
    counted, seen = watched(lambda a: a - 0.5 if a in (0.0, 1.0) else math.nan)
    with pytest.raises(NumericalError, match="no root"):
        root(counted, 0.0, 1.0)
    assert len(seen) == 3
