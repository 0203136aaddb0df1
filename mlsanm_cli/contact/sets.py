"""Which nodes of contacts are open, stick or slip, and the linear equations that hold meanwhile.

Open nodes carry nothing; closed ones keep h = 0; sticking ones keep the slip they came to rest at,
s = anchor; slipping ones carry t = d mu p with the sense d = +-1.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mlsanm_cli.arrays import BoolArray, FloatArray, IntArray
from mlsanm_cli.contact.condensed import Condensed
from mlsanm_cli.contact.dense import DenseSystem
from mlsanm_cli.values import dataclass

OPEN, STICK, SLIP = 0, 1, 2


@dataclass(frozen=True, eq=False)
class Sets:
    """``closed`` (m,), and of the nodes with friction ``stuck`` (n,) and the ``sense`` (n,) in which friction
    acts on those that are closed and slip; 0 on the others."""

    closed: BoolArray
    stuck: BoolArray
    sense: FloatArray

    @property
    def key(self) -> bytes:
        """Equal for equal sets."""
        return self.closed.tobytes() + self.stuck.tobytes() + self.sense.tobytes()

    def status(self, rubbing: IntArray) -> NDArray[np.int8]:
        """What every node (m,) does; closed nodes without friction slip."""
        status = np.where(self.closed, SLIP, OPEN).astype(np.int8)
        status[rubbing[self.stuck]] = STICK
        return status


@dataclass(frozen=True, eq=False)
class Values:
    """Pressures (m,), tractions (n,), motions (k,), gaps (m,) and slips (n,), or rates of them."""

    pressure: FloatArray
    traction: FloatArray
    motion: FloatArray
    gap: FloatArray
    slip: FloatArray


class SetSystem:
    """The linear equations of one choice of sets, factorised. Raises SingularSystemError."""

    def __init__(self, condensed: Condensed, sets: Sets) -> None:
        self._condensed, self._sets = condensed, sets
        gap, slip, balance = condensed.gap, condensed.slip, condensed.balance
        closed, stuck = np.flatnonzero(sets.closed), np.flatnonzero(sets.stuck)
        sliding = np.flatnonzero(sets.sense)
        self._closed, self._stuck, self._sliding = closed, stuck, sliding
        place = np.cumsum(sets.closed) - 1
        under = place[condensed.rubbing[sliding]]
        drag = sets.sense[sliding] * condensed.friction[sliding]

        def row(map_pressure: FloatArray, map_traction: FloatArray, map_motion: FloatArray) -> FloatArray:
            on_closed = map_pressure[:, closed]
            # A slipping node's traction goes with its pressure.
            on_closed[:, under] += map_traction[:, sliding] * drag
            return np.hstack([on_closed, map_traction[:, stuck], map_motion])

        matrix = np.vstack(
            [
                row(gap.pressure[closed], gap.traction[closed], gap.motion[closed]),
                row(slip.pressure[stuck], slip.traction[stuck], slip.motion[stuck]),
                row(balance.pressure, balance.traction, balance.motion),
            ]
        )
        self._drag, self._under = drag, under
        self._system = DenseSystem(matrix, len(closed) + len(stuck))

    def state(self, factors: FloatArray, anchor: FloatArray) -> Values:
        """The state at load ``factors`` (L,) with sticking nodes held at their ``anchor`` (n,)."""
        c = self._condensed
        free_gap = c.gap.constant + c.gap.load @ factors
        free_slip = c.slip.constant + c.slip.load @ factors
        lack = c.balance.constant + c.balance.load @ factors
        return self._solve(free_gap, free_slip, lack, anchor)

    def rate(self, change: FloatArray) -> Values:
        """The rates when the load factors move by ``change`` (L,)."""
        c = self._condensed
        still = np.zeros(len(c.slip.constant))
        return self._solve(c.gap.load @ change, c.slip.load @ change, c.balance.load @ change, still)

    def _solve(
        self, free_gap: FloatArray, free_slip: FloatArray, lack: FloatArray, anchor: FloatArray
    ) -> Values:
        c, closed, stuck = self._condensed, self._closed, self._stuck
        rhs = np.concatenate([-free_gap[closed], anchor[stuck] - free_slip[stuck], -lack])
        solution = self._system.solve(rhs)
        a, b = len(closed), len(closed) + len(stuck)
        pressure, traction = np.zeros(len(free_gap)), np.zeros(len(free_slip))
        pressure[closed], traction[stuck], motion = solution[:a], solution[a:b], solution[b:]
        traction[self._sliding] = self._drag * solution[self._under]
        gap = free_gap + c.gap.motion @ motion + c.gap.pressure @ pressure + c.gap.traction @ traction
        slip = free_slip + c.slip.motion @ motion + c.slip.pressure @ pressure + c.slip.traction @ traction
        gap[closed], slip[stuck] = 0.0, anchor[stuck]
        return Values(pressure, traction, motion, gap, slip)
