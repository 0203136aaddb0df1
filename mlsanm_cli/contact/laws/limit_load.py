"""The largest part of a stage's loads that contacts can carry: a limit load of rigid bodies.

Pressures push only, tractions stay in Coulomb's cone, and every unknown motion is in equilibrium. How much of
the loads this allows is a linear program (Livesley 1978, doi:10.1002/nme.1620121207, for masonry); its
multipliers are the motion in which the bodies give way. Deformation only matters as far as it changes places.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.contact.response.condensed import Condensed

WHOLE_STAGE = 1.0 - 1e-9
"""Parts of a stage above this are the whole stage."""


@dataclass(frozen=True, eq=False)
class LimitLoad:
    """``part`` of a stage's change of loads that can be carried, the ``motion`` (k,) beyond it, up to a
    factor, how much ``rubbed`` of the loads' work friction takes up in it, and whether anything is
    ``pressed``."""

    part: float
    motion: FloatArray
    rubbed: float
    pressed: bool

    @property
    def whole(self) -> bool:
        """Whether all of the stage can be carried, by contacts that are closed or open as yet."""
        return self.part >= WHOLE_STAGE


def limit_load(condensed: Condensed, begin: FloatArray, change: FloatArray) -> LimitLoad | None:
    """The limit of load factors ``begin`` (L,) + part ``change`` (L,); None where nothing of the stage can be
    carried, or no motion is unknown."""
    balance, nodes = condensed.balance, condensed.friction_nodes
    m, n, k = len(condensed.weight), len(nodes), len(balance.constant)
    if not k or not m:
        return None
    start, more = balance.constant + balance.load @ begin, balance.load @ change
    size = max(np.abs(start).max(), np.abs(more).max())
    if not size:
        return None
    # Unknowns are forces in units of the loads', so that no unit decides.
    unit = size / condensed.weight
    rows = np.hstack([balance.pressure * unit, balance.traction * unit[nodes], balance.motion, more[:, None]])
    known = np.abs(rows[:, : m + n]).max(axis=1)
    scale = np.where(known > 0.0, known, size)
    cone = np.zeros((2, n, m + n + k + 1))
    each = np.arange(n)
    for side, sign in enumerate((1.0, -1.0)):
        cone[side, each, m + each] = sign
        cone[side, each, nodes] = -condensed.friction
    from scipy.optimize import linprog  # for few runs

    found = linprog(
        np.append(np.zeros(m + n + k), -1.0),
        A_ub=cone.reshape(2 * n, -1) if n else None,
        b_ub=np.zeros(2 * n) if n else None,
        A_eq=rows / scale[:, None],
        b_eq=-start / scale,
        bounds=[(0.0, None)] * m + [(None, None)] * (n + k) + [(0.0, 1.0)],
    )
    if found.status != 0 or found.x is None:
        return None
    forces, part, motion = found.x[: m + n], float(found.x[-1]), found.eqlin.marginals / scale
    work = abs(float(more @ motion)) * part
    across, along = np.abs(condensed.gap.motion @ motion), np.abs(condensed.slip.motion @ motion)
    if work:
        rubbed = float(np.abs(forces[m:] * unit[nodes] * (balance.traction.T @ motion)).sum()) / work
    else:
        # Nothing is carried: what matters is the direction.
        rubbed = float(along.max(initial=0.0) > across.max(initial=0.0))
    touching = forces[:m][np.abs(balance.pressure.T @ motion) + across > 0.0]
    return LimitLoad(part, motion, min(rubbed, 1.0), bool(touching.max(initial=0.0) > 1e-9))
