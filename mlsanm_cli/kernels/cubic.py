"""Cubic interpolation of tables on uniform grids."""

from __future__ import annotations

import numpy as np

from mlsanm_cli.kernels.aot.jit import kernel
from mlsanm_cli.kernels.aot.signature import Float1, Float2


@kernel
def cubic_rows(table: Float2, at: Float1) -> Float2:
    """Cubic Lagrange interpolation (e, c) of the rows of a ``table`` (n, c) at fractional row numbers ``at``
    (e,); constant before the second row and behind the last but two."""
    last = table.shape[0] - 4
    found = np.empty((at.size, table.shape[1]))
    for e in range(at.size):
        t = min(max(at[e], 1.0), last + 1.0)
        # This order of the comparison keeps a nan from becoming an index.
        first = int(t) if t < last else last
        u = t - first
        low, high = u * (u - 1.0) / 6.0, (u + 1.0) * (u - 2.0) / 2.0
        for c in range(table.shape[1]):
            found[e, c] = (
                -low * (u - 2.0) * table[first - 1, c]
                + high * (u - 1.0) * table[first, c]
                - high * u * table[first + 1, c]
                + low * (u + 1.0) * table[first + 2, c]
            )
    return found
