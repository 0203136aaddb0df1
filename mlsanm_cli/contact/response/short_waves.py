"""Correction of short-wave tractions and slips, which the discretisation does not resolve."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import scipy.sparse as sparse

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.contact.geometry.pairing import Pairing
from mlsanm_cli.contact.response.drivers import Drivers
from mlsanm_cli.contact.response.linear_map import LinearMap
from mlsanm_cli.roundoff import FINE_ROUND_OFF

FIT_WINDOW, WINDOW_SHARPNESS = 6.0, 4.0
"""Half-width of the windows of local fits in spacings, and s in their weights exp(-2 s r^2) at a fraction r:
linear functions are unaffected."""
ALTERNATING_COMPLIANCE = 3.0 / np.pi
"""Compliance times E*/h for a traction of alternating sign from node to node.

A traction cos(k x) displaces the surface of a half-plane by 2/(E* k) cos(k x), and k = pi/h gives 2/pi; the
measured additional half compensates for slightly longer waves."""


def correct_short_waves(
    gap: LinearMap, slip: LinearMap, drivers: Drivers, half_planes: Mapping[str, FloatArray]
) -> tuple[LinearMap, LinearMap, sparse.csr_array]:
    """Gaps (m,) and slips (n,) of all frictional contacts with short waves approximately as on a half-plane,
    with 1/E* (m, 2, 2) at the nodes of every contact, and what of them displacements do not cause (m + n, m +
    n).

    Let F be a local linear fit along the surface. Slips due to anything but the contact's own tractions are
    smooth; their short waves come from the clouds' irregularity, and they become F s. Least squares respond
    less to a traction t the shorter its waves: its deviation from the fit gets the compliance 3 h/(pi E*) (t
    - F t) in addition. Without this, tractions of sticking nodes oscillate from node to node. With G t the
    linear function closest to t over the whole contact, slips due to G t are fitted like the others, so that
    a patch under uniform stress stays exact. On a closed surface F continues across the seam and G t is
    constant.

    Gaps depend on F t only, and slips due to pressures on F p only: with short waves of t in the gaps but not
    of p in the slips, the compliance loses its positivity for spacings that grow along the contact. On bodies
    of revolution short waves only get their compliance: fits of one of two coupled responses would cost
    flexible rings their positivity.
    """
    m, n = len(gap.constant), len(slip.constant)
    pairings = [one for one in drivers.frictional if one.nodal and not one.bonded]
    if not pairings:
        return gap, slip, sparse.csr_array((m + n, m + n))
    gap, slip = gap.take(np.arange(m)), slip.take(np.arange(n))
    beyond = np.zeros((m + n, m + n))
    by_pressure, by_traction = beyond[:, :m], beyond[:, m:]
    for pairing in pairings:
        own, facing = drivers.tangential[pairing.name], drivers.spans[pairing.name]
        fit = slip_fit(pairing)
        short = np.eye(len(fit)) - fit
        along = half_planes[pairing.name][:, 1, 1]
        shortest = ALTERNATING_COMPLIANCE * along * pairing.spacing[pairing.candidate]
        if pairing.revolved:
            by_traction[m:][own, own] = shortest[:, None] * short
            slip.traction[own, own] += by_traction[m:][own, own]
            continue
        by_traction[:m, own] = -gap.traction[:, own] @ short
        gap.traction[:, own] += by_traction[:m, own]
        compliance = slip.traction[own, own].copy()
        for array in slip.parts:
            array[own] = fit @ array[own]
        by_pressure[m:][own, facing] = -slip.pressure[own, facing] @ short
        slip.pressure[own, facing] += by_pressure[m:][own, facing]
        arc, weight = pairing.arc[pairing.candidate], pairing.weight[pairing.candidate, None]
        basis = np.stack([np.ones(len(arc)), arc - arc.mean()], axis=1)
        basis = basis[:, : min(1 if pairing.all_around else 2, len(arc))]
        linear = basis @ np.linalg.solve(basis.T @ (weight * basis), (weight * basis).T)
        by_own = compliance - short @ compliance @ linear
        slip.traction[own, own] = by_own + shortest[:, None] * short
        by_traction[m:][own, own] = slip.traction[own, own] - fit @ compliance
    return gap, slip, sparse.csr_array(beyond)


def slip_fit(pairing: Pairing) -> FloatArray:
    """The local linear fit F (n, n) of nodal values along a contact, across the seam of a closed surface."""
    chosen, turns = pairing.candidate, np.zeros(1)
    arc, weight, reach = pairing.arc[chosen], pairing.weight[chosen], FIT_WINDOW * pairing.spacing[chosen]
    if pairing.all_around:
        turns = pairing.slave.curve.length * np.arange(-1.0, 2.0)
    offset = (turns[:, None, None] + arc - arc[:, None]) / reach[:, None]
    share = np.where(np.abs(offset) <= 1.0, np.exp(-2.0 * WINDOW_SHARPNESS * offset**2) * weight, 0.0)
    s0, s1, s2 = ((share * offset**k).sum(axis=(0, 2))[:, None] for k in range(3))
    # A window with a single node can only carry its constant.
    slope, both = s0 * s2 - s1**2 > FINE_ROUND_OFF * s0**2, s0 * s2 - s1**2
    fit = np.where(slope, (s2 - s1 * offset) / np.where(slope, both, 1.0), 1.0 / s0)
    return np.asarray((share * fit).sum(axis=0))
