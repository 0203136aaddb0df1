from __future__ import annotations

import math

import pytest

from mlsanm_cli.continuation.roots import root


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


def test_a_tolerance_saves_evaluations_and_equal_signs_have_no_root() -> None:
    asked: list[float] = []

    def level(x: float) -> float:
        asked.append(x)
        return math.tanh(5.0 * x - 1.0)

    assert root(level, 0.0, 1.0, 1e-3) == pytest.approx(0.2, abs=1e-3)
    assert len(asked) <= 8
    with pytest.raises(ValueError, match="sign"):
        root(math.cosh, 0.0, 1.0)
