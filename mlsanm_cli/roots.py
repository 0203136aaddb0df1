"""A root of a function of one variable.

R. P. Brent, Algorithms for minimization without derivatives, Prentice-Hall 1973, chapter 4: inverse quadratic
interpolation while it converges, halves of the bracket where it does not.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Callable

from mlsanm_cli.errors import NumericalError

PRECISION = 4.0 * sys.float_info.epsilon
"""The finest relative precision of a root."""
ITERATIONS = 200


def root(function: Callable[[float], float], low: float, high: float, absolute: float = 1e-300) -> float:
    """A root between ``low`` and ``high``, where the values of ``function`` differ in sign or are zero.

    It is found to `PRECISION` times its size and ``absolute``. Raises ValueError where the signs are equal,
    NumericalError if the function has no number somewhere.
    """
    a, b = low, high
    fa, fb = function(a), function(b)
    if fa == 0.0 or fb == 0.0:
        return a if fa == 0.0 else b
    if (fa < 0.0) == (fb < 0.0):
        raise ValueError(f"no change of sign between {low!r} and {high!r}")
    # b is the best so far, c on the other side of the root, a the b before.
    c, fc = a, fa
    step = before = b - a
    for _ in range(ITERATIONS):
        if (fb < 0.0) == (fc < 0.0):
            c, fc = a, fa
            step = before = b - a
        if abs(fc) < abs(fb):
            a, b, c = b, c, b
            fa, fb, fc = fb, fc, fb
        close = 0.5 * (absolute + PRECISION * abs(b))
        half = 0.5 * (c - b)
        if fb == 0.0 or abs(half) <= close:
            return b
        step, before = _step(a, b, c, fa, fb, fc, half, close, step, before)
        a, fa = b, fb
        b += step if abs(step) > close else (close if half > 0.0 else -close)
        fb = function(b)
        if math.isnan(fb):
            break
    raise NumericalError(f"no root was found between {low!r} and {high!r}")


def _step(
    a: float,
    b: float,
    c: float,
    fa: float,
    fb: float,
    fc: float,
    half: float,
    close: float,
    step: float,
    before: float,
) -> tuple[float, float]:
    """The next step from ``b`` and the one before it."""
    if abs(before) < close or abs(fa) <= abs(fb):
        return half, half
    s = fb / fa
    if a == c:
        p, q = 2.0 * half * s, 1.0 - s
    else:
        r, t = fa / fc, fb / fc
        p = s * (2.0 * half * r * (r - t) - (b - a) * (t - 1.0))
        q = (r - 1.0) * (t - 1.0) * (s - 1.0)
    if p > 0.0:
        q = -q
    p = abs(p)
    if 2.0 * p < min(3.0 * half * q - abs(close * q), abs(before * q)):
        return p / q, step
    return half, half
