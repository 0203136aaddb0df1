"""Status of nodes in one linearised step by complementary pivoting, where the active-set exchange cycles.

With q = l - mu p, l = mu p + q >= 0 and the slip s = b - a split in two parts, frictional contact is a linear
complementarity problem::

    gap  = ... >= 0      p >= 0      gap p = 0
    b    = s + a >= 0    l >= 0      b l = 0         slips forward: friction is -mu p
    2 mu p - l >= 0      a >= 0      a (2 mu p - l) = 0   slips backward: mu p

solved along one artificial load (Lemke 1965, doi:10.1287/mnsc.11.7.681): no basis recurs.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.contact.laws.contact_status import OPEN, SLIP, STICK

PERTURBATION, MIN_PIVOT = 1e-10, 1e-11
"""Relative perturbation of right-hand sides, so that no two nodes change at once; and smallest relative
pivot."""
MAX_PIVOTS = 10
"""Largest number of pivots per unknown."""
GOLDEN = 0.5 * (np.sqrt(5.0) - 1.0)


def complementary_sets(
    friction: FloatArray, gap: FloatArray, slip: FloatArray, by_gap: FloatArray, by_slip: FloatArray
) -> tuple[NDArray[np.int8], FloatArray] | None:
    """Status and slip direction (c,) of nodes with ``friction`` coefficients (c,); None if the path does not
    end.

    ``gap`` and ``slip`` (c,) without pressure are in units of pressure, ``by_gap`` and ``by_slip`` (c, 2c)
    their derivatives by pressures and shears.
    """
    count, rubs = len(gap), np.flatnonzero(friction > 0.0)
    by_p, by_l = by_gap[:, :count] - by_gap[:, count:] * friction, by_gap[:, count:][:, rubs]
    own_p = (by_slip[:, :count] - by_slip[:, count:] * friction)[rubs]
    own_l, n = by_slip[:, count:][np.ix_(rubs, rubs)], len(rubs)
    limit = np.zeros((n, count))
    limit[np.arange(n), rubs] = 2.0 * friction[rubs]
    matrix = np.block(
        [
            [by_p, by_l, np.zeros((count, n))],
            [own_p, own_l, np.eye(n)],
            [limit, -np.eye(n), np.zeros((n, n))],
        ]
    )
    basis = _lemke(matrix, np.concatenate([gap, slip[rubs], np.zeros(n)]))
    if basis is None:
        return None
    closed, forward, backward = basis[:count], ~basis[count : count + n], basis[count + n :]
    status, sense = np.where(closed, SLIP, OPEN).astype(np.int8), np.zeros(count)
    slides = forward | backward
    status[rubs[closed[rubs] & ~slides]] = STICK
    sense[rubs] = np.where(closed[rubs] & slides, np.where(backward, 1.0, -1.0), 0.0)
    return status, sense


def _lemke(matrix: FloatArray, rest: FloatArray) -> NDArray[np.bool_] | None:
    """Mask (n,) of the unknowns z in the basis of w = M z + r, w >= 0, z >= 0, w z = 0; None if the path does
    not end."""
    n = len(rest)
    largest = float(np.abs(rest).max(initial=0.0))
    rest = rest + PERTURBATION * largest * (1.0 + np.mod(GOLDEN * np.arange(n), 1.0))
    if not (rest < 0.0).any():
        return np.zeros(n, dtype=bool)
    # Columns: w, z, the artificial load, the right-hand side.
    table = np.hstack([np.eye(n), -matrix, -np.ones((n, 1)), rest[:, None]])
    basis, enters, row = np.arange(n), 2 * n, int(np.argmin(rest))
    for _ in range(MAX_PIVOTS * n):
        table[row] /= table[row, enters]
        others = np.arange(n) != row
        table[others] -= np.outer(table[others, enters], table[row])
        leaves, basis[row] = int(basis[row]), enters
        if leaves == 2 * n:
            found = np.zeros(n, dtype=bool)
            found[basis[basis >= n] - n] = True
            return found
        enters = leaves + n if leaves < n else leaves - n
        column = table[:, enters]
        up = np.flatnonzero(column > MIN_PIVOT * max(float(np.abs(column).max()), 1.0))
        if not len(up):
            return None
        row = int(up[np.argmin(np.maximum(table[up, -1], 0.0) / column[up])])
    return None
