"""Slips of short waves, which the discretisation does not resolve."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from mlsanm_cli.contact.linear_map import LinearMap
from mlsanm_cli.contact.pairing import Pairing, surface_fit

SMOOTH = 6.0
"""Half-width in spacings of the windows of the local fits: linear functions over a window are left alone."""
SHORTEST = 2.0 / np.pi
"""Compliance of a half-plane for a traction that changes its sign from node to node, times E*/h.

A traction cos(k x) moves the surface by 2/(E* k) cos(k x), and k = pi/h."""


def resolved_slip(
    slip: LinearMap,
    pairings: tuple[Pairing, ...],
    places: Mapping[str, slice],
    softness: Mapping[str, float],
) -> LinearMap:
    """The slips (n,) of all contacts with friction, with short waves as a half-plane has them.

    ``places`` are the contacts' rows, ``softness`` 1/E* of their bodies. With F a local linear fit along the
    surface, slips due to all but the tractions become F s: pressures, loads and motions cause smooth slips,
    and what they have of short waves comes from the clouds' irregularity. Tractions get the half-plane's
    compliance for what they differ by from their own fit, 2 h/(pi E*) (t - F t): least squares follow a
    traction the less the shorter its waves, and at two spacings hardly at all. Without this, tractions of
    sticking nodes oscillated from node to node by 30 %. Linear functions are not touched.
    """
    kept = slip.take(np.arange(len(slip.constant)))
    for pairing in pairings:
        own, chosen = places[pairing.name], pairing.candidate
        arc, spacing = pairing.arc[chosen], pairing.spacing[chosen]
        fit = surface_fit(arc, pairing.weight[chosen], arc, SMOOTH * spacing).toarray()
        for array in (kept.constant, kept.load, kept.motion, kept.pressure):
            array[own] = fit @ array[own]
        shortest = SHORTEST * softness[pairing.name] * spacing
        kept.traction[own, own] += shortest[:, None] * (np.eye(len(arc)) - fit)
    return kept
