"""Forces through faces from derivative weights at quadrature points."""

from __future__ import annotations

from mlsanm_cli.kernels.aot.jit import kernel
from mlsanm_cli.kernels.aot.signature import Float2, Float3, FloatOut3, Int1


@kernel
def add_forces(
    indptr: Int1, weights: Float2, stiffness: Float2, arm: Float3, normal: Float3, values: FloatOut3
) -> None:
    """Add the coefficients of force x, force y and moment of sigma n to ``values`` (3, nnz, 2), per u_x and
    u_y.

    e stencils have t quadrature points each. ``weights`` (nnz, 2t) are those of d/dx and d/dy, ``normal``
    (e, t, 2) includes the quadrature weight, ``arm`` (e, t, 2) is the lever arm, ``stiffness`` (3, 3) the
    matrix for xx, yy, xy.
    """
    for e in range(len(indptr) - 1):
        for t in range(normal.shape[1]):
            n_x, n_y = normal[e, t, 0], normal[e, t, 1]
            for row in range(3):
                # Virtual strain components that multiply the stresses xx, yy and xy.
                xx, yy, xy = n_x, 0.0, n_y
                if row == 1:
                    xx, yy, xy = 0.0, n_y, n_x
                elif row == 2:
                    xx, yy = -arm[e, t, 1] * n_x, arm[e, t, 0] * n_y
                    xy = arm[e, t, 0] * n_x - arm[e, t, 1] * n_y
                s0 = stiffness[0, 0] * xx + stiffness[1, 0] * yy + stiffness[2, 0] * xy
                s1 = stiffness[0, 1] * xx + stiffness[1, 1] * yy + stiffness[2, 1] * xy
                s2 = stiffness[0, 2] * xx + stiffness[1, 2] * yy + stiffness[2, 2] * xy
                for entry in range(indptr[e], indptr[e + 1]):
                    dx, dy = weights[entry, 2 * t], weights[entry, 2 * t + 1]
                    values[row, entry, 0] += s0 * dx + s2 * dy
                    values[row, entry, 1] += s2 * dx + s1 * dy
