"""Exact contact without friction where some sets of closed nodes leave bodies loose.

Soft springs hold every unknown motion where it was last, so that any set has one solution; solved again and
again, ever softer, they pull at nothing in the end (the proximal point method: Rockafellar 1976,
doi:10.1137/0314056). They begin where bodies are drawn, so that what nothing drives stays there.
"""

from __future__ import annotations

import numpy as np

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.contact.response.condensed import Condensed

STIFFNESSES = (1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9, *(1e-10,) * 10)
"""Stiffnesses of the springs over that of the contacts, in turn."""
FORCE_TOLERANCE, PRESSURE_TOLERANCE = 1e-11, 1e-10
"""Largest final force of the springs, over those of loads and pressures; and pressures that they may
cause."""


def springs(condensed: Condensed) -> FloatArray:
    """Stiffness (k,) of contacts against the motions, with the sign of springs in the balances."""
    moved, weight = condensed.gap.motion, condensed.weight
    sign = np.sign((condensed.balance.pressure * (weight[:, None] * moved).T).sum(axis=1))
    stiff = (weight[:, None] * moved**2).sum(axis=0) / (condensed.largest_compliance or 1.0)
    return np.asarray(-np.where(sign != 0.0, sign, 1.0) * np.where(stiff > 0.0, stiff, 1.0))


def at_rest(condensed: Condensed, factors: FloatArray, pressure: FloatArray, pull: FloatArray) -> bool:
    """Whether what the springs ``pull`` with (k,) is nothing beside the loads and pressures (m,)."""
    balance = condensed.balance
    force = np.abs(balance.constant) + np.abs(balance.load) @ np.abs(factors)
    force = force + np.abs(balance.pressure).sum(axis=1) * np.abs(pressure).max(initial=0.0)
    return bool((np.abs(pull) <= FORCE_TOLERANCE * force).all())
