"""The simple radial (Flamant) fields of surface forces on isotropic bodies, see
:mod:`mlsanm_cli.mechanics.near_field`; cubic interpolation of tables on uniform grids."""

from __future__ import annotations

import math

import numpy as np

from mlsanm_cli.kernels.aot.jit import kernel
from mlsanm_cli.kernels.aot.signature import Bool2, Float1, Float2, Float3


@kernel
def radial_displacements(
    seen: Float2, place: Float2, base: Float2, center: Float1, kappa: float, left_out: Bool2
) -> Float3:
    """Displacements (2, e, 2k), times 4 pi G, at ``seen`` (e, 2) due to unit forces x, then y at
    ``place`` (k, 2).

    Angles are measured from ``base`` (k, 2), or, given a ``center`` (2,) instead of (0,), from the direction
    to it; the opposite forces then act there. Pairs in ``left_out`` (e, k) are skipped; (0, 0) skips none.
    """
    points, forces = len(seen), len(place)
    found = np.zeros((2, points, 2 * forces))
    for e in range(points):
        own_distance = own_cosine = own_sine = base_x = base_y = 0.0
        if len(center):
            base_x, base_y = seen[e, 0] - center[0], seen[e, 1] - center[1]
            square = base_x * base_x + base_y * base_y
            own_distance = 0.5 * (kappa + 1.0) * math.log(square)
            own_cosine = (base_x * base_x - base_y * base_y) / square
            own_sine = 2.0 * base_x * base_y / square
        for k in range(forces):
            if left_out.shape[0] and left_out[e, k]:
                continue
            x, y = seen[e, 0] - place[k, 0], seen[e, 1] - place[k, 1]
            if not len(center):
                base_x, base_y = base[k, 0], base[k, 1]
            square = x * x + y * y
            distance = 0.5 * (kappa + 1.0) * math.log(square) - own_distance
            turn = (kappa - 1.0) * math.atan2(base_x * y - base_y * x, base_x * x + base_y * y)
            cosine, sine = (x * x - y * y) / square - own_cosine, 2.0 * x * y / square - own_sine
            found[0, e, k], found[0, e, forces + k] = cosine - distance, turn + sine
            found[1, e, k], found[1, e, forces + k] = sine - turn, -distance - cosine
    return found


@kernel
def radial_stresses(seen: Float2, place: Float2, center: Float1, left_out: Bool2) -> Float3:
    """Stresses xx, yy, xy (3, e, 2k), times -pi / 2, of the same fields."""
    points, forces = len(seen), len(place)
    found = np.zeros((3, points, 2 * forces))
    for e in range(points):
        far_x = far_y = opposite = 0.0
        if len(center):
            far_x, far_y = seen[e, 0] - center[0], seen[e, 1] - center[1]
            opposite = 1.0 / (far_x * far_x + far_y * far_y) ** 2
        for k in range(forces):
            if left_out.shape[0] and left_out[e, k]:
                continue
            x, y = seen[e, 0] - place[k, 0], seen[e, 1] - place[k, 1]
            factor = 1.0 / (x * x + y * y) ** 2
            across = factor * x * y * y - opposite * far_x * far_y * far_y
            along = factor * x * x * y - opposite * far_x * far_x * far_y
            found[0, e, k] = factor * x * x * x - opposite * far_x * far_x * far_x
            found[0, e, forces + k] = found[2, e, k] = along
            found[1, e, k] = found[2, e, forces + k] = across
            found[1, e, forces + k] = factor * y * y * y - opposite * far_y * far_y * far_y
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
