"""The linear equations of one contact status.

Active are the pressures of closed nodes, the tractions of sticking ones and the motions, with their rows; the
pressure of a slipping node acts with its friction d mu p. The factors of one status serve others that differ
by a few changes, with borders of the matrix (Bisschop and Meeraus 1977, doi:10.1007/BF01584313)::

    [ M  U ] [ x ]   [ a ]
    [ V  C ] [ y ] = [ b ]

y are unknowns that enter with their rows, the residuals of rows whose unknowns leave, and pressures of nodes
that slip to the other side.
"""

from __future__ import annotations

from typing import TypeAlias

import numpy as np
from scipy import linalg
from scipy.linalg.lapack import dgecon, dgesv, dgetrf, dgetrs

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.contact.complementarity.problem import (
    DOUBTFUL,
    FEASIBLE,
    GRAZING,
    SINGULAR,
    ContactStatus,
    Problem,
    inverse_of,
)

MAX_BORDERS, BORDER_SHARE = 64, 1 / 16
"""Largest number of borders, and part of the unknowns: more cost more than new factors."""
MIN_RCOND, NULL = 1e-12, 1e-7
"""Reciprocal condition number of a singular equilibrated matrix, and relative singular values of motions that
nothing resists: its root, as both motions and balances are small there."""
ENTERS, LEAVES, TURNS = range(3)
"""Kinds of borders: an unknown enters or leaves; a node slips to the other side."""

Key: TypeAlias = tuple[int, int, float]
"""Kind and index of a border, and the side of its node's slip."""
Border: TypeAlias = tuple[FloatArray, FloatArray, FloatArray, FloatArray, float]
"""Coefficients (r,) of the equation of a border, the column (N,) of its unknown, the response (r,) of the
factors to it, scales (2,) of row and column, and the size of what cancels in the scaled pivot."""


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
    """The equations of a ``status``: factors of this or an earlier one, with borders. Motions that no active
    row resists and no load drives are held, or all motions resisted by ``springs`` (k, k). ``missed`` is the
    residual of the last solution over ``grain``. Raises SingularError."""

    def __init__(self, problem: Problem, status: ContactStatus, springs: FloatArray | None = None) -> None:
        self.problem, self.missed, self._springs = problem, 0.0, springs
        self._factorise(status)

    @classmethod
    def near(cls, problem: Problem, status: ContactStatus) -> Basis:
        """The last basis of the problem that is in use, or a new one, taken to a status."""
        last: Basis | None = problem.kept.get("basis")
        return cls(problem, status) if last is None else last.to(status)

    def to(self, status: ContactStatus) -> Basis:
        """The basis of another status, by borders if these are few."""
        p, keys = self.problem, self._keys(status)
        few = len(keys) <= min(MAX_BORDERS, max(2, int(BORDER_SHARE * len(self._base))))
        entering, touches = [index for kind, index, _ in keys if kind == ENTERS], False
        if few and self.held.shape[1] and entering:
            # Unknowns that resist held motions, or act on the balances that nothing changes.
            own = p.owner[entering]
            acting = np.append(entering, p.m + own[own >= 0])
            resisted = np.abs(p.matrix[entering][:, p.contacts :] @ self.held).max()
            touches = max(resisted, np.abs(self.left.T @ p.matrix[p.contacts :][:, acting]).max()) > NULL
        if not few or touches or not self._bordered(status, keys, DOUBTFUL):
            self._factorise(status)
        return self

    def pivot(self, status: ContactStatus) -> bool:
        """Go to a status that differs by one change, unless that is singular; whether that was done."""
        keys = self._keys(status)
        if len(keys) <= MAX_BORDERS and self._bordered(status, keys, DOUBTFUL):
            return True
        self.anew()
        return self._bordered(status, self._keys(status), SINGULAR)

    def anew(self) -> bool:
        """Factorise the same status if there are borders; whether that was done."""
        if not self._borders:
            return False
        self._factorise(self.status)
        return True

    def _factorise(self, status: ContactStatus) -> None:
        p = self.problem
        if self._springs is None:
            p.kept["basis"] = self
        self.status, self._side, self._active = status, status.slip_sign, status.active(p.k)
        self._based, self._base = self._active, np.flatnonzero(self._active)
        self._unbordered()
        self.held = self.left = np.zeros((p.k, 0))
        self._resists = np.zeros((p.k, p.k)) if self._springs is None else self._springs
        matrix, own = p.matrix[np.ix_(self._base, self._base)], p.owner[self._base]
        slides = np.flatnonzero((own >= 0) & (self._side[own] != 0.0)) if p.n else own[:0]
        own = own[slides]
        matrix[:, slides] += self._side[own] * p.friction[own] * p.matrix[np.ix_(self._base, p.m + own)]
        last = len(matrix) - p.k
        matrix[last:, last:] += self._resists
        self._matrix, self._factor = matrix, _Factor(matrix)
        if self._factor.rcond >= MIN_RCOND:
            return
        # Motions that no active row resists are held; left are the balances that nothing changes.
        right, left = null_space(matrix[:, last:]), null_space(matrix[last:].T)
        if not right.shape[1] or right.shape != left.shape:
            raise SingularError
        self.held, self.left, self._resists = right, left, left @ right.T
        matrix[last:, last:] += self._resists
        self._factor = _Factor(matrix)
        if self._factor.rcond < MIN_RCOND:
            raise SingularError

    def _unbordered(self) -> None:
        count = len(self._base)
        self._borders = dict[Key, Border]()
        self._rows, self._inverse = np.zeros((0, count)), np.zeros((0, 0))
        self._columns = self._responses = np.zeros((count, 0))
        self._corner, self._enter = self._inverse, np.zeros(0, dtype=int)
        self._entered = self._enter

    def _keys(self, status: ContactStatus) -> list[Key]:
        """Borders of a status."""
        p, active, sign = self.problem, status.active(self.problem.k), status.slip_sign
        tangential, sides = slice(p.m, p.contacts), np.zeros(len(p.rows))
        sides[p.nodes] = sides[tangential] = np.where(active[p.nodes], sign, 0.0)
        slid = ~(self._based | active)[tangential]
        turned = (self._based & active)[p.nodes] & slid & (sign != self._side)
        kinds = (
            (ENTERS, np.flatnonzero(active & ~self._based)),
            (LEAVES, np.flatnonzero(self._based & ~active)),
            (TURNS, p.nodes[turned]),
        )
        return [(kind, int(index), float(sides[index])) for kind, found in kinds for index in found]

    def _bordered(self, status: ContactStatus, keys: list[Key], least: float) -> bool:
        """Make the borders those with ``keys`` if all their pivots exceed the part ``least`` of the terms
        that cancel in them."""
        borders = {key: self._borders.get(key) or self._border(key) for key in keys}
        if not keys:
            self._unbordered()
        else:
            index = np.array([key[1] for key in keys])
            kind = np.array([key[0] for key in keys])
            rows, columns, responses, scales, size = zip(*borders.values(), strict=True)
            row, response, terms = np.stack(rows), np.stack(responses, axis=1), np.array(size)
            across, along = np.stack(scales, axis=1)
            corner = np.stack([column[index] for column in columns], axis=1)
            corner = np.where((kind == ENTERS)[:, None], corner, np.diag(np.where(kind == TURNS, -1.0, 0.0)))
            schur = across[:, None] * (corner - row @ response) * along
            *_, inverse, singular = dgesv(schur, np.eye(len(keys)))
            if singular:
                return False
            pivots = inverse_of(np.abs(inverse.diagonal()))
            terms[kind == ENTERS] += pivots[kind == ENTERS]
            if not (pivots > least * terms).all():
                return False
            self._rows, self._responses = row, response
            self._inverse = along[:, None] * inverse * across
            self._columns = np.stack([column[self._base] for column in columns], axis=1)
            self._corner = corner
            self._enter = np.flatnonzero(kind == ENTERS)
            self._entered = index[self._enter]
        self.status, self._active = status, status.active(self.problem.k)
        self._borders = borders
        return True

    def _border(self, key: Key) -> Border:
        p, (kind, index, side), (rows, columns) = self.problem, key, self.problem.levels
        row, column, corner = np.zeros(len(p.rows)), np.zeros(len(p.rows)), 0.0
        own = int(p.owner[index])
        if kind == ENTERS:
            row, column = p.matrix[index].copy(), p.matrix[:, index].copy()
            row[p.nodes] += self._side * p.friction * row[p.m : p.contacts]
            if own >= 0 and side:
                column += side * p.friction[own] * p.matrix[:, p.m + own]
            scales, corner = np.array([rows[index], columns[index]]), float(column[index])
        elif kind == LEAVES:
            row[index] = column[index] = 1.0
            if index >= p.m:
                row[p.nodes[index - p.m]] = -side * p.friction[index - p.m]
            scales = 1.0 / np.array([columns[index], rows[index]])
        else:
            row[index], corner = 1.0, -1.0
            column = (side - self._side[own]) * p.friction[own] * p.matrix[:, p.m + own]
            scales = np.array([1.0 / columns[index], columns[index]])
        response, size = self._factor.solve(column[self._base]), abs(corner) * scales[0] * scales[1]
        if kind == LEAVES:
            size = float(np.abs(response / columns[self._base]).max()) * scales[1]
        return row[self._base], column, response, scales, size

    def _response(self, values: FloatArray) -> FloatArray:
        """Unknowns (N,) for ``values`` (N,) of the active rows, refined once."""
        p, x, kept = self.problem, np.zeros(len(values)), values[self._base]
        right = np.zeros(len(self._borders))
        right[self._enter] = values[self._entered]
        solution, more = np.zeros(len(kept)), np.zeros(len(right))
        for _ in range(2):
            change = self._factor.solve(kept - self._matrix @ solution - self._columns @ more)
            further = self._inverse @ (right - self._corner @ more - self._rows @ (solution + change))
            more = more + further
            solution = solution + change - self._responses @ further
        x[self._base], x[self._entered] = solution, more[self._enter]
        x[: p.m][~self._active[: p.m]] = 0.0
        pressed, slips = p.friction * x[p.nodes], slice(p.m, p.contacts)
        sticks = self._active[slips]
        x[slips] = np.where(sticks, x[slips] + self._side * pressed, self.status.slip_sign * pressed)
        return x

    def mechanism(self, status: ContactStatus) -> tuple[FloatArray, FloatArray]:
        """Unknowns and rows (N,) that change, while no other active row does, with the one change to a
        singular ``status``; friction falls below its limit mu p, and slip opposes friction."""
        p, active, before = self.problem, status.active(self.problem.k), self.status
        index = int(np.flatnonzero(active != self._active)[0])
        unit, slid = np.zeros(len(p.rows)), (before if active[index] else status).slip_sign
        unit[index] = -1.0 if index >= p.m and slid[index - p.m] > 0.0 else 1.0
        values = unit
        if active[index]:
            own = int(p.owner[index])
            if own >= 0:
                unit[p.m + own] = status.slip_sign[own] * p.friction[own]
            values = np.where(self._active, -p.product(unit), 0.0)
        x = self._response(values)
        if active[index]:
            x, values = x + unit, np.zeros(len(unit))
        return x, np.where(self._active, values, p.product(x))

    def solve(
        self, free: FloatArray, reference: FloatArray, near: FloatArray | None = None
    ) -> tuple[FloatArray, FloatArray]:
        """Unknowns and rows (N,) for ``free`` rows with nodes sticking at slips ``reference`` (n,); motions
        are held, or springs unloaded, at those of the unknowns ``near``."""
        p, count, aim = self.problem, self.problem.contacts, np.zeros(len(free))
        aim[p.m : count] = reference
        values = np.where(self._active, aim - free, 0.0)
        size = np.abs(values).max(initial=0.0)
        if np.abs(self.left.T @ values[count:]).max(initial=0.0) > GRAZING * size:
            raise SingularError
        if near is not None:
            values[count:] += self._resists @ near[count:]
            size = np.abs(values).max(initial=0.0)
        x = self._response(values)
        # Equilibrated factors do not show motions that only round-off resists; a response to borders of an
        # exactly singular matrix is nan.
        largest = np.abs(x).max(initial=0.0)
        if MIN_RCOND * largest <= size:
            w = p.product(x)
            missed = np.where(self._active, values - w, 0.0)
            missed[count:] -= self._resists @ x[count:]
            self.missed = float((np.abs(missed) / p.grain).max(initial=0.0))
            if self.missed <= 100.0 * FEASIBLE * max(size, largest):
                return x, np.where(self._active, aim, free + w)
        if not self.anew():
            raise SingularError
        return self.solve(free, reference, near)

    def undriven(self, rows: FloatArray) -> FloatArray:
        """Rows (N,) without loads on held motions."""
        found, count = rows.copy(), self.problem.contacts
        found[count:] -= self.left @ (self.left.T @ rows[count:])
        return found


class _Factor:
    """LU factors of a matrix (r, r) with rows and columns scaled to largest entries of 1; ``rcond`` is its
    reciprocal condition number, 0 if it is singular."""

    def __init__(self, matrix: FloatArray) -> None:
        self.rcond = 1.0
        if not len(matrix):
            return
        self._rows = inverse_of(np.abs(matrix).max(axis=1))
        self._columns = inverse_of((self._rows[:, None] * np.abs(matrix)).max(axis=0))
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
    # The R factor has the same singular values and is smaller.
    return np.asarray(linalg.null_space(np.linalg.qr(rows, mode="r"), rcond=NULL))
