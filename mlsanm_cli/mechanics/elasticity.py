"""Rows of plane elasticity: stress, traction and equilibrium as sparse functionals of nodal displacements.

With C the plane stiffness (order xx, yy, xy)::

    sigma_a = C_a0 u_x,x + C_a1 u_y,y + C_a2 (u_x,y + u_y,x)
    t_x = sigma_xx n_x + sigma_xy n_y            t_y = sigma_xy n_x + sigma_yy n_y
    f_x = sigma_xx,x + sigma_xy,y                f_y = sigma_xy,x + sigma_yy,y
"""

from __future__ import annotations

import numpy as np
import scipy.sparse as sparse

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.kernels.forces import add_forces
from mlsanm_cli.operators.rows import pair_rows, scalar_rows
from mlsanm_cli.operators.stencil_weights import Stencils

XX, YY, XY = 0, 1, 2


FIRST, SECOND, ALL = slice(1, 3), slice(3, 6), slice(1, 6)
"""Derivatives among the weights of a stencil: x, y; xx, xy, yy."""


def operator_rows(stencils: Stencils, kinds: slice, coefficients: FloatArray) -> sparse.csr_array:
    """Rows (e, 2n) of derivatives ``kinds`` (m) of u_x and u_y times ``coefficients`` (m, 2), or (m, 2, e) if
    they vary from point to point."""
    weights = stencils.weights[:, kinds]
    if coefficients.ndim == 2:
        return pair_rows(stencils, weights @ coefficients)
    entry = np.repeat(np.arange(len(stencils.indptr) - 1), np.diff(stencils.indptr))
    values = np.zeros((len(weights), 2))
    for weight, coefficient in zip(weights.T, coefficients, strict=True):
        values += weight[:, None] * coefficient.T[entry]
    return pair_rows(stencils, values)


def moduli_of(c: FloatArray) -> FloatArray:
    """Derivatives (4, 2, 2) of the stresses xx, xy, yx, yy by the derivatives x, y of u_x and u_y."""
    by_strain = np.stack([[[xx, xy], [xy, yy]] for xx, yy, xy in c])
    return by_strain[[XX, XY, XY, YY]]


def stress_rows(stencils: Stencils, c: FloatArray, component: int) -> sparse.csr_array:
    """Rows (e, 2n) of the stress ``component`` XX, YY or XY at the stencils' points."""
    return operator_rows(stencils, FIRST, moduli_of(c)[(0, 3, 1)[component]])


def traction_moduli(moduli: FloatArray, normal: FloatArray, component: int) -> FloatArray:
    """Coefficients (2, 2, b) of the traction x (0) or y (1) on surfaces with ``normal`` (b, 2), by ``moduli``
    (4, 2, 2, b or 1)."""
    on_x, on_y = moduli[2 * component : 2 * component + 2]
    return np.asarray(on_x * normal[:, 0] + on_y * normal[:, 1])


def traction_rows(stencils: Stencils, c: FloatArray, normal: FloatArray, component: int) -> sparse.csr_array:
    """Rows (e, 2n) of the traction component x (0) or y (1) on surfaces with ``normal`` (e, 2)."""
    return operator_rows(stencils, FIRST, traction_moduli(moduli_of(c)[..., None], normal, component))


def force_rows(stencils: Stencils, c: FloatArray, arm: FloatArray, normal: FloatArray) -> sparse.csr_array:
    """Rows (3e, 2n) of the forces x, forces y and moments with ``arm`` (e, t, 2) of sigma n, summed over the
    t quadrature points of each stencil. The stencils have the weights (nnz, 2t) of d/dx and d/dy at these
    points; ``normal`` (e, t, 2) includes the quadrature weights."""
    values = np.zeros((3, len(stencils.indices), 2))
    add_forces(stencils.indptr, stencils.weights, c, arm, normal, values)
    rows = pair_rows(stencils, values[0])
    begin, (count, width) = rows.indptr[:-1], rows.shape
    indptr = np.concatenate([begin, begin + rows.nnz, begin + 2 * rows.nnz, [3 * rows.nnz]])
    entries = (values.ravel(), np.tile(rows.indices, 3), indptr)
    return sparse.csr_array(entries, shape=(3 * count, width))


def force_sums(arm: FloatArray, normal: FloatArray) -> list[sparse.csr_array]:
    """Matrices (3e, e t) from stress xx, yy and xy at t points around e centres to forces x, forces y and
    moments with ``arm`` (e, t, 2); ``normal`` (e, t, 2) includes the quadrature weights."""
    places, times = normal.shape[:2]
    row, column = np.repeat(np.arange(places), times), np.arange(places * times)
    (n_x, n_y), (a_x, a_y) = normal.reshape(-1, 2).T, arm.reshape(-1, 2).T
    found = []
    for x, y in ((n_x, 0.0 * n_x), (0.0 * n_x, n_y), (n_y, n_x)):
        lines = np.concatenate([row, places + row, 2 * places + row])
        values = np.concatenate([x, y, a_x * y - a_y * x])
        entries = (values, (lines, np.tile(column, 3)))
        found.append(sparse.csr_array(entries, shape=(3 * places, places * times)))
    return found


def equilibrium_rows(stencils: Stencils, c: FloatArray, component: int) -> sparse.csr_array:
    """Rows (e, 2n) of div sigma in x (0) or y (1) for uniform stiffness, by second derivatives."""
    on_x, on_y = moduli_of(c)[2 * component : 2 * component + 2]
    return operator_rows(stencils, SECOND, np.stack([on_x[0], on_x[1] + on_y[0], on_y[1]]))


def nested_equilibrium_rows(
    stencils: Stencils, outer: Stencils, c: FloatArray, component: int
) -> sparse.csr_array:
    """Rows (e, 2n) of div sigma in x (0) or y (1), by first derivatives of nodal stresses. ``outer`` are
    stencils of the e points on each other."""
    first, second = ((XX, XY), (XY, YY))[component]
    d_x, d_y = (scalar_rows(outer, outer.weights[:, kind]) for kind in (1, 2))
    return sparse.csr_array(d_x @ stress_rows(stencils, c, first) + d_y @ stress_rows(stencils, c, second))


def stress_of(derivatives: FloatArray, c: FloatArray) -> FloatArray:
    """Stress (e, 3) from ``derivatives`` (e, 3 | 6, 2) of the displacement, value first."""
    by_x, by_y = derivatives[:, 1], derivatives[:, 2]
    strain = np.stack([by_x[:, 0], by_y[:, 1], by_x[:, 1] + by_y[:, 0]], axis=1)
    return np.asarray(strain @ c.T)


def divergence_of(derivatives: FloatArray, c: FloatArray) -> FloatArray:
    """div sigma (e, 2) from ``derivatives`` (e, 6, 2) of the displacement."""
    # Derivatives by x and y of value, d/dx and d/dy.
    by_x, by_y = (stress_of(derivatives[:, kinds], c) for kinds in ((1, 3, 4), (2, 4, 5)))
    return np.stack([by_x[:, XX] + by_y[:, XY], by_x[:, XY] + by_y[:, YY]], axis=1)


def divergence_of_stress(derivatives: FloatArray) -> FloatArray:
    """div sigma (e, 2) from ``derivatives`` (e, 3 | 6, 3) of the stress."""
    by_x, by_y = derivatives[:, 1], derivatives[:, 2]
    return np.stack([by_x[:, XX] + by_y[:, XY], by_x[:, XY] + by_y[:, YY]], axis=1)


def traction_of(stress: FloatArray, normal: FloatArray) -> FloatArray:
    """Tractions (b, 2) of ``stress`` (b, 3), or (3,) if uniform, on surfaces with ``normal`` (b, 2)."""
    xx, yy, xy = stress.T
    x, y = normal.T
    return np.stack([xx * x + xy * y, xy * x + yy * y], axis=1)


def von_mises(stress: FloatArray, across: FloatArray) -> FloatArray:
    """Von Mises stress (n,) of plane ``stress`` (n, 3) and out-of-plane stress ``across`` (n,)."""
    (xx, yy, xy), zz = stress.T, across
    return np.asarray(np.sqrt(0.5 * ((xx - yy) ** 2 + (yy - zz) ** 2 + (zz - xx) ** 2) + 3.0 * xy**2))
