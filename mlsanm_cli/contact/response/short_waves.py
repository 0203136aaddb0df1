"""Tractions and slips of short waves, which the discretisation does not resolve."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import scipy.sparse as sparse

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.contact.geometry.pairing import Pairing
from mlsanm_cli.contact.geometry.transfer import candidates_fit
from mlsanm_cli.contact.response.linear_map import LinearMap

WINDOW = 6.0
"""Half-width of the windows of the local fits, in spacings: linear functions over a window are not
changed."""
SHORTEST = 3.0 / np.pi
"""Compliance for a traction that changes its sign from node to node, times E*/h.

A traction cos(k x) moves the surface of a half-plane by 2/(E* k) cos(k x), and k = pi/h gives 2/pi; half as
much again, measured, compensates for slightly longer waves."""


def resolved(
    gap: LinearMap,
    slip: LinearMap,
    pairings: tuple[Pairing, ...],
    gaps: Mapping[str, slice],
    slips: Mapping[str, slice],
    contact_compliance: Mapping[str, FloatArray],
) -> tuple[LinearMap, LinearMap, sparse.csr_array]:
    """The gaps (m,) and the slips (n,) of all contacts with friction, with short waves about as a half-plane
    has them.

    ``gaps`` and ``slips`` are the contacts' places among both, ``contact_compliance`` 1/E* at their nodes
    along the tangent. Let F be a local linear fit along the surface. Slips that anything but the contact's
    own tractions causes are smooth; what they have of short waves comes from the clouds' irregularity, and
    they become F s. Least squares follow a traction t the less the shorter its waves are, at two spacings
    hardly at all: what it differs by from its own fit gets the compliance 3 h/(pi E*) (t - F t) on top.
    Without this, tractions of sticking nodes oscillated from node to node by 30 %. With G t the linear
    function nearest to t over the whole contact, slips due to G t are fitted like the others, so that a patch
    under uniform stress stays exact. All around a closed surface, F runs on across the seam and G t is a
    constant, the only linear function there is.

    Gaps follow F t only, and slips due to pressures F p only. With the short waves of t in gaps, but not in
    slips those of the pressures, the two together lost their positivity where spacings grow along the
    contact. And a body does not feel quite the force that the weights give a pressure of short waves: what
    that moves does not go down with the spacing, as the compliance of short waves does.

    Returned too is what pressures and tractions cause beyond the displacements' own gaps and beyond the fit
    of their slips (m + n, m + n).
    """
    m, n = len(gap.constant), len(slip.constant)
    if not pairings:
        return gap, slip, sparse.csr_array((m + n, m + n))
    gap, slip = gap.take(np.arange(m)), slip.take(np.arange(n))
    beyond = np.zeros((m + n, m + n))
    by_pressure, by_traction = beyond[:, :m], beyond[:, m:]
    for pairing in pairings:
        own, facing = slips[pairing.name], gaps[pairing.name]
        fit = slip_fit(pairing).toarray()
        short = np.eye(len(fit)) - fit
        by_traction[:m, own] = -gap.traction[:, own] @ short
        gap.traction[:, own] += by_traction[:m, own]
        compliance = slip.traction[own, own].copy()
        for array in (slip.constant, slip.load, slip.motion, slip.pressure, slip.traction):
            array[own] = fit @ array[own]
        by_pressure[m:][own, facing] = -slip.pressure[own, facing] @ short
        slip.pressure[own, facing] += by_pressure[m:][own, facing]
        by_own = compliance - short @ compliance @ _linear_part(pairing)
        shortest = SHORTEST * contact_compliance[pairing.name] * pairing.spacing[pairing.candidate]
        slip.traction[own, own] = by_own + shortest[:, None] * short
        by_traction[m:][own, own] = slip.traction[own, own] - fit @ compliance
    return gap, slip, sparse.csr_array(beyond)


def slip_fit(pairing: Pairing) -> sparse.csr_array:
    """The local linear fit F (n, n) of nodal values along a contact."""
    chosen = pairing.candidate
    return candidates_fit(pairing, pairing.arc[chosen], WINDOW * pairing.spacing[chosen])


def _linear_part(pairing: Pairing) -> FloatArray:
    """The linear function nearest to nodal values (n,) of a contact, as a matrix (n, n)."""
    arc, weight = pairing.arc[pairing.candidate], pairing.weight[pairing.candidate]
    freedoms = 1 if pairing.all_around else 2
    basis = np.stack([np.ones(len(arc)), arc - arc.mean()], axis=1)[:, : min(freedoms, len(arc))]
    moments = basis.T @ (weight[:, None] * basis)
    result: FloatArray = basis @ np.linalg.solve(moments, basis.T * weight)
    return result
