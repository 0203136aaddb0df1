"""Denominators of vector Padé approximants of a truncated power series, and their poles.

The coefficient vectors X_1..X_N are orthonormalised (Gram-Schmidt in its stable form, a QR factorisation):
X_n = sum_{j<=n} r_jn X*_j. The denominator D = 1 + d_1 a + ... + d_M a^M is to make the coefficients of D X
vanish at the last orders, sum_j d_j X_{n-j} = 0, which in the basis X* is a small least-squares problem for
the d_j. The literature asks it of the order N alone, with M = N - 1, one component of X* each; here M = 2N/3
and the last three orders are taken together, which depends less on the smallest r_jn, mostly round-off.

Source: A. Elhage-Hussein, M. Potier-Ferry, N. Damil, A numerical continuation method based on Padé
approximants, International Journal of Solids and Structures 37 (2000) 6981-7001.
"""

from __future__ import annotations

import numpy as np

from mlsanm_cli.continuation.problem import FloatArray

# A pole this close to the real axis, relative to its distance from the start, counts as real.
_NEAR_REAL = 0.05
# The denominator minimises the coefficients of so many last orders; measured on contact problems, three give
# steps some 25 % longer than the last one alone.
_LAST_ORDERS = 3
# The orders are compared at this multiple of the range of the power series, so that the last ones count most.
_RADIUS_FACTOR = 2.0
# Singular values below this part of the largest one are round-off.
_RANK_TOLERANCE = 1e-14


def denominator(coefficients: FloatArray, radius: float) -> FloatArray | None:
    """Return the coefficients (1, d_1, ..., d_M), or None when the series is too short or not finite.

    Parameters
    ----------
    coefficients : (N + 1, n), the vectors X_0..X_N in comparable units (X_0 is not used)
    radius : range of the power series, the scale on which the orders are compared
    """
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
    """Return the real part of the first real or nearly real pole in (0, limit], or inf.

    ``coefficients`` are those of the denominator in ascending order, starting with 1.
    """
    scaled = coefficients * limit ** np.arange(float(coefficients.size))
    if not np.all(np.isfinite(scaled)):
        return 0.0
    # The roots in 1/a: the first coefficient is 1, the last ones may vanish up to round-off.
    inverse = np.roots(scaled)
    roots = limit / inverse[inverse != 0.0]
    near = (roots.real > 0.0) & (roots.real <= limit) & (np.abs(roots.imag) <= _NEAR_REAL * np.abs(roots))
    return float(np.min(roots.real[near], initial=np.inf))
