"""Superposition of the simple radial (Flamant) fields of surface forces on isotropic bodies, see
:mod:`mlsanm_cli.mechanics.near_field`; cubic interpolation of tables on uniform grids."""

from __future__ import annotations

import math

import numpy as np

from mlsanm_cli.kernels.aot.jit import kernel
from mlsanm_cli.kernels.aot.signature import Bool2, Float1, Float2, Float3


@kernel
def radial_displacements(
    seen: Float2, place: Float2, base: Float2, center: Float1, force: Float3, kappa: float, left_out: Bool2
) -> Float3:
    """Displacements (e, 2, c), times 4 pi G, at ``seen`` (e, 2) due to ``force`` (k, 2, c) at ``place`` (k,
    2).

    Angles are measured from ``base`` (k, 2), or, given a ``center`` (2,) instead of (0,), from the direction
    to it; the opposite forces then act there. Pairs in ``left_out`` (e, k) are skipped; (0, 0) skips none.
    """
    columns, all_count = force.shape[2], left_out.shape[0] == 0
    found, total = np.zeros((len(seen), 2, columns)), np.zeros((2, columns))
    for e in range(len(seen)):
        total[:] = 0.0
        base_x = base_y = 0.0
        if len(center):
            base_x, base_y = seen[e, 0] - center[0], seen[e, 1] - center[1]
        for k in range(len(place)):
            if not all_count and left_out[e, k]:
                continue
            x, y = seen[e, 0] - place[k, 0], seen[e, 1] - place[k, 1]
            if not len(center):
                base_x, base_y = base[k, 0], base[k, 1]
            square = x * x + y * y
            distance = 0.5 * (kappa + 1.0) * math.log(square)
            turn = (kappa - 1.0) * math.atan2(base_x * y - base_y * x, base_x * x + base_y * y)
            cosine, sine = (x * x - y * y) / square, 2.0 * x * y / square
            for c in range(columns):
                f_x, f_y = force[k, 0, c], force[k, 1, c]
                found[e, 0, c] += (cosine - distance) * f_x + (turn + sine) * f_y
                found[e, 1, c] += (sine - turn) * f_x - (distance + cosine) * f_y
                total[0, c] += f_x
                total[1, c] += f_y
        if len(center):
            square = base_x * base_x + base_y * base_y
            distance = 0.5 * (kappa + 1.0) * math.log(square)
            cosine, sine = (base_x * base_x - base_y * base_y) / square, 2.0 * base_x * base_y / square
            for c in range(columns):
                found[e, 0, c] -= (cosine - distance) * total[0, c] + sine * total[1, c]
                found[e, 1, c] -= sine * total[0, c] - (distance + cosine) * total[1, c]
    return found


@kernel
def radial_stresses(seen: Float2, place: Float2, center: Float1, force: Float3, left_out: Bool2) -> Float3:
    """Stresses xx, yy, xy (e, 3, c), times -pi / 2, of the same fields."""
    columns, all_count = force.shape[2], left_out.shape[0] == 0
    found, total = np.zeros((len(seen), 3, columns)), np.zeros((2, columns))
    for e in range(len(seen)):
        total[:] = 0.0
        for k in range(len(place)):
            if not all_count and left_out[e, k]:
                continue
            x, y = seen[e, 0] - place[k, 0], seen[e, 1] - place[k, 1]
            factor = 1.0 / (x * x + y * y) ** 2
            for c in range(columns):
                f_x, f_y = force[k, 0, c], force[k, 1, c]
                radial = factor * (f_x * x + f_y * y)
                found[e, 0, c] += radial * x * x
                found[e, 1, c] += radial * y * y
                found[e, 2, c] += radial * x * y
                total[0, c] += f_x
                total[1, c] += f_y
        if len(center):
            x, y = seen[e, 0] - center[0], seen[e, 1] - center[1]
            factor = 1.0 / (x * x + y * y) ** 2
            for c in range(columns):
                radial = factor * (total[0, c] * x + total[1, c] * y)
                found[e, 0, c] -= radial * x * x
                found[e, 1, c] -= radial * y * y
                found[e, 2, c] -= radial * x * y
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
