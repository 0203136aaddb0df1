"""Slips of short waves, which the discretisation does not resolve."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import scipy.sparse as sparse

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.contact.linear_map import LinearMap
from mlsanm_cli.contact.pairing import Pairing, surface_fit, unrolled

SMOOTH = 6.0
"""Half-width in spacings of the windows of the local fits: linear functions over a window are left alone."""
SHORTEST = 3.0 / np.pi
"""Compliance for a traction that changes its sign from node to node, times E*/h.

A traction cos(k x) moves the surface of a half-plane by 2/(E* k) cos(k x), and k = pi/h gives 2/pi; half as
much more, measured, makes up for what waves a little longer lack."""


def resolved_slip(
    slip: LinearMap,
    pairings: tuple[Pairing, ...],
    places: Mapping[str, slice],
    softness: Mapping[str, FloatArray],
) -> tuple[LinearMap, FloatArray]:
    """The slips (n,) of all contacts with friction, with short waves about as a half-plane has them.

    ``places`` are the contacts' rows, ``softness`` 1/E* at their nodes along the tangent. Let F be a local
    linear fit along the surface. Slips that anything but the contact's own tractions causes are smooth; what
    they have of short waves comes from the clouds' irregularity, and they become F s. Least squares follow a
    traction t the less the shorter its waves are, at two spacings hardly at all: what it differs by from its
    own fit gets the compliance 3 h/(pi E*) (t - F t) on top. Without this, tractions of sticking nodes
    oscillated from node to node by 30 %. With G t the linear function nearest to t over the whole contact,
    slips due to G t are fitted like the others, so that a patch under uniform stress stays exact. All around
    a closed surface, F runs on across the seam and G t is a constant, the only linear function there is.

    Returned too is what own tractions cause beyond the fit of all slips (n, n).
    """
    kept = slip.take(np.arange(len(slip.constant)))
    beyond = np.zeros_like(slip.traction)
    for pairing in pairings:
        own, chosen = places[pairing.name], pairing.candidate
        spacing = pairing.spacing[chosen]
        fit = slip_fit(pairing).toarray()
        short = np.eye(len(fit)) - fit
        compliance = slip.traction[own, own]
        for array in (kept.constant, kept.load, kept.motion, kept.pressure, kept.traction):
            array[own] = fit @ array[own]
        by_own = compliance - short @ compliance @ _linear_part(pairing)
        shortest = SHORTEST * softness[pairing.name] * spacing
        kept.traction[own, own] = by_own + shortest[:, None] * short
        beyond[own, own] = kept.traction[own, own] - fit @ compliance
    return kept, beyond


def slip_fit(pairing: Pairing) -> sparse.csr_array:
    """The local linear fit F (n, n) of nodal values along a contact."""
    chosen = pairing.candidate
    around, weight, _ = unrolled(pairing)
    places = pairing.arc[chosen]
    fit = surface_fit(around, weight, places, SMOOTH * pairing.spacing[chosen]).tocoo()
    rows, columns = fit.coords
    count = len(places)
    return sparse.csr_array((fit.data, (rows, columns % count)), shape=(count, count))


def _linear_part(pairing: Pairing) -> FloatArray:
    """The linear function nearest to nodal values (n,) of a contact, as a matrix (n, n)."""
    arc, weight = pairing.arc[pairing.candidate], pairing.weight[pairing.candidate]
    freedoms = 1 if pairing.all_around else 2
    basis = np.stack([np.ones(len(arc)), arc - arc.mean()], axis=1)[:, : min(freedoms, len(arc))]
    moments = basis.T @ (weight[:, None] * basis)
    result: FloatArray = basis @ np.linalg.solve(moments, basis.T * weight)
    return result
