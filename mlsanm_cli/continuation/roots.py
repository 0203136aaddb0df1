"""Roots of functions of one variable, bracketed by a change of sign."""

from __future__ import annotations

from collections.abc import Callable
from math import copysign

from mlsanm_cli.roundoff import LAST_DIGITS

MAX_ITERATIONS = 200


def root(function: Callable[[float], float], low: float, high: float, least: float = 0.0) -> float:
    """A zero of a ``function`` with different signs at ``low`` and ``high``, to round-off or within
    ``least``.

    Inverse quadratic interpolation where it is reliable, bisection elsewhere (Chandrupatla 1997,
    doi:10.1016/S0965-9978(96)00051-8). Importing scipy.optimize for it would take 0.03 s.
    Raises ValueError for equal signs.
    """
    a, b, f_a, f_b = low, high, function(low), function(high)
    if f_a * f_b > 0.0:
        raise ValueError("no change of sign")
    c, f_c, share = a, f_a, 0.5
    for _ in range(MAX_ITERATIONS):
        best, value = (a, f_a) if abs(f_a) < abs(f_b) else (b, f_b)
        near = (LAST_DIGITS * abs(best) + least) / abs(b - a) if b != a else 1.0
        if value == 0.0 or near >= 1.0:
            break
        x = a + min(max(share, 0.5 * near), 1.0 - 0.5 * near) * (b - a)
        f_x = function(x)
        if copysign(1.0, f_x) == copysign(1.0, f_a):
            c, f_c = a, f_a
        else:
            c, b, f_c, f_b = b, a, f_b, f_a
        a, f_a, share = x, f_x, 0.5
        if f_c != f_b:
            place, height = (a - b) / (c - b), (f_a - f_b) / (f_c - f_b)
            if height**2 < place and (1.0 - height) ** 2 < 1.0 - place:
                share = f_a / (f_b - f_a) * f_c / (f_b - f_c)
                share += (c - a) / (b - a) * f_a / (f_c - f_a) * f_b / (f_c - f_b)
    return best
