"""Contact status of nodes (open, stick, slip) and the linear equations that follow from it. Open nodes carry
nothing; closed ones keep h = 0; sticking ones keep their stick reference, s = s0; slipping ones carry t = d
mu p with the slip sign d = +-1."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace

import numpy as np

from mlsanm_cli.arrays import FloatArray, IntArray
from mlsanm_cli.contact.complementarity.problem import OPEN, SLIP, STICK, ContactStatus
from mlsanm_cli.contact.laws.loose_bodies import IdleMotions
from mlsanm_cli.contact.response.condensed import Condensed
from mlsanm_cli.contact.response.dense import ScaledFactor, SingularSystemError

__all__ = ["OPEN", "SLIP", "STICK", "ContactSolution", "ContactStatus", "SetSystem"]
MAX_CHANGES = 40
"""Largest number of changed equations for an update of factors; each costs a solution."""
MIN_EQUATIONS = 100
"""Least number of equations for which an update is cheaper than a new factorisation."""
EXACT, ROUND_OFF = 1e-14, 1e-12
"""Relative residuals above which solutions are refined, and gaps and slips recomputed."""
MIN_RCOND = 1e-8
"""Least reciprocal condition number of an update."""


@dataclass(frozen=True, eq=False)
class ContactSolution:
    """Pressures (m,), tractions (n,), motions (k,), gaps (m,) and slips (n,), or their rates."""

    pressure: FloatArray
    traction: FloatArray
    motion: FloatArray
    gap: FloatArray
    slip: FloatArray

    def times(self, factor: float) -> ContactSolution:
        """Everything multiplied by ``factor``."""
        return ContactSolution(*(factor * getattr(self, one.name) for one in fields(self)))

    def advanced(self, step: float, rates: ContactSolution) -> ContactSolution:
        """The state a ``step`` further along ``rates``."""
        return ContactSolution(
            *(getattr(self, one.name) + step * getattr(rates, one.name) for one in fields(self))
        )

    def obeying(
        self, condensed: Condensed, sets: ContactStatus, stick_reference: FloatArray
    ) -> ContactSolution:
        """The state with the conditions of ``sets`` satisfied exactly: no pressure at open nodes, no gap at
        closed ones, sticking ones at their ``stick_reference`` (n,), slipping ones at the friction limit."""
        pressure = np.where(sets.closed, self.pressure, 0.0)
        limit = condensed.friction * pressure[condensed.friction_nodes]
        return replace(
            self,
            pressure=pressure,
            traction=np.where(sets.stuck, self.traction, sets.slip_sign * limit),
            gap=np.where(sets.closed, 0.0, self.gap),
            slip=np.where(sets.stuck, stick_reference, self.slip),
        )


class SetSystem:
    """The factorised linear equations of one choice of sets; an update of the factors of a system ``near`` if
    the sets differ in few nodes. Motions that no closed node resists and a given ``force`` (k,) does not
    drive are held. Raises SingularSystemError."""

    def __init__(
        self,
        condensed: Condensed,
        sets: ContactStatus,
        near: SetSystem | None = None,
        force: FloatArray | None = None,
    ) -> None:
        self._condensed = condensed
        m, n = len(sets.closed), len(sets.stuck)
        rows, columns, whole = condensed.scaled
        self._closed, self._stuck = np.flatnonzero(sets.closed), np.flatnonzero(sets.stuck)
        sliding = np.flatnonzero(sets.slip_sign)
        self._holds = np.concatenate([sets.closed, sets.stuck, np.ones(len(whole) - m - n, dtype=bool)])
        self._kept = np.flatnonzero(self._holds)
        self._rows, self._columns = rows, columns
        # Tractions of slipping nodes are eliminated by their pressures.
        self._sliding, self._under = m + sliding, condensed.friction_nodes[sliding]
        self._friction_slope = sets.slip_sign[sliding] * condensed.friction[sliding]
        self._slope = self._friction_slope * columns[self._under] / columns[self._sliding]
        self._kind = np.concatenate(
            [sets.closed, 2.0 * sets.stuck + sets.slip_sign, np.ones(len(whole) - m - n)]
        )
        base: SetSystem | None = near and (near._update.base if near._update else near)
        self.idle: IdleMotions | None = None
        if base and base.idle and force is not None:
            self.idle = IdleMotions.of(condensed, sets.closed, force)
        same = base and (base.idle.same(self.idle) if base.idle else True)
        self._update: _Update | None = _Update.of(self, base) if base and same else None
        if self._update is None:
            self._units: dict[int, FloatArray] = {}
            try:
                self._factor = self._factorised(whole)
            except SingularSystemError:
                if self.idle is None and force is not None:
                    self.idle = IdleMotions.of(condensed, sets.closed, force)
                if self.idle is None:
                    raise
                self._factor = self._factorised(whole)

    def _factorised(self, whole: FloatArray) -> ScaledFactor | None:
        kept = self._kept
        # Transposed, so that the factor's columns are contiguous.
        matrix = whole.take(kept, axis=0).take(kept, axis=1)
        if len(self._sliding):
            place = np.searchsorted(self._closed, self._under)
            matrix[place] += self._slope[:, None] * whole.take(self._sliding, axis=0).take(kept, axis=1)
        if self.idle is not None:
            k = len(self.idle.motions)
            matrix[-k:, -k:] += self.idle.motions @ self.idle.balances.T
        return ScaledFactor(matrix.T) if len(kept) else None

    def state(
        self, factors: FloatArray, stick_reference: FloatArray, motion: FloatArray | None = None
    ) -> ContactSolution:
        """The state at load ``factors`` (L,) with sticking nodes at their ``stick_reference`` (n,), and idle
        motions as in ``motion`` (k,)."""
        c = self._condensed
        free_gap = c.gap.constant + c.gap.load @ factors
        free_slip = c.slip.constant + c.slip.load @ factors
        imbalance = c.balance.constant + c.balance.load @ factors
        return self._solve(free_gap, free_slip, imbalance, stick_reference, motion)

    def rate(self, change: FloatArray) -> ContactSolution:
        """Rates for a ``change`` (L,) of the load factors."""
        c = self._condensed
        still = np.zeros(len(c.slip.constant))
        return self._solve(c.gap.load @ change, c.slip.load @ change, c.balance.load @ change, still)

    def response(self, gap: FloatArray, slip: FloatArray, imbalance: FloatArray) -> ContactSolution:
        """Response to imposed gaps (m,), slips (n,) and force imbalance (k,)."""
        return self._solve(gap, slip, imbalance, np.zeros(len(slip)))

    def _solve(
        self,
        free_gap: FloatArray,
        free_slip: FloatArray,
        imbalance: FloatArray,
        stick_reference: FloatArray,
        motion: FloatArray | None = None,
    ) -> ContactSolution:
        closed, stuck, m, n = self._closed, self._stuck, len(free_gap), len(free_slip)
        rhs = np.concatenate([-free_gap[closed], stick_reference[stuck] - free_slip[stuck], -imbalance])
        unknowns = self._spread(rhs)
        if self.idle is not None and motion is not None:
            columns, idle = self._columns[m + n :], self.idle.motions
            unknowns[m + n :] += columns * (idle @ (idle.T @ (motion / columns)))
        caused = self._condensed.blocks @ unknowns
        left, rows = rhs - caused[self._kept], self._rows[self._kept]
        error, size = (float(np.abs(rows * one).max(initial=0.0)) for one in (left, rhs))
        if error > EXACT * size:
            unknowns += self._spread(left)
        if error > ROUND_OFF * size:
            caused = self._condensed.blocks @ unknowns
        gap, slip = free_gap + caused[:m], free_slip + caused[m : m + n]
        gap[closed], slip[stuck] = 0.0, stick_reference[stuck]
        return ContactSolution(unknowns[:m], unknowns[m : m + n], unknowns[m + n :], gap, slip)

    def _spread(self, rhs: FloatArray) -> FloatArray:
        """All pressures, tractions and motions for right-hand sides of the active equations."""
        scaled = np.zeros(len(self._rows))
        scaled[self._kept] = self._rows[self._kept] * rhs
        found = self.scaled_solution(scaled) if self._update is None else self._update.solution(scaled)
        unknowns = self._columns * found
        # Exact, without the update's round-off.
        open_ones = self._kind == 0.0
        unknowns[open_ones] = 0.0
        unknowns[self._sliding] = self._friction_slope * unknowns[self._under]
        return unknowns

    def scaled_solution(self, rhs: FloatArray) -> FloatArray:
        """Scaled unknowns (m + n + k) or (m + n + k, c) for right-hand sides that are zero for inactive
        equations."""
        found = np.zeros(rhs.shape)
        if self._factor is not None:
            found[self._kept] = self._factor.solve(rhs[self._kept])
            found[self._sliding] = (self._slope * found[self._under].T).T
        return found

    def units(self, numbers: IntArray) -> FloatArray:
        """Scaled unknowns (m + n + k, r) for a unit right-hand side in each of the equations ``numbers``
        (r,), which for an open node states zero pressure, for a slipping one proportionality of traction and
        pressure."""
        new = np.array([one for one in numbers.tolist() if one not in self._units], dtype=np.int64)
        if len(new):
            rhs, held = np.zeros((len(self._rows), len(new))), ~self._holds[new]
            rhs[self._kept] = -self._condensed.scaled[2][np.ix_(new, self._kept)].T * held
            rhs[new, np.arange(len(new))] = ~held
            found = self.scaled_solution(rhs)
            found[new, np.arange(len(new))] += held
            self._units |= dict(zip(new.tolist(), found.T.copy(), strict=True))
        return np.array([self._units[one] for one in numbers.tolist()]).T


class _Update:
    """A system whose ``changed`` (r,) equations differ from those of a factorised ``base`` (Woodbury's
    formula).

    With the base's solutions Z for unit right-hand sides of them, and the rows N of the new equations, the
    solution is y + Z w with (N Z) w = b - N y, y the base's solution without these right-hand sides.
    """

    def __init__(self, system: SetSystem, base: SetSystem, changed: IntArray) -> None:
        self.base, self._changed = base, changed
        # Changed equations that are active are rows of the matrix; those of slipping nodes involve their
        # pressures.
        self._holding = system._holds[changed]
        self._equations = np.ascontiguousarray(system._condensed.scaled[2][:, changed[self._holding]].T)
        _, place, self._slides = np.intersect1d(
            system._sliding, changed, assume_unique=True, return_indices=True
        )
        self._slope, self._under = system._slope[place, None], system._under[place]
        self._units = base.units(changed)
        self._factor = ScaledFactor(np.asfortranarray(self._values(self._units)), MIN_RCOND)

    @classmethod
    def of(cls, system: SetSystem, base: SetSystem) -> _Update | None:
        """None if too much has changed, or if the update is ill-conditioned."""
        changed = np.flatnonzero(system._kind != base._kind)
        if len(base._kept) < MIN_EQUATIONS or not 0 < len(changed) <= MAX_CHANGES:
            return None
        try:
            return cls(system, base, changed)
        except SingularSystemError:
            return None

    def solution(self, rhs: FloatArray) -> FloatArray:
        """Scaled unknowns for right-hand sides (m + n + k)."""
        kept = rhs.copy()
        kept[self._changed] = 0.0
        found = self.base.scaled_solution(kept)
        return found + self._units @ self._factor.solve(rhs[self._changed] - self._values(found))

    def _values(self, unknowns: FloatArray) -> FloatArray:
        """Left-hand sides (r,) or (r, c) of the changed equations for scaled unknowns."""
        columns = unknowns.reshape(len(unknowns), -1)
        values = columns[self._changed]
        values[self._holding] = self._equations @ columns
        values[self._slides] -= self._slope * columns[self._under]
        return values.reshape(-1, *unknowns.shape[1:])
