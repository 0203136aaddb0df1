"""The linear equations of one contact status.

Active are the pressures of closed nodes, the tractions of sticking ones and the motions, with their rows.
With the slip sign d of the last slip, kept while a node sticks, tractions are t = tau + d mu p: every change
of status is then the entry or exit of one unknown with its row, a rank-one change of the inverse.
"""

from __future__ import annotations

import numpy as np
from scipy.linalg.blas import dger
from scipy.linalg.lapack import dgecon, dgetrf, dgetrs

from mlsanm_cli.arrays import BoolArray, FloatArray, IntArray
from mlsanm_cli.contact.complementarity.problem import (
    DOUBTFUL,
    FEASIBLE,
    GRAZING,
    SINGULAR,
    ContactStatus,
    Problem,
)

ROOM, MAX_UPDATES = 64, 60
"""Unknowns that a stored inverse can take up before it is copied; updates after which it is computed anew."""
MIN_RCOND, NULL = 1e-12, 1e-7
"""Reciprocal condition number of a singular equilibrated matrix, and relative singular values of motions that
nothing resists: its root, as both motions and balances are small there."""
EXACT = 1e-14
"""Relative residual above which a solution is refined."""


class Ray(ArithmeticError):
    """Nothing stops the ``direction`` (N,) of the unknowns at load ``lam``: a mechanism, or, of a search, a
    sign that there is no state."""

    def __init__(self, direction: FloatArray, lam: float = np.nan) -> None:
        super().__init__("no condition stops a direction of the contact problem")
        self.direction, self.lam = direction, lam


class SingularError(Ray):
    """A status leaves motions undetermined that loads drive, in a direction that is not known."""

    def __init__(self) -> None:
        super().__init__(np.zeros(0))


class Basis:
    """The equations of a ``status``: factors, and from the first update on their inverse. Motions that no
    active row resists and no load drives are held. ``missed`` is the residual of the last solution over
    ``grain``. Raises SingularError."""

    def __init__(self, problem: Problem, status: ContactStatus) -> None:
        self.problem, self.status, self.updates, self.missed = problem, status, 0, 0.0
        self.side = np.zeros(problem.n)
        self.active: IntArray = np.zeros(0, dtype=np.int64)
        self.held: FloatArray = np.zeros((problem.k, 0))
        self._factorise(status)

    def to(self, status: ContactStatus) -> Basis:
        """The basis of another status, by updates if these are few."""
        k, slides = self.problem.k, status.slip_sign != 0.0
        old, new = self.status.active(k), status.active(k)
        turned = np.flatnonzero(slides & (self.status.slip_sign != 0.0) & (self.side != status.slip_sign))
        changed = np.flatnonzero(old != new)
        cost = len(changed) + 2 * len(turned)
        if cost:
            few = cost <= max(2, len(self.active) // 16) and self.updates + cost <= MAX_UPDATES
            if not (few and self._updated(status, changed, turned, new)):
                self._factorise(status)
        self.status = status
        return self

    def _updated(self, status: ContactStatus, changed: IntArray, turned: IntArray, new: BoolArray) -> bool:
        """Whether single updates have led to the status. A node that changes the side of its slip sticks
        meanwhile."""
        m = self.problem.m
        entering, leaving = changed[new[changed]], changed[~new[changed]]
        if self._touches_held(entering):
            return False
        try:
            for index in [*(turned + m), *entering[entering < m], *entering[entering >= m]]:
                self.enter(index, status)
            for index in [*(turned + m), *leaving[leaving >= m], *leaving[leaving < m]]:
                self.leave(index, status)
        except SingularError:
            return False
        return True

    def _touches_held(self, entering: IntArray) -> bool:
        """Whether unknowns that enter resist held motions, or act on the balances that nothing changes."""
        p = self.problem
        if not (self.held.shape[1] and len(entering)):
            return False
        own = p.owner[entering]
        acting = np.append(entering, p.m + own[own >= 0])
        resisted = p.matrix[entering][:, p.contacts :] @ self.held
        caused = self.left.T @ p.matrix[p.contacts :][:, acting]
        return bool(max(np.abs(resisted).max(), np.abs(caused).max()) > NULL)

    def anew(self) -> bool:
        """Factorise the same status if the inverse has been updated; whether that was done."""
        if not self.updates:
            return False
        self._factorise(self.status)
        return True

    def _factorise(self, status: ContactStatus) -> None:
        p = self.problem
        self.status, self.updates, self._store = status, 0, np.zeros((0, 0))
        self.side = np.where(status.slip_sign != 0.0, status.slip_sign, self.side)
        self.active = np.flatnonzero(status.active(p.k))
        self.place = np.full(len(p.rows), -1)
        self.place[self.active] = np.arange(len(self.active))
        self.held = self.left = np.zeros((p.k, 0))
        matrix = self._entries(self.active, self.active)
        self._factor = _Factor(matrix)
        if self._factor.rcond < MIN_RCOND:
            self._hold(matrix)

    def _hold(self, matrix: FloatArray) -> None:
        """Hold motions that no active row resists; their left counterparts are balances that nothing
        changes."""
        k = self.problem.k
        right, left = null_space(matrix[:, len(matrix) - k :]), null_space(matrix[len(matrix) - k :].T)
        if not right.shape[1] or right.shape != left.shape:
            raise SingularError
        self.held, self.left = right, left
        matrix[-k:, -k:] += left @ right.T
        self._factor = _Factor(matrix)
        if self._factor.rcond < MIN_RCOND:
            raise SingularError

    def _entries(self, rows: IntArray, columns: IntArray) -> FloatArray:
        """Part of the matrix with the friction d mu p in the columns of pressures."""
        p = self.problem
        found = p.matrix[np.ix_(rows, columns)]
        own = p.owner[columns]
        rubbing = np.flatnonzero(own >= 0)
        own = own[rubbing]
        found[:, rubbing] += self.side[own] * p.friction[own] * p.matrix[np.ix_(rows, p.m + own)]
        return found

    def column(self, index: int) -> tuple[FloatArray, float]:
        """Response (r,) of the active unknowns to an ``index`` that may enter, or to a residual in the row of
        one that may leave, and its pivot. Raises SingularError if that is zero."""
        at, each = int(self.place[index]), np.array([index])
        if at >= 0:
            rhs = np.zeros(len(self.active))
            rhs[at] = 1.0
            column = self.inverse[:, at].copy()
        else:
            rhs = self._entries(self.active, each)[:, 0]
            column = self.inverse @ rhs
        pivot, size = self._pivot(index, column)
        if abs(pivot) <= DOUBTFUL * size and self.updates:
            column = self._refined(rhs, column)
            pivot, size = self._pivot(index, column)
        if abs(pivot) <= SINGULAR * size:
            raise SingularError
        return column, pivot

    def _pivot(self, index: int, column: FloatArray) -> tuple[float, float]:
        """The pivot of an index, and the size of the terms that cancel in it."""
        at, each = int(self.place[index]), np.array([index])
        if at < 0:
            own = float(self._entries(each, each)[0, 0])
            caused = float(self._entries(each, self.active)[0] @ column)
            return own - caused, abs(own) + abs(caused)
        rows, columns = (level[self.active] for level in self.problem.levels)
        across = np.abs(self.inverse[at] / rows).max() * rows[at]
        along = np.abs(column / columns).max() * columns[at]
        return float(column[at]), float(np.sqrt(across * along))

    def mechanism(self, index: int) -> tuple[FloatArray, FloatArray]:
        """Unknowns and rows (N,) that change, while no other active row does, with an index of zero pivot: by
        1 the unknown of one that may enter, or the row of one that may leave."""
        at, p = int(self.place[index]), self.problem
        rhs = np.zeros(len(self.active))
        if at < 0:
            rhs = -self._entries(self.active, np.array([index]))[:, 0]
        else:
            rhs[at] = 1.0
        column = self._refined(rhs, self._applied(rhs))
        x = np.zeros(len(p.rows))
        x[self.active] = column
        if at < 0:
            x[index] = 1.0
        x[p.m : p.contacts] += self.side * p.friction * x[p.nodes]
        w = p.product(x)
        w[self.active] = rhs if at >= 0 else 0.0
        return x, w

    def _refined(self, rhs: FloatArray, values: FloatArray) -> FloatArray:
        """A solution (r,) of the equations after one step of iterative refinement."""
        moves = self.place[self.problem.contacts :]
        missed = rhs - self.problem.product(self.spread(values))[self.active]
        missed[moves] -= self.left @ (self.held.T @ values[moves])
        return values + self._applied(missed)

    def enter(self, index: int, status: ContactStatus) -> None:
        """Activate an unknown with its row; nodes that close slip as in ``status``. Raises SingularError."""
        own = int(self.problem.owner[index])
        if own >= 0 and status.slip_sign[own]:
            self.side[own] = status.slip_sign[own]
        column, pivot = self.column(index)
        row = self._entries(np.array([index]), self.active)[0] @ self.inverse
        count = len(self.active)
        if count == len(self._store):
            self._keep(self.inverse)
        self._rank_one(1.0 / pivot, column, row)
        self._store[:count, count], self._store[count, :count] = -column / pivot, -row / pivot
        self._store[count, count] = 1.0 / pivot
        self.place[index], self.active = count, np.append(self.active, index)
        self.updates += 1

    def leave(self, index: int, status: ContactStatus) -> None:
        """Deactivate an unknown with its row; nodes that cease to stick slip as in ``status``. Raises
        SingularError."""
        if index >= self.problem.m:
            self._turn(index - self.problem.m, status)
        self.column(index)
        inverse, at, last = self.inverse, int(self.place[index]), len(self.active) - 1
        pivot = float(inverse[at, at])
        if at != last:
            inverse[[at, last]] = inverse[[last, at]]
            inverse[:, [at, last]] = inverse[:, [last, at]]
            self.active[at] = self.active[last]
            self.place[self.active[at]] = at
        self._rank_one(-1.0 / pivot, inverse[:last, last].copy(), inverse[last, :last].copy())
        self._store[last], self._store[:, last] = 0.0, 0.0
        self.place[index], self.active = -1, self.active[:last]
        self.updates += 1

    def _turn(self, own: int, status: ContactStatus) -> None:
        """Change the part d mu p of the traction of a sticking node, a change of its unknown tau."""
        p, side = self.problem, float(status.slip_sign[own])
        change = (side - self.side[own]) * p.friction[own] if side else 0.0
        if change:
            inverse = self.inverse
            inverse[self.place[p.m + own]] -= change * inverse[self.place[p.nodes[own]]]
            self.side[own] = side

    @property
    def inverse(self) -> FloatArray:
        """The inverse of the active rows, with unknowns in the order of ``active``."""
        count = len(self.active)
        if not len(self._store):
            self._keep(self._factor.solve(np.eye(count)))
        return self._store[:count, :count]

    def _keep(self, inverse: FloatArray) -> None:
        """Store the inverse with room for more unknowns."""
        size = len(inverse)
        store = np.zeros((size + ROOM, size + ROOM), order="F")
        store[:size, :size] = inverse
        self._store = store

    def _rank_one(self, factor: float, column: FloatArray, row: FloatArray) -> None:
        u, v = np.zeros(len(self._store)), np.zeros(len(self._store))
        u[: len(column)], v[: len(row)] = column, row
        self._store = dger(factor, u, v, a=self._store, overwrite_a=1)

    def spread(self, values: FloatArray) -> FloatArray:
        """All unknowns (N,) for those that are active."""
        p, x = self.problem, np.zeros(len(self.place))
        x[self.active] = values
        x[p.m : p.contacts] += self.side * p.friction * x[p.nodes]
        return x

    def solve(
        self, free: FloatArray, aim: FloatArray, near: FloatArray | None = None
    ) -> tuple[FloatArray, FloatArray]:
        """Unknowns and rows (N,) for ``free`` rows with active ones at their ``aim``; held motions are those
        of the unknowns ``near``."""
        p, active, moves = self.problem, self.active, self.place[self.problem.contacts :]
        rhs, pull = (aim - free)[active], np.zeros(p.k)
        if self.held.shape[1]:
            if np.abs(self.left.T @ rhs[moves]).max() > GRAZING * float(np.abs(rhs).max()):
                raise SingularError
            if near is not None:
                pull = self.left @ (self.held.T @ near[p.contacts :])
            rhs[moves] += pull
        x = self.spread(self._applied(rhs))
        # Equilibrated factors, and updates of an inverse, do not show motions that only round-off resists.
        if MIN_RCOND * np.abs(x).max(initial=0.0) > np.abs(rhs).max(initial=0.0):
            return self._solved_anew(free, aim, near)
        w = free + p.product(x)
        missed = (aim - w)[active]
        missed[moves] += pull - self.left @ (self.held.T @ x[p.contacts :])
        if np.abs(missed).max(initial=0.0) > EXACT * np.abs(rhs).max(initial=0.0):
            x += self.spread(self._applied(missed))
            w = free + p.product(x)
            size = max(np.abs(rhs).max(), np.abs(x).max())
            missed = (aim - w)[active]
            missed[moves] += pull - self.left @ (self.held.T @ x[p.contacts :])
            if (np.abs(missed) > 100.0 * FEASIBLE * size * p.grain[active]).any():
                return self._solved_anew(free, aim, near)
        w[active] = aim[active]
        self.missed = float((np.abs(missed) / p.grain[active]).max(initial=0.0))
        return x, w

    def _solved_anew(
        self, free: FloatArray, aim: FloatArray, near: FloatArray | None
    ) -> tuple[FloatArray, FloatArray]:
        """The same by new factors in place of an updated inverse. Raises SingularError if there is none."""
        if not self.anew():
            raise SingularError
        return self.solve(free, aim, near)

    def undriven(self, rows: FloatArray) -> FloatArray:
        """Rows (N,) without loads on held motions."""
        found, count = rows.copy(), self.problem.contacts
        found[count:] -= self.left @ (self.left.T @ rows[count:])
        return found

    def _applied(self, rhs: FloatArray) -> FloatArray:
        return self.inverse @ rhs if len(self._store) else self._factor.solve(rhs)


class _Factor:
    """LU factors of a matrix (r, r) with rows and columns scaled to largest entries of 1; ``rcond`` is its
    reciprocal condition number, 0 if it is singular."""

    def __init__(self, matrix: FloatArray) -> None:
        self.rcond = 1.0
        if not len(matrix):
            return
        self._rows = 1.0 / _positive(np.abs(matrix).max(axis=1))
        self._columns = 1.0 / _positive((self._rows[:, None] * np.abs(matrix)).max(axis=0))
        scaled = np.asfortranarray(self._rows[:, None] * matrix * self._columns)
        norm = float(np.abs(scaled).sum(axis=0).max())
        self._lu, self._pivots, info = dgetrf(scaled, overwrite_a=1)
        self.rcond = 0.0 if info > 0 or not np.isfinite(norm) else float(dgecon(self._lu, norm)[0])

    def solve(self, rhs: FloatArray) -> FloatArray:
        """Solution (r,) or (r, c)."""
        if not len(rhs):
            return rhs.copy()
        solution: FloatArray = dgetrs(self._lu, self._pivots, (self._rows * rhs.T).T)[0]
        return np.asarray((self._columns * solution.T).T)


def null_space(rows: FloatArray) -> FloatArray:
    """Orthonormal null space (k, d) of ``rows`` (r, k)."""
    if not rows.size:
        return np.eye(rows.shape[1])
    _, values, right = (
        np.linalg.svd(rows, full_matrices=True)
        if len(rows) < 2 * rows.shape[1]
        else (np.linalg.svd(np.linalg.qr(rows, mode="r")))
    )
    values = np.append(values, np.zeros(len(right) - len(values)))
    return np.asarray(right[values <= NULL * max(float(values[0]), np.finfo(float).tiny)].T)


def _positive(values: FloatArray) -> FloatArray:
    return np.where(values > 0.0, values, 1.0)
