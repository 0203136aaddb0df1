"""Frictionless contact of floating bodies, where some active sets leave rigid motions undetermined.

Soft springs at the last position make every set solvable; repeated with ever softer springs, their forces
vanish (proximal point method: Rockafellar 1976, doi:10.1137/0314056). They start at the drawn positions, so
that motions that nothing drives stay zero.
"""

from __future__ import annotations

import numpy as np

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.contact.response.condensed import Condensed

STIFFNESS_SEQUENCE = (1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9, *(1e-10,) * 10)
"""Spring stiffness over that of the contacts, iteration by iteration."""
FORCE_TOLERANCE, PRESSURE_TOLERANCE = 1e-11, 1e-10
"""Final spring forces relative to loads and pressures; pressures below which residual spring forces may
be."""


def springs(condensed: Condensed) -> FloatArray:
    """Stiffness (k,) of the contacts against the motions, with the sign of springs in the balances."""
    moved, weight = condensed.gap.motion, condensed.weight
    sign = np.sign((condensed.balance.pressure * (weight[:, None] * moved).T).sum(axis=1))
    stiff = (weight[:, None] * moved**2).sum(axis=0) / (condensed.largest_compliance or 1.0)
    return np.asarray(-np.where(sign != 0.0, sign, 1.0) * np.where(stiff > 0.0, stiff, 1.0))


def at_rest(condensed: Condensed, factors: FloatArray, pressure: FloatArray, pull: FloatArray) -> bool:
    """Whether the spring forces ``pull`` (k,) are negligible against the loads and pressures (m,)."""
    balance = condensed.balance
    force = np.abs(balance.constant) + np.abs(balance.load) @ np.abs(factors)
    force = force + np.abs(balance.pressure).sum(axis=1) * np.abs(pressure).max(initial=0.0)
    return bool((np.abs(pull) <= FORCE_TOLERANCE * force).all())
