"""What small changes of gaps and slips do to a contact state with friction: what slips continues to slip."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mlsanm_cli.arrays import BoolArray, FloatArray
from mlsanm_cli.contact.response.condensed import Condensed
from mlsanm_cli.errors import NumericalError

ROUNDS = 30
"""Changes of the set of closed nodes, of which each round makes one."""


@dataclass(frozen=True)
class Change:
    """Changes of pressures (m,), tractions (n,) and unknown motions (k,)."""

    pressure: FloatArray
    traction: FloatArray
    motion: FloatArray


def frozen_change(
    condensed: Condensed,
    pressure: FloatArray,
    traction: FloatArray,
    gaps: FloatArray,
    closed: BoolArray,
    stuck: BoolArray,
    by: tuple[FloatArray, FloatArray, FloatArray],
) -> Change:
    """How a state with ``pressure`` (m,), ``traction`` (n,) and ``gaps`` (m,) answers when gaps (m,), slips
    (n,) and the force imbalance of the rigid constraints (k,) change ``by`` so much.

    Nodes that are ``closed`` (m,) stay so unless they would pull, open ones unless they would overlap; of the
    nodes with friction those ``stuck`` (n,) keep their slips, the others slip as they do. So the change is
    linear but for the edges: the history of the loads need not be followed again. Raises NumericalError where
    that has no solution.
    """
    closed = closed.copy()
    found = Change(np.zeros_like(pressure), np.zeros_like(traction), np.zeros(len(by[2])))
    for _ in range(ROUNDS):
        found = _solved(condensed, pressure, traction, gaps, closed, stuck, by)
        after = pressure + found.pressure
        moved = gaps + by[0] + condensed.gap.pressure @ found.pressure
        moved += condensed.gap.traction @ found.traction + condensed.gap.motion @ found.motion
        least = np.finfo(float).eps ** 0.5 * np.abs(pressure).max(initial=0.0)
        changed = np.where(closed, after < -least, moved < -least / max(1.0, _stiffness(condensed)))
        if not changed.any():
            return found
        closed ^= changed
    return found


def _stiffness(condensed: Condensed) -> float:
    """Pressure per gap, roughly: the scale below which gaps do not matter."""
    size = float(np.abs(np.diagonal(condensed.gap.pressure)).max(initial=0.0))
    return 1.0 / size if size > 0.0 else 1.0


def _solved(
    condensed: Condensed,
    pressure: FloatArray,
    traction: FloatArray,
    gaps: FloatArray,
    closed: BoolArray,
    stuck: BoolArray,
    by: tuple[FloatArray, FloatArray, FloatArray],
) -> Change:
    """The change with the sets as they are."""
    m, n, k = len(pressure), len(traction), len(by[2])
    gap, slip, balance = condensed.gap, condensed.slip, condensed.balance
    matrix, right = np.eye(m + n + k), np.zeros(m + n + k)
    on = np.flatnonzero(closed)
    matrix[on] = np.hstack([gap.pressure, gap.traction, gap.motion])[on]
    right[on] = -(gaps + by[0])[on]
    off = np.flatnonzero(~closed)
    right[off] = -pressure[off]
    friction_nodes = closed[condensed.friction_nodes]
    rows = np.flatnonzero(friction_nodes & stuck)
    matrix[m + rows] = np.hstack([slip.pressure, slip.traction, slip.motion])[rows]
    right[m + rows] = -by[1][rows]
    rows = np.flatnonzero(friction_nodes & ~stuck)
    matrix[m + rows, condensed.friction_nodes[rows]] = -(condensed.friction * np.sign(traction))[rows]
    rows = np.flatnonzero(~friction_nodes)
    right[m + rows] = -traction[rows]
    matrix[m + n :] = np.hstack([balance.pressure, balance.traction, balance.motion])
    right[m + n :] = -by[2]
    scale = np.abs(matrix).max(axis=1)
    try:
        found = np.linalg.solve(matrix / scale[:, None], right / scale)
    except (np.linalg.LinAlgError, ZeroDivisionError) as error:
        raise NumericalError("the contact state is singular") from error
    if not np.isfinite(found).all():
        raise NumericalError("the contact state is singular")
    return Change(found[:m], found[m : m + n], found[m + n :])
