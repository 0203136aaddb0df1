"""Higher orders of a power series (asymptotic numerical method) with hyperbolas as the only nonlinearity."""

from __future__ import annotations

import numpy as np

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.kernels.aot.jit import inner, kernel
from mlsanm_cli.kernels.aot.signature import Float1, Float2, FloatOut1, FloatOut2, Int1
from mlsanm_cli.kernels.copies import copy_to


@inner
def subtract(target: FloatArray, factor: float, values: FloatArray) -> None:
    """In place: target -= factor * values, both (n,)."""
    for i in range(values.size):
        target[i] -= factor * values[i]


@kernel
def hyperbola_orders(
    x: FloatOut2,
    lam: FloatOut1,
    slope: Float1,
    normal: Float1,
    denominator: float,
    factor: Float2,
    pivots: Int1,
    equations: Float2,
    m: int,
    product: float,
    gap: float,
    stuck: Int1,
    friction_slope: Float1,
    friction_nodes: Int1,
) -> None:
    """Compute orders 2 to N of the series ``x`` (N + 1, 2m + k + n) and ``lam`` (N + 1,).

    Unknowns are pressures p (m,), gaps h (m,), rigid motions q (k,) and tractions t (n,). Tractions of the
    nodes ``stuck`` (s,) are free, the others are ``friction_slope`` (n,) times the pressures of
    ``friction_nodes`` (n,). ``factor`` (r, r), transposed, and ``pivots`` (r,) are LAPACK's LU factorisation,
    r = m + s + k, of the equations for (p, t of stuck nodes, q); the first m columns of ``equations`` (r, >=
    r) map this solution to gaps, scaled by ``gap``. The hyperbolas are p h, scaled by ``product``. Each order
    solves for the products of lower orders plus lam_k ``slope``, with lam_k such that its scalar product with
    ``normal`` vanishes; ``denominator`` is normal . slope.
    """
    r = len(factor)
    s, n = stuck.size, friction_slope.size
    k = r - m - s
    y = np.empty(r)
    free = np.empty(2 * m + k + n)
    for order in range(2, lam.size):
        y[:] = 0.0
        for j in range(1, order):
            for i in range(m):
                y[i] += x[j, i] * x[order - j, m + i]
        for i in range(m):
            y[i] /= -product
        for i in range(r):
            other = pivots[i]
            if other != i:
                y[i], y[other] = y[other], y[i]
        # Column by column without reductions; indices from zero, so that the loops vectorise.
        for j in range(r):
            subtract(y[j + 1 :], y[j], factor[j, j + 1 :])
        for back in range(1, r + 1):
            j = r - back
            y[j] /= factor[j, j]
            subtract(y[:j], y[j], factor[j, :j])
        copy_to(free, y[:m])
        free[m : 2 * m] = 0.0
        for j in range(r):
            subtract(free[m : 2 * m], -y[j], equations[j, :m])
        for i in range(m, 2 * m):
            free[i] *= gap
        copy_to(free[2 * m :], y[m + s :])
        for i in range(n):
            free[2 * m + k + i] = friction_slope[i] * y[friction_nodes[i]]
        for i in range(s):
            free[2 * m + k + stuck[i]] = y[m + i]
        along = 0.0
        for i in range(free.size):
            along += normal[i] * free[i]
        lam[order] = -along / denominator
        for i in range(free.size):
            x[order, i] = free[i] + lam[order] * slope[i]
