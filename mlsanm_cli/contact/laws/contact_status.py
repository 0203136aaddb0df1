"""Which nodes of contacts are open, stick or slip, and the linear equations that hold meanwhile.

Open nodes carry nothing; closed ones keep h = 0; sticking ones keep the slip they came to rest at,
s = anchor; slipping ones carry t = d mu p with the sense d = +-1.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mlsanm_cli.arrays import BoolArray, FloatArray, IntArray
from mlsanm_cli.contact.response.condensed import Condensed
from mlsanm_cli.contact.response.dense import ScaledFactor

OPEN, STICK, SLIP = 0, 1, 2


@dataclass(frozen=True, eq=False)
class ContactStatus:
    """``closed`` (m,), and of the nodes with friction ``stuck`` (n,) and the ``slip_sign`` (n,) in which
    friction acts on those that are closed and slip; 0 on the others."""

    closed: BoolArray
    stuck: BoolArray
    slip_sign: FloatArray

    @property
    def key(self) -> bytes:
        """Equal for equal sets."""
        return self.closed.tobytes() + self.stuck.tobytes() + self.slip_sign.tobytes()

    def status(self, friction_nodes: IntArray) -> NDArray[np.int8]:
        """What every node (m,) does; closed nodes without friction slip."""
        status = np.where(self.closed, SLIP, OPEN).astype(np.int8)
        status[friction_nodes[self.stuck]] = STICK
        return status


@dataclass(frozen=True, eq=False)
class ContactState:
    """Pressures (m,), tractions (n,), motions (k,), gaps (m,) and slips (n,), or rates of them."""

    pressure: FloatArray
    traction: FloatArray
    motion: FloatArray
    gap: FloatArray
    slip: FloatArray


class SetSystem:
    """The linear equations of one choice of sets, factorised. Raises SingularSystemError."""

    def __init__(self, condensed: Condensed, sets: ContactStatus) -> None:
        self._condensed = condensed
        m, n = len(sets.closed), len(sets.stuck)
        rows, columns, whole = condensed.scaled
        closed, stuck = np.flatnonzero(sets.closed), np.flatnonzero(sets.stuck)
        sliding = np.flatnonzero(sets.slip_sign)
        self._closed, self._stuck, self._sliding = closed, stuck, m + sliding
        kept = np.concatenate([closed, m + stuck, np.arange(m + n, len(whole))])
        self._kept, self._rows, self._columns = kept, rows[kept], columns[kept]
        # Transposed, so that the factor's columns are contiguous.
        matrix = whole.take(kept, axis=0).take(kept, axis=1)
        if len(sliding):
            # A slipping node's traction goes with its pressure.
            self._under = (np.cumsum(sets.closed) - 1)[condensed.friction_nodes[sliding]]
            self._drag = sets.slip_sign[sliding] * condensed.friction[sliding]
            friction_slope = self._drag * self._columns[self._under] / columns[self._sliding]
            matrix[self._under] += friction_slope[:, None] * whole.take(self._sliding, axis=0).take(
                kept, axis=1
            )
        self._factor = ScaledFactor(matrix.T) if len(kept) else None

    def state(self, factors: FloatArray, stick_reference: FloatArray) -> ContactState:
        """The state at load ``factors`` (L,) with sticking nodes held at their ``stick_reference`` (n,)."""
        c = self._condensed
        free_gap = c.gap.constant + c.gap.load @ factors
        free_slip = c.slip.constant + c.slip.load @ factors
        imbalance = c.balance.constant + c.balance.load @ factors
        return self._solve(free_gap, free_slip, imbalance, stick_reference)

    def rate(self, change: FloatArray) -> ContactState:
        """The rates when the load factors move by ``change`` (L,)."""
        c = self._condensed
        still = np.zeros(len(c.slip.constant))
        return self._solve(c.gap.load @ change, c.slip.load @ change, c.balance.load @ change, still)

    def _solve(
        self, free_gap: FloatArray, free_slip: FloatArray, imbalance: FloatArray, stick_reference: FloatArray
    ) -> ContactState:
        closed, stuck, m, n = self._closed, self._stuck, len(free_gap), len(free_slip)
        rhs = np.concatenate([-free_gap[closed], stick_reference[stuck] - free_slip[stuck], -imbalance])
        unknowns = self._spread(rhs)
        # One step on the equations as they are takes away the factors' round-off.
        unknowns += self._spread(rhs - (self._condensed.whole @ unknowns)[self._kept])
        caused = self._condensed.whole[: m + n] @ unknowns
        gap, slip = free_gap + caused[:m], free_slip + caused[m:]
        gap[closed], slip[stuck] = 0.0, stick_reference[stuck]
        return ContactState(unknowns[:m], unknowns[m : m + n], unknowns[m + n :], gap, slip)

    def _spread(self, rhs: FloatArray) -> FloatArray:
        """All pressures, tractions and motions for the right-hand sides of the equations that hold."""
        unknowns = np.zeros(len(self._condensed.whole))
        if self._factor is not None:
            solution = self._columns * self._factor.solve(self._rows * rhs)
            unknowns[self._kept] = solution
            if len(self._sliding):
                unknowns[self._sliding] = self._drag * solution[self._under]
        return unknowns
