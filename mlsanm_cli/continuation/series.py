"""One step of a path as a function of its parameter: a truncated power series or a vector Padé approximant

    X(a) = X_0 + sum_{1<=n<=N} a^n Y_n / D(a),    Y_n = sum_{j<n} d_j X_{n-j},
    D(a) = 1 + d_1 a + ... + d_M a^M,

the series of D (X - X_0), cut at order N, over D. (Summing the Y_n loses fewer digits than weighting the
X_n.) The denominator is to make the coefficients of D X vanish at the last orders, which in an orthonormal
basis of the X_n is a small least-squares problem for the d_j. The literature asks it of the order N alone,
with M = N - 1; here M = 2N/3 and the last three orders are taken together, which depends less on round-off.

Sources: B. Cochelin, Computers & Structures 53 (1994) 1181-1192; A. Elhage-Hussein, M. Potier-Ferry, N.
Damil, International Journal of Solids and Structures 37 (2000) 6981-7001."""

from __future__ import annotations

from collections.abc import Callable
from copy import copy
from dataclasses import field
from math import copysign

import numpy as np

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.records import dataclass
from mlsanm_cli.roundoff import LAST_DIGITS

_EPS = float(np.finfo(np.float64).eps)
# A level this close to the first or last value of lam, relative to the terms summed, is that value.
_ROUND_OFF = 32.0 * _EPS


@dataclass(frozen=True, eq=False)
class Branch:
    """A piece of path (x(a), lam(a)), 0 <= a <= ``length``, with the coefficients ``x`` (N + 1, size) of the
    unknowns and ``lam`` (N + 1,) of the load factor, and those of the Padé ``denominator`` (M + 1,), M <= N,
    the first of which is 1; None for a power series."""

    x: FloatArray
    lam: FloatArray
    length: float
    denominator: FloatArray | None = None
    _exponents: FloatArray = field(init=False, repr=False)
    terms: tuple[FloatArray, FloatArray] = field(init=False, repr=False)
    """The coefficients that the weights multiply, (N + 1, size) and (N + 1,): of series or numerators."""

    def __post_init__(self) -> None:
        order = self.lam.size - 1
        object.__setattr__(self, "_exponents", np.arange(order + 1.0))
        object.__setattr__(self, "terms", (self.x, self.lam))
        if self.denominator is None:
            return
        padded = np.append(self.denominator, np.zeros(order + 1 - self.denominator.size))
        # Entry (n, k) is d_{n-k}; X_0 stands apart.
        lag = np.arange(order + 1)[:, None] - np.arange(order + 1)
        mix = np.where(lag >= 0, padded[lag], 0.0)
        mix[1:, 0] = 0.0
        object.__setattr__(self, "terms", (mix @ self.x, mix @ self.lam))

    @property
    def order(self) -> int:
        """Order N of the series."""
        return int(self.lam.size) - 1

    def evaluate(self, a: float) -> tuple[FloatArray, float]:
        """Return x, shape (size,), and lam at the parameter ``a``."""
        weights = self._weights(a)
        return weights @ self.terms[0], float(weights @ self.terms[1])

    def derivative_weights(self, a: FloatArray) -> FloatArray:
        """Return the factors (k, N + 1) of the terms in the derivative by the parameter, at ``a`` (k,)."""
        a = np.asarray(a, dtype=np.float64)[:, None]
        order = self._exponents
        power = a**order
        slope = np.where(order > 0.0, order * a ** np.maximum(order - 1.0, 0.0), 0.0)
        if self.denominator is None:
            return slope
        count = self.denominator.size
        below = (power[:, :count] @ self.denominator)[:, None]
        change = (slope[:, :count] @ self.denominator)[:, None]
        slope[:, 1:] = (slope[:, 1:] - power[:, 1:] * change / below) / below
        return slope

    def weights(self, a: FloatArray) -> FloatArray:
        """Return the factors (k, N + 1) of the terms at ``a`` (k,)."""
        weights = np.asarray(a, dtype=np.float64)[:, None] ** self._exponents
        if self.denominator is not None:
            weights[:, 1:] /= (weights[:, : self.denominator.size] @ self.denominator)[:, None]
        return weights

    def load_factor(self, a: float) -> float:
        """Return lam(a)."""
        return float(self._weights(a) @ self.terms[1])

    def round_off(self, a: float, scale: FloatArray) -> float:
        """Return a bound of the round-off in x / scale and lam at ``a``; ``scale`` has shape (size,)."""
        weights = np.abs(self._weights(a))
        x = weights @ np.abs(self.terms[0]) / scale
        return _EPS * max(float(np.max(x, initial=0.0)), float(weights @ np.abs(self.terms[1])))

    def parameter_at(self, lam: float) -> float:
        """Return the first ``a`` where lam(a) is ``lam`` to round-off. Raises ValueError without one."""
        found = self.first_crossing(lam)
        if found is None:
            raise ValueError(f"load factor {lam:.17g} is not reached on this piece of path")
        return found

    def first_crossing(self, lam: float) -> float | None:
        """As :meth:`parameter_at`, but return None when the load factor is not reached."""
        if self.denominator is None:
            # Even the sum of the magnitudes of the terms may not reach the load factor.
            sums, first = float(self._weights(self.length) @ np.abs(self.lam)), float(self.lam[0])
            if sums - abs(first) + _ROUND_OFF * (abs(lam) + sums) < abs(lam - first):
                return None
        terms, scale = self.terms[1], self.length**self._exponents
        slack = _ROUND_OFF * (abs(lam) + float(np.abs(self._weights(self.length)) @ np.abs(terms)))
        if abs(terms[0] - lam) <= slack:
            return 0.0
        # Zeros in a / length of lam(a) - lam times the denominator, next to a fold perhaps a complex pair.
        rest = terms * scale
        lower = np.ones(1) if self.denominator is None else self.denominator
        rest[0] = 0.0
        rest[: lower.size] += (terms[0] - lam) * lower * scale[: lower.size]
        if not np.all(np.isfinite(rest)):  # beyond any range of validity
            return None
        inverse = np.roots(rest)
        zeros = (1.0 / inverse[inverse != 0.0]).real
        zeros = np.sort(zeros[(zeros > 0.0) & (zeros < 1.0)])
        # lam(a) crosses the level between neighbours of these samples at most once.
        grid = self.length * np.array([0.0, *(0.5 * (zeros[1:] + zeros[:-1])), 1.0])
        values = np.array([self.load_factor(a) - lam for a in grid])
        changes = np.flatnonzero(values[1:] * values[0] <= 0.0)
        if not changes.size:
            return self.length if abs(values[-1]) <= slack else None
        low, high = grid[changes[0] : changes[0] + 2].tolist()
        return root(lambda a: self.load_factor(a) - lam, low, high)

    def shortened(self, length: float) -> Branch:
        """Return the same piece of path with another ``length``."""
        other = copy(self)
        object.__setattr__(other, "length", length)
        return other

    def _weights(self, a: float) -> FloatArray:
        """Return the factors of the terms at ``a``, shape (N + 1,)."""
        weights: FloatArray = a**self._exponents
        if self.denominator is not None:
            weights[1:] /= self.denominator @ weights[: self.denominator.size]
        return weights


# A pole this close to the real axis, relative to its distance from the start, counts as real.
_NEAR_REAL = 0.05
# The denominator minimises the coefficients of so many last orders.
_LAST_ORDERS = 3
# The orders are compared at this multiple of the range of the power series, so that the last ones count most.
_RADIUS_FACTOR = 2.0
# Singular values below this part of the largest one are round-off.
_RANK_TOLERANCE = 1e-14


def denominator(coefficients: FloatArray, radius: float) -> FloatArray | None:
    """Return the coefficients (1, d_1, ..., d_M), None for a series too short or not finite. ``coefficients``
    (N + 1, n) are X_0..X_N in comparable units, ``radius`` is the range of the power series."""
    order = coefficients.shape[0] - 1
    degree = 2 * order // 3
    radius = _RADIUS_FACTOR * radius
    scaled = coefficients[1:] * (radius ** np.arange(1.0, order + 1.0))[:, None]
    if order < 3 or not np.all(np.isfinite(scaled)):
        return None
    upper: FloatArray = np.asarray(np.linalg.qr(scaled.T, mode="r"))
    # Enough of the last orders to determine the denominator, at least three.
    rows = min(order - 1, max(_LAST_ORDERS, -(-degree // upper.shape[0])))
    # The vector X_{n-j} is column n - j - 1; orders below 1 do not occur, as X_0 is not part of D X.
    columns = np.arange(order - rows, order)[:, None] - np.arange(degree + 1)
    blocks = np.where(columns[None] >= 0, upper[:, columns], 0.0).transpose(1, 0, 2)
    system = blocks.reshape(-1, degree + 1)
    inner = np.linalg.lstsq(system[:, 1:], -system[:, 0], rcond=_RANK_TOLERANCE)[0]
    return np.concatenate([[1.0], inner / radius ** np.arange(1.0, degree + 1.0)])


def nearest_pole(coefficients: FloatArray, limit: float) -> float:
    """Return the first (nearly) real pole in (0, limit] of the denominator ``coefficients``, or inf."""
    scaled = coefficients * limit ** np.arange(float(coefficients.size))
    if not np.all(np.isfinite(scaled)):
        return 0.0
    # The roots in 1/a: the first coefficient is 1, the last ones may vanish up to round-off.
    inverse = np.roots(scaled)
    roots = limit / inverse[inverse != 0.0]
    near = (roots.real > 0.0) & (roots.real <= limit) & (np.abs(roots.imag) <= _NEAR_REAL * np.abs(roots))
    return float(np.min(roots.real[near], initial=np.inf))


_MAX_ITERATIONS = 200


def root(function: Callable[[float], float], low: float, high: float, least: float = 0.0) -> float:
    """A zero of a ``function`` with different signs at ``low`` and ``high``, to round-off or within
    ``least``, by inverse quadratic interpolation or bisection (Chandrupatla 1997,
    doi:10.1016/S0965-9978(96)00051-8): scipy.optimize takes 0.03 s to import. Raises ValueError for equal
    signs."""
    a, b, f_a, f_b = low, high, function(low), function(high)
    if f_a * f_b > 0.0:
        raise ValueError("no change of sign")
    c, f_c, share = a, f_a, 0.5
    for _ in range(_MAX_ITERATIONS):
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
