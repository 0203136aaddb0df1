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
from mlsanm_cli.mechanics.material import PlaneMaterial
from mlsanm_cli.operators.stencil_weights import Stencils, component_rows, pair_rows, scalar_rows

XX, YY, XY, HOOP = 0, 1, 2, 3


WITH_X, WITH_Y = (1, 3, 4), (2, 4, 5)
"""Derivatives by x and y of value, x and y among the weights of a stencil."""


def operator_rows(stencils: Stencils, kinds: slice, coefficients: FloatArray) -> sparse.csr_array:
    """Rows (e, 2n) of derivatives ``kinds`` (m) of u_x and u_y times ``coefficients`` (m, 2, e | 1)."""
    weights = stencils.weights[:, kinds]
    if coefficients.shape[-1] == 1:
        return pair_rows(stencils, weights @ coefficients[..., 0])
    entry = np.repeat(np.arange(len(stencils.indptr) - 1), np.diff(stencils.indptr))
    values = np.zeros((len(weights), 2))
    for weight, coefficient in zip(weights.T, coefficients, strict=True):
        values += weight[:, None] * coefficient.T[entry]
    return pair_rows(stencils, values)


def over_radius(values: FloatArray, slopes: FloatArray, radius: FloatArray) -> FloatArray:
    """``values`` (e,) over the ``radius`` (e,), on the axis their ``slopes`` (e,) by x."""
    return np.divide(values, radius, out=slopes + 0.0 * values, where=radius > 0.0)


def strain_operator(radius: FloatArray | None) -> FloatArray:
    """Strains xx, yy, 2 xy by d/dx and d/dy of u_x, u_y: (3, 2, 2, 1); at a ``radius`` (e,) also the hoop
    strain, and by the value, first: (4, 3, 2, e)."""
    found = np.zeros((4, 3, 2, 1 if radius is None else len(radius)))
    found[XX, 1, 0] = found[XY, 2, 0] = found[XY, 1, 1] = found[YY, 2, 1] = 1.0
    if radius is None:
        return found[:HOOP, 1:]
    one, none = np.ones(len(radius)), np.zeros(len(radius))
    found[HOOP, 0, 0], found[HOOP, 1, 0] = over_radius(one, none, radius), over_radius(none, one, radius)
    return found


def stress_operator(c: FloatArray, radius: FloatArray | None = None) -> FloatArray:
    """Stresses xx, yy, xy and hoop likewise."""
    return np.asarray(np.einsum("as,skie->akie", c, strain_operator(radius)))


def moduli_of(c: FloatArray, radius: FloatArray | None = None) -> FloatArray:
    """The same (4, ...) of xx, xy, yx, yy."""
    return stress_operator(c, radius)[[XX, XY, XY, YY]]


def first_order_rows(stencils: Stencils, coefficients: FloatArray) -> sparse.csr_array:
    """Rows (e, 2n) with ``coefficients`` (2 | 3, 2, e | 1) of (value and) first derivatives."""
    last = min(stencils.weights.shape[1], 3)
    return operator_rows(stencils, slice(last - len(coefficients), last), coefficients)


def stress_rows(stencils: Stencils, c: FloatArray, component: int) -> sparse.csr_array:
    """Rows (e, 2n) of the stress ``component`` XX, YY, XY or HOOP at the stencils' points."""
    return first_order_rows(stencils, stress_operator(c, stencils.radius)[component])


def traction_moduli(moduli: FloatArray, normal: FloatArray, component: int) -> FloatArray:
    """Coefficients (m, 2, b) of the traction x (0) or y (1) on ``normal`` (b, 2), ``moduli`` (4, m, 2, b |
    1)."""
    on_x, on_y = moduli[2 * component : 2 * component + 2]
    return np.asarray(on_x * normal[:, 0] + on_y * normal[:, 1])


def force_sums(arm: FloatArray, normal: FloatArray) -> sparse.csr_array:
    """Matrix (3e, 3 e t) from stresses xx, then yy and xy, at t points around e centres to forces x, forces y
    and moments with ``arm`` (e, t, 2); ``normal`` (e, t, 2) includes the quadrature weights."""
    places, times = normal.shape[:2]
    owner, point = np.repeat(np.arange(places), times), np.arange(places * times)
    (n_x, n_y), (a_x, a_y) = normal.reshape(-1, 2).T, arm.reshape(-1, 2).T
    terms = [(0, XX, n_x), (0, XY, n_y), (1, YY, n_y), (1, XY, n_x)]
    terms += [(2, XX, -a_y * n_x), (2, YY, a_x * n_y), (2, XY, a_x * n_x - a_y * n_y)]
    lines = np.concatenate([places * row + owner for row, _, _ in terms])
    columns = np.concatenate([len(point) * part + point for _, part, _ in terms])
    entries = (np.concatenate([values for *_, values in terms]), (lines, columns))
    return sparse.csr_array(entries, shape=(3 * places, 3 * len(point)))


def equilibrium_operator(c: FloatArray, radius: FloatArray | None = None) -> FloatArray:
    """div sigma by value, first and second derivatives of u_x and u_y: (2, 6, 2, 1), at a ``radius`` (e,) (2,
    6, 2, e)."""
    strain = strain_operator(radius)
    by_x, by_y, value = np.zeros((3, len(c), 6, *strain.shape[2:]))
    kinds = slice(3 - strain.shape[1], 3)
    value[:, kinds], by_x[:, WITH_X[kinds]], by_y[:, WITH_Y[kinds]] = strain, strain, strain
    terms, along = [by_x, by_y], [[c[XX], c[XY]], [c[XY], c[YY]]]
    if radius is not None:
        inverse = strain[HOOP, 0, 0]
        by_x[HOOP, 0, 0] = -(inverse**2)
        terms.append(np.where(inverse > 0.0, inverse * value, by_x))
        along = [[*along[0], c[XX] - c[HOOP]], [*along[1], c[XY]]]
    x, y = (np.einsum("ts,tskie->kie", np.stack(moduli), np.stack(terms)) for moduli in along)
    return np.stack([x if radius is None else np.where(inverse > 0.0, x, 0.0), y])


def divergence_rows(stencils: Stencils, component: int) -> sparse.csr_array:
    """Rows (n, 3n | 4n) of div s in x (0) or y (1) by nodal stresses: xx of all nodes, yy, xy, hoop."""
    # The shear stress is odd about an axis of revolution.
    weights, radius = stencils.weights, stencils.radius
    d_x, d_y = (scalar_rows(stencils, weights[:, 1 + axis], odd=axis != component) for axis in (0, 1))
    nothing = sparse.csr_array(d_x.shape)
    if radius is not None:
        one, none = np.ones(len(radius)), np.zeros(len(radius))
        value = scalar_rows(stencils, weights[:, 0], odd=component == 1)
        around = sparse.diags_array(over_radius(one, none, radius)) @ value
        d_x = d_x + around + component * (sparse.diags_array(over_radius(none, one, radius)) @ d_x)
    parts = [nothing, d_y, d_x] if component else [d_x, nothing, d_y]
    if radius is not None:
        parts.append(nothing if component else -around)
    return sparse.csr_array(sparse.hstack(parts, format="csr"))


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
    return np.asarray(np.einsum("fkie,eki->ef", equilibrium_operator(c, radius), derivatives))


def divergence_of_stress(derivatives: FloatArray, radius: FloatArray | None = None) -> FloatArray:
    """div sigma (e, 2) from ``derivatives`` (e, 3 | 6, 3 | 4) of the stress, value first."""
    value, by_x, by_y = np.moveaxis(derivatives[:, :3], 1, 0)
    found = np.stack([by_x[:, XX] + by_y[:, XY], by_x[:, XY] + by_y[:, YY]], axis=1)
    if radius is not None:
        found[:, 0] += over_radius(value[:, XX] - value[:, HOOP], 0.0 * radius, radius)
        found[:, 1] += over_radius(value[:, XY], by_x[:, XY], radius)
    return found


def stresses_at(
    stencils: Stencils, material: PlaneMaterial, mean: Callable[[FloatArray], sparse.csr_array]
) -> list[sparse.csr_array]:
    """Rows (e, 2N) of all stresses at the points of ``stencils``. In nearly incompressible materials the
    stress of the bulk part is a nodal field, interpolated by the rows ``mean`` of this part."""
    c, even = material.stiffness, material.bulk_part
    if not material.nearly_incompressible:
        return [stress_rows(stencils, c, part) for part in range(len(c))]
    found, nested = [stress_rows(stencils, c - even, part) for part in range(len(c))], mean(even)
    return [
        sparse.csr_array(rows + nested) if of.any() else rows for rows, of in zip(found, even, strict=True)
    ]


def point_rows(
    stencils: Stencils, material: PlaneMaterial, nodal: Callable[[], Stencils]
) -> sparse.csr_array:
    """Rows (5e | 6e, 2N) of u_x, u_y and all stresses at the points of ``stencils``, quantity by quantity;
    ``nodal`` gives the stencils of the nodes."""
    value = stencils.weights[:, 0]

    def mean(even: FloatArray) -> sparse.csr_array:
        return sparse.csr_array(scalar_rows(stencils, value) @ stress_rows(nodal(), even, XX))

    blocks = [component_rows(stencils, value, component) for component in (0, 1)]
    blocks += stresses_at(stencils, material, mean)
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
