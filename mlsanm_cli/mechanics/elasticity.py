"""Rows of elasticity: stress, traction and equilibrium as sparse functionals of nodal displacements.

With C the plane stiffness (order xx, yy, xy)::

    sigma_a = C_a0 u_x,x + C_a1 u_y,y + C_a2 (u_x,y + u_y,x)
    t_x = sigma_xx n_x + sigma_xy n_y            t_y = sigma_xy n_x + sigma_yy n_y
    f_x = sigma_xx,x + sigma_xy,y                f_y = sigma_xy,x + sigma_yy,y

In bodies of revolution about x = 0, with points of a ``radius`` r = x, strains and stresses have the hoop
component as fourth (C is 4 x 4), and equilibrium two more terms (Timoshenko and Goodier, Theory of
Elasticity, chapter 12)::

    e_hoop = u_x / r        f_x += (sigma_xx - sigma_hoop) / r        f_y += sigma_xy / r

On the axis quotients by r are derivatives by x, and f_x vanishes by symmetry. Equation (4a) of
docs/method.md.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import scipy.sparse as sparse

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.kernels.assembly import add_forces
from mlsanm_cli.mechanics.material import PlaneMaterial
from mlsanm_cli.operators.stencil_weights import Stencils, pair_rows, scalar_rows, vector_rows

XX, YY, XY, HOOP = 0, 1, 2, 3


SECOND = slice(3, 6)
"""Derivatives among the weights of a stencil: x, y; xx, xy, yy."""
WITH_X, WITH_Y = (1, 3, 4), (2, 4, 5)
"""Derivatives by x and y of value, x and y among the weights of a stencil."""


def operator_rows(stencils: Stencils, kinds: slice, coefficients: FloatArray) -> sparse.csr_array:
    """Rows (e, 2n) of derivatives ``kinds`` (m) of u_x and u_y times ``coefficients`` (m, 2) or (m, 2, e)."""
    weights = stencils.weights[:, kinds]
    if coefficients.ndim == 2:
        return pair_rows(stencils, weights @ coefficients)
    entry = np.repeat(np.arange(len(stencils.indptr) - 1), np.diff(stencils.indptr))
    values = np.zeros((len(weights), 2))
    for weight, coefficient in zip(weights.T, coefficients, strict=True):
        values += weight[:, None] * coefficient.T[entry]
    return pair_rows(stencils, values)


def over_radius(values: FloatArray, slopes: FloatArray, radius: FloatArray) -> FloatArray:
    """``values`` (e,) over the ``radius`` (e,), on the axis their ``slopes`` (e,) by x."""
    return np.divide(values, radius, out=slopes + 0.0 * values, where=radius > 0.0)


def strain_operator(radius: FloatArray) -> FloatArray:
    """Strains xx, yy, 2 xy and hoop at a ``radius`` (e,), by value, d/dx and d/dy of u_x, u_y: (4, 3, 2,
    e)."""
    found = np.zeros((4, 3, 2, len(radius)))
    found[XX, 1, 0] = found[XY, 2, 0] = found[XY, 1, 1] = found[YY, 2, 1] = 1.0
    one, none = np.ones(len(radius)), np.zeros(len(radius))
    found[HOOP, 0, 0], found[HOOP, 1, 0] = over_radius(one, none, radius), over_radius(none, one, radius)
    return found


def stress_operator(c: FloatArray, radius: FloatArray | None = None) -> FloatArray:
    """Derivatives (3, 2, 2, 1) of the stresses xx, yy, xy by the derivatives x, y of u_x and u_y; (4, 3, 2,
    e), with the hoop stress, by value, x and y at points of a ``radius`` (e,)."""
    if radius is not None:
        return np.asarray(np.einsum("as,skie->akie", c, strain_operator(radius)))
    return np.stack([[[xx, xy], [xy, yy]] for xx, yy, xy in c])[..., None]


def moduli_of(c: FloatArray, radius: FloatArray | None = None) -> FloatArray:
    """The same (4, ...) of the stresses xx, xy, yx, yy."""
    return stress_operator(c, radius)[[XX, XY, XY, YY]]


def first_order_rows(stencils: Stencils, coefficients: FloatArray) -> sparse.csr_array:
    """Rows (e, 2n) with ``coefficients`` (2 | 3, 2, e | 1) of value (if three) and first derivatives."""
    if coefficients.shape[-1] == 1:
        coefficients = coefficients[..., 0]
    return operator_rows(stencils, slice(3 - len(coefficients), 3), coefficients)


def stress_rows(stencils: Stencils, c: FloatArray, component: int) -> sparse.csr_array:
    """Rows (e, 2n) of the stress ``component`` XX, YY, XY or HOOP at the stencils' points."""
    return first_order_rows(stencils, stress_operator(c, stencils.radius)[component])


def traction_moduli(moduli: FloatArray, normal: FloatArray, component: int) -> FloatArray:
    """Coefficients (m, 2, b) of the traction x (0) or y (1) on ``normal`` (b, 2), by ``moduli`` (4, m, 2, b |
    1)."""
    on_x, on_y = moduli[2 * component : 2 * component + 2]
    return np.asarray(on_x * normal[:, 0] + on_y * normal[:, 1])


def traction_rows(stencils: Stencils, c: FloatArray, normal: FloatArray, component: int) -> sparse.csr_array:
    """Rows (e, 2n) of the traction component x (0) or y (1) on surfaces with ``normal`` (e, 2)."""
    return first_order_rows(stencils, traction_moduli(moduli_of(c, stencils.radius), normal, component))


def force_rows(stencils: Stencils, c: FloatArray, arm: FloatArray, normal: FloatArray) -> sparse.csr_array:
    """Rows (3e, 2n) of the forces x, forces y and moments with ``arm`` (e, t, 2) of sigma n, summed over the
    quadrature points of each stencil, at which it has the weights (nnz, 2t) of d/dx and d/dy, in a body of
    revolution (nnz, 3t); ``normal`` (e, t, 2) includes the quadrature weights."""
    values = np.zeros((3, len(stencils.indices), 2))
    weights, radius = stencils.weights, stencils.radius
    if radius is not None:
        whole = weights.reshape(len(weights), normal.shape[1], 3)
        weights = np.ascontiguousarray(whole[:, :, 1:]).reshape(len(weights), 2 * normal.shape[1])
        entry = np.repeat(np.arange(len(normal)), np.diff(stencils.indptr))
        hoop = over_radius(whole[:, :, 0], whole[:, :, 1], radius.reshape(normal.shape[:2])[entry])
        pull = traction_of(c[:3, HOOP], normal.reshape(-1, 2)).reshape(normal.shape)
        turn = arm[..., 0] * pull[..., 1] - arm[..., 1] * pull[..., 0]
        for row, force in enumerate((pull[..., 0], pull[..., 1], turn)):
            values[row, :, 0] = (hoop * force[entry]).sum(axis=1)
    add_forces(stencils.indptr, weights, np.ascontiguousarray(c[:3, :3]), arm, normal, values)
    values = stencils.signed(values)
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
    if stencils.radius is not None:
        return operator_rows(stencils, slice(0, 6), _equilibrium_operator(c, stencils.radius)[component])
    on_x, on_y = moduli_of(c)[2 * component : 2 * component + 2, ..., 0]
    return operator_rows(stencils, SECOND, np.stack([on_x[0], on_x[1] + on_y[0], on_y[1]]))


def _equilibrium_operator(c: FloatArray, radius: FloatArray) -> FloatArray:
    """div sigma at a ``radius`` (e,) by value, first and second derivatives of u_x and u_y: (2, 6, 2, e)."""
    strain = strain_operator(radius)
    value, by_x, by_y = np.zeros((3, 4, 6, 2, len(radius)))
    value[:, :3] = by_x[:, WITH_X] = by_y[:, WITH_Y] = strain
    inverse = strain[HOOP, 0, 0]
    by_x[HOOP, 0, 0] = -(inverse**2)
    around = np.where(inverse > 0.0, inverse * value, by_x)
    terms = np.stack([by_x, by_y, around])
    along = np.stack([c[XX], c[XY], c[XX] - c[HOOP]]), np.stack([c[XY], c[YY], c[XY]])
    x, y = (np.einsum("ts,tskie->kie", moduli, terms) for moduli in along)
    return np.stack([np.where(inverse > 0.0, x, 0.0), y])


def nested_equilibrium_rows(stencils: Stencils, c: FloatArray, component: int) -> sparse.csr_array:
    """Rows (n, 2n) of div sigma in x (0) or y (1) at nodes, by first derivatives of nodal stresses."""
    radius = stencils.radius
    first, second = ((XX, XY), (XY, YY))[component]
    of_x, of_y = (stress_rows(stencils, c, one) for one in (first, second))
    # The shear stress is odd about an axis of revolution.
    d_x = scalar_rows(stencils, stencils.weights[:, 1], odd=first == XY)
    rows = d_x @ of_x + scalar_rows(stencils, stencils.weights[:, 2], odd=second == XY) @ of_y
    if radius is not None:
        one, none = np.ones(len(radius)), np.zeros(len(radius))
        around = sparse.diags_array(over_radius(one, none, radius))
        if component == 0:
            of_x = of_x - stress_rows(stencils, c, HOOP)
        rows = rows + around @ (scalar_rows(stencils, stencils.weights[:, 0], odd=first == XY) @ of_x)
        off_axis = sparse.diags_array(over_radius(none, one, radius) * component)
        rows = rows + off_axis @ (d_x @ of_x)
    return sparse.csr_array(rows)


def strain_of(derivatives: FloatArray, radius: FloatArray | None = None) -> FloatArray:
    """Strains xx, yy, 2 xy and, at points of a ``radius`` (e,), hoop (e, 3 | 4), from ``derivatives`` (e, 3 |
    6, 2) of the displacement, value first."""
    by_x, by_y = derivatives[:, 1], derivatives[:, 2]
    strain = [by_x[:, 0], by_y[:, 1], by_x[:, 1] + by_y[:, 0]]
    if radius is not None:
        strain.append(over_radius(derivatives[:, 0, 0], by_x[:, 0], radius))
    return np.stack(strain, axis=1)


def stress_of(derivatives: FloatArray, c: FloatArray, radius: FloatArray | None = None) -> FloatArray:
    """Stress (e, 3 | 4) from ``derivatives`` (e, 3 | 6, 2) of the displacement, as in :func:`strain_of`."""
    return np.asarray(strain_of(derivatives, radius) @ c.T)


def divergence_of(derivatives: FloatArray, c: FloatArray, radius: FloatArray | None = None) -> FloatArray:
    """div sigma (e, 2) from ``derivatives`` (e, 6, 2) of the displacement."""
    if radius is not None:
        return np.asarray(np.einsum("fkie,eki->ef", _equilibrium_operator(c, radius), derivatives))
    by_x, by_y = (stress_of(derivatives[:, kinds], c) for kinds in (WITH_X, WITH_Y))
    return np.stack([by_x[:, XX] + by_y[:, XY], by_x[:, XY] + by_y[:, YY]], axis=1)


def divergence_of_stress(derivatives: FloatArray, radius: FloatArray | None = None) -> FloatArray:
    """div sigma (e, 2) from ``derivatives`` (e, 3 | 6, 3 | 4) of the stress, value first."""
    value, by_x, by_y = np.moveaxis(derivatives[:, :3], 1, 0)
    found = np.stack([by_x[:, XX] + by_y[:, XY], by_x[:, XY] + by_y[:, YY]], axis=1)
    if radius is not None:
        found[:, 0] += over_radius(value[:, XX] - value[:, HOOP], 0.0 * radius, radius)
        found[:, 1] += over_radius(value[:, XY], by_x[:, XY], radius)
    return found


def point_rows(
    stencils: Stencils, material: PlaneMaterial, nodal: Callable[[], Stencils]
) -> sparse.csr_array:
    """Rows (5e | 6e, 2N) of u_x, u_y, sigma_xx, sigma_yy, sigma_xy and, in bodies of revolution, the hoop
    stress at the points of ``stencils``, quantity by quantity. Nearly incompressible materials interpolate a
    nodal field of mean pressure: ``nodal`` gives its stencils."""
    hidden = material.nearly_incompressible
    even = material.bulk_part if hidden else np.zeros_like(material.stiffness)
    value = stencils.weights[:, 0]
    blocks = [vector_rows(stencils, value, None), vector_rows(stencils, None, value)]
    blocks += [stress_rows(stencils, material.stiffness - even, part) for part in range(len(even))]
    if hidden:
        mean = scalar_rows(stencils, value) @ stress_rows(nodal(), even, XX)
        for part in np.flatnonzero(even.any(axis=0)):
            blocks[2 + part] = sparse.csr_array(blocks[2 + part] + mean)
    return sparse.csr_array(sparse.vstack(blocks, format="csr"))


def traction_of(stress: FloatArray, normal: FloatArray) -> FloatArray:
    """Tractions (b, 2) of ``stress`` (b, 3 | 4) or (3 | 4,) on surfaces with ``normal`` (b, 2)."""
    xx, yy, xy = stress.T[:3]
    x, y = normal.T
    return np.stack([xx * x + xy * y, xy * x + yy * y], axis=1)


def von_mises(stress: FloatArray, across: FloatArray) -> FloatArray:
    """Von Mises stress (n,) of plane ``stress`` (n, 3) and out-of-plane stress ``across`` (n,)."""
    (xx, yy, xy), zz = stress.T[:3], across
    return np.asarray(np.sqrt(0.5 * ((xx - yy) ** 2 + (yy - zz) ** 2 + (zz - xx) ** 2) + 3.0 * xy**2))
