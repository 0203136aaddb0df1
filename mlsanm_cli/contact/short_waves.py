"""The compliance that the discretisation withholds from tractions of short waves."""

from __future__ import annotations

import numpy as np

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.contact.pairing import Pairing, surface_fit

SMOOTH = 6.0
"""Half-width in spacings of the windows of the local fits; tractions linear over one are left alone."""
SHORTEST = 2.0 / np.pi
"""Compliance of a half-plane for a traction that changes its sign from node to node, times E*/h.

A traction cos(k x) moves the surface by 2/(E* k) cos(k x), and k = pi/h."""


def short_wave_compliance(pairing: Pairing, softness: float) -> FloatArray:
    """What to add to the tangential compliance (m, m) of a contact; ``softness`` is 1/E*.

    Least squares follow a tangential traction the less the shorter its waves are: at two spacings the
    surfaces hardly move, and tractions would oscillate from node to node for nothing. So what a traction
    differs by from its local linear fit meets the compliance of the half-plane at the shortest wave. Linear
    tractions are not touched, and the addition vanishes with the spacing like its third power.
    """
    chosen = pairing.candidate
    arc, spacing = pairing.arc[chosen], pairing.spacing[chosen]
    fit = surface_fit(arc, pairing.weight[chosen], arc, SMOOTH * spacing).toarray()
    result: FloatArray = SHORTEST * softness * spacing[:, None] * (np.eye(len(arc)) - fit)
    return result
