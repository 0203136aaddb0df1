"""Limit load of rigid bodies in contact: the largest fraction of a stage's loads that can be in equilibrium.

Pressures are non-negative, tractions lie in Coulomb's cone, and every unknown motion is in equilibrium. The
load factor is the solution of a linear program (Livesley 1978, doi:10.1002/nme.1620121207, for masonry); its
multipliers are the collapse mechanism. Deformation matters only by changing positions.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.contact.response.condensed import Condensed

WHOLE_STAGE = 1.0 - 1e-9
"""Fractions of a stage from here on count as the whole stage."""


@dataclass(frozen=True, eq=False)
class LimitLoad:
    """``part`` of a stage's load change that can be carried, collapse ``motion`` (k,) up to a factor,
    fraction ``rubbed`` of the loads' work dissipated by friction in it, and whether any contact is
    ``pressed``."""

    part: float
    motion: FloatArray
    rubbed: float
    pressed: bool

    @property
    def whole(self) -> bool:
        """Whether the whole stage can be carried, by contacts closed or still open."""
        return self.part >= WHOLE_STAGE


def limit_load(condensed: Condensed, begin: FloatArray, change: FloatArray) -> LimitLoad | None:
    """Largest part <= 1 for load factors ``begin`` (L,) + part ``change`` (L,); None if nothing can be
    carried, or if no motion is unknown."""
    balance, nodes = condensed.balance, condensed.friction_nodes
    m, n, k = len(condensed.weight), len(nodes), len(balance.constant)
    if not k or not m:
        return None
    start, more = balance.constant + balance.load @ begin, balance.load @ change
    size = max(np.abs(start).max(), np.abs(more).max())
    if not size:
        return None
    # Forces in units of the loads, so that units do not matter.
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
        # Nothing is carried: the direction of motion decides.
        rubbed = float(along.max(initial=0.0) > across.max(initial=0.0))
    touching = forces[:m][np.abs(balance.pressure.T @ motion) + across > 0.0]
    return LimitLoad(part, motion, min(rubbed, 1.0), bool(touching.max(initial=0.0) > 1e-9))
