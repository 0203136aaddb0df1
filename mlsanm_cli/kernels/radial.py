"""The simple radial (Flamant) field of a surface force on an isotropic body, see
:mod:`mlsanm_cli.mechanics.near_field`; cubic interpolation of tables on uniform grids."""

from __future__ import annotations

import math

import numpy as np

from mlsanm_cli.kernels.aot.jit import kernel
from mlsanm_cli.kernels.aot.signature import Float1, Float2, Float3


@kernel
def radial_displacement(w: Float2, base: Float2, kappa: float) -> Float3:
    """Displacements (e, 2, 2), times 4 pi G, at ``w`` (e, 2) from unit forces in x and y; angles are measured
    from ``base`` (e, 2)."""
    found = np.empty((len(w), 2, 2))
    for e in range(len(w)):
        x, y = w[e, 0], w[e, 1]
        square = x * x + y * y
        distance = 0.5 * (kappa + 1.0) * math.log(square)
        turn = (kappa - 1.0) * math.atan2(base[e, 0] * y - base[e, 1] * x, base[e, 0] * x + base[e, 1] * y)
        cosine, sine = (x * x - y * y) / square, 2.0 * x * y / square
        found[e, 0, 0], found[e, 0, 1] = cosine - distance, turn + sine
        found[e, 1, 0], found[e, 1, 1] = sine - turn, -distance - cosine
    return found


@kernel
def radial_stress(w: Float2) -> Float3:
    """Stresses xx, yy, xy (e, 3, 2), times -pi / 2, at ``w`` (e, 2) from unit forces in x and y."""
    found = np.empty((len(w), 3, 2))
    for e in range(len(w)):
        x, y = w[e, 0], w[e, 1]
        factor = 1.0 / (x * x + y * y) ** 2
        found[e, 0, 0], found[e, 1, 1] = factor * x * x * x, factor * y * y * y
        found[e, 0, 1] = found[e, 2, 0] = factor * x * x * y
        found[e, 1, 0] = found[e, 2, 1] = factor * x * y * y
    return found


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
