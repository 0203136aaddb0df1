"""Contact of floating bodies, where some sets leave rigid motions undetermined.

With friction, motions that no closed node resists and no load drives are held. Without it some sets resist
motions that loads drive only at the end of a search: soft springs at the last position make every set
solvable; repeated with ever softer springs, their forces vanish (proximal point method: Rockafellar 1976,
doi:10.1137/0314056). They start at the drawn positions, so that motions that nothing drives stay zero.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mlsanm_cli.arrays import BoolArray, FloatArray
from mlsanm_cli.contact.response.condensed import Condensed
from mlsanm_cli.contact.response.dense import null_space

ROUND_OFF, UNRESISTED = 1e-9, 1e-7
"""Parts of motions that are round-off; and parts that closed nodes resist below which, squared, the stiffness
is round-off."""
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


@dataclass(frozen=True, eq=False)
class IdleMotions:
    """Orthonormal scaled ``motions`` (k, d) that no closed node resists and no load drives, and their
    ``balances`` (k, d): combinations of the scaled ones to which no closed node contributes."""

    motions: FloatArray
    balances: FloatArray

    @classmethod
    def of(cls, condensed: Condensed, closed: BoolArray, force: FloatArray) -> IdleMotions | None:
        """Those of a set with ``closed`` nodes (m,) and a ``force`` (k,) on the motions; None if there are
        none, or if they are not determined."""
        rows, _, whole = condensed.scaled
        m, n = len(closed), len(condensed.friction_nodes)
        on = np.flatnonzero(np.concatenate([closed, closed[condensed.friction_nodes]]))
        stiffness = whole[m + n :, m + n :].T
        motions = null_space(np.vstack([whole[m + n :, on].T, stiffness]), UNRESISTED)
        balances = null_space(np.vstack([whole[on, m + n :], stiffness.T]), UNRESISTED)
        if not motions.size or motions.shape != balances.shape:
            return None
        driving = rows[m + n :] * force
        if np.abs(driving @ balances).max() > ROUND_OFF * np.abs(driving).max():
            return None
        return cls(motions, balances)

    def same(self, other: IdleMotions | None) -> bool:
        """Whether ``other`` are the same motions."""
        if other is None or other.motions.shape != self.motions.shape:
            return False
        common = np.linalg.svd(self.motions.T @ other.motions, compute_uv=False)
        return bool(common.min() > 1.0 - ROUND_OFF)
