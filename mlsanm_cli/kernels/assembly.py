"""Derivatives of a body's rows in a state, from weights of stencils and coefficients at points."""

from __future__ import annotations

from mlsanm_cli.kernels.aot.jit import kernel
from mlsanm_cli.kernels.aot.signature import Float1, Float2, Float3, FloatOut2, Int1, Int2, IntOut1


@kernel
def add_rows(
    indptr: Int1, weights: Float2, stencil: Int1, coefficients: Float3, at: Int1, values: FloatOut2
) -> None:
    """Add the derivatives d/dX, d/dY, d2/dX2, d2/dXdY, d2/dY2, whose weights follow that of the value in
    ``weights`` (nnz, 6), times ``coefficients`` (s, 5, c) of row r, which belongs to ``stencil[r]`` (s,), to
    ``values`` (m, c). Their places there are ``at`` (e,), for the entries of the rows' stencils in turn."""
    place = 0
    for r in range(len(stencil)):
        for entry in range(indptr[stencil[r]], indptr[stencil[r] + 1]):
            for c in range(values.shape[1]):
                total = 0.0
                for kind in range(5):
                    total += weights[entry, 1 + kind] * coefficients[r, kind, c]
                values[at[place], c] += total
            place += 1


@kernel
def add_force_rows(
    indptr: Int1,
    weights: Float2,
    moduli: Float3,
    force: Float2,
    places: Float2,
    fit: Int1,
    owner: Int1,
    sign: Float1,
    middle: Float2,
    size: Float1,
    at: Int2,
    values: FloatOut2,
) -> None:
    """Add the derivatives of the forces x, y and moments over ``size`` (k,) about ``middle`` (2, k) on pieces
    to ``values`` (m, c), at the places ``at`` (3, e) of these rows.

    Stencil i has t points with the ``weights`` (nnz, 3t) of value, d/dX and d/dY; ``moduli`` (q, 6, c) are
    the derivatives of a point's force x, then y, by these three, ``force`` (2, q) and ``places`` (2, q) those
    of the state. Stencil ``fit[j]`` (p,) acts on the piece ``owner[j]`` with a ``sign``.
    """
    times, k = weights.shape[1] // 3, 0
    for j in range(len(fit)):
        i, o = fit[j], owner[j]
        count = indptr[i + 1] - indptr[i]
        for t in range(times):
            q = times * i + t
            arm_x, arm_y = (places[0, q] - middle[0, o]) / size[o], (places[1, q] - middle[1, o]) / size[o]
            pull_x, pull_y = sign[j] * force[0, q] / size[o], sign[j] * force[1, q] / size[o]
            for e in range(count):
                w = weights[indptr[i] + e]
                for c in range(values.shape[1]):
                    x, y = 0.0, 0.0
                    for kind in range(3):
                        x += w[3 * t + kind] * moduli[q, kind, c]
                        y += w[3 * t + kind] * moduli[q, 3 + kind, c]
                    values[at[0, k + e], c] += sign[j] * x
                    values[at[1, k + e], c] += sign[j] * y
                    values[at[2, k + e], c] += sign[j] * (arm_x * y - arm_y * x)
                values[at[2, k + e], 0] += w[3 * t] * pull_y
                values[at[2, k + e], 1] -= w[3 * t] * pull_x
        k += count


@kernel
def add_nested(
    begin: Int1,
    nodes: Int1,
    values: Float2,
    indptr: Int1,
    indices: Int1,
    inner: Float2,
    first: Int1,
    members: Int1,
    slot: IntOut1,
    total: FloatOut2,
) -> None:
    """Add rows on two displacements and a nodal field, with coefficients ``values`` (m, 3) for the ``nodes``
    (m,) from ``begin[r]`` on, to ``total`` (n, 2), with the nodes ``members`` (n,) from ``first[r]`` on. The
    field is given by rows on displacements, ``inner`` (nnz, 2) with offsets ``indptr`` and nodes
    ``indices``. ``slot`` has an entry per node."""
    for r in range(len(begin) - 1):
        for place in range(first[r], first[r + 1]):
            slot[members[place]] = place
        for k in range(begin[r], begin[r + 1]):
            to, factor = slot[nodes[k]], values[k, 2]
            total[to, 0] += values[k, 0]
            total[to, 1] += values[k, 1]
            if factor != 0.0:
                for entry in range(indptr[nodes[k]], indptr[nodes[k] + 1]):
                    to = slot[indices[entry]]
                    total[to, 0] += factor * inner[entry, 0]
                    total[to, 1] += factor * inner[entry, 1]
