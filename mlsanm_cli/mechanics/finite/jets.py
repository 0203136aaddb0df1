"""Power series of fields with spatial derivatives (jets), multiplied order by order.

A series is an array (K + 1, j, n): coefficients of orders 0 to K at n points; j = 1 for values only, j = 3
for value, d/dX and d/dY. Products within one order follow Leibniz' rule.
"""

from __future__ import annotations

import numpy as np

from mlsanm_cli.arrays import FloatArray


def cauchy(
    one: FloatArray, other: FloatArray, order: int, first: int = 0, last: int | None = None
) -> FloatArray:
    """Contribution (j, n) of the orders ``first`` to ``last`` (default all) of ``one`` (K + 1, j, n) to the
    coefficient of ``order`` of its product with ``other`` (K + 1, j, n)."""
    end = order if last is None else last
    low = one[first : end + 1]
    high = other[order - end : order - first + 1][::-1]
    return added_products(low, high)


def added_products(low: FloatArray, high: FloatArray) -> FloatArray:
    """Sum over the first axis of products of jets ``low`` and ``high`` (k, j, n): (j, n)."""
    result = np.empty(low.shape[1:])
    result[0] = np.einsum("kn,kn->n", low[:, 0], high[:, 0])
    if low.shape[1] > 1:
        result[1:] = np.einsum("kjn,kn->jn", low[:, 1:], high[:, 0])
        result[1:] += np.einsum("kn,kjn->jn", low[:, 0], high[:, 1:])
    return result


def times(one: FloatArray, other: FloatArray) -> FloatArray:
    """Product of two jets (j, n)."""
    return added_products(one[None], other[None])


def inverse(one: FloatArray) -> FloatArray:
    """Reciprocal of a jet (j, n)."""
    result = np.empty_like(one)
    result[0] = 1.0 / one[0]
    result[1:] = -one[1:] * result[0] ** 2
    return result


def weighted(series: FloatArray, order: int) -> FloatArray:
    """The ``series`` (K + 1, j, n) up to ``order``, each coefficient times its order: a d/da."""
    return series[: order + 1] * np.arange(order + 1.0)[:, None, None]
