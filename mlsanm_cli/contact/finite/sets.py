"""Status of nodes (open, stick, slip) in one linearised step, with pressures and friction.

Open nodes carry nothing; closed ones have no gap; of those with friction sticking ones have no slip, and
slipping ones carry q = d mu p against it, d = +-1.

Where the active-set exchange cycles, complementary pivoting finds the status. With q = l - mu p, l = mu p + q
>= 0 and the slip s = b - a split in two parts, frictional contact is a linear complementarity problem::

    gap  = ... >= 0      p >= 0      gap p = 0
    b    = s + a >= 0    l >= 0      b l = 0         slips forward: friction is -mu p
    2 mu p - l >= 0      a >= 0      a (2 mu p - l) = 0   slips backward: mu p

solved along one artificial load (Lemke 1965, doi:10.1287/mnsc.11.7.681): no basis recurs.

Equation (22) of docs/method.md.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from scipy.linalg.blas import dger

from mlsanm_cli.arrays import BoolArray, FloatArray
from mlsanm_cli.contact.laws.contact_status import OPEN, SLIP, STICK

MAX_PASSES, MAX_PASSES_AFTER_PIVOTS = 30, 10
"""Passes of the active set, and after pivoting."""


@dataclass(frozen=True)
class NodeSets:
    """``status`` (c,) of all nodes, OPEN, STICK or SLIP, and the ``slip_sign`` of friction on slipping nodes;
    closed nodes without friction slip with sign 0."""

    status: NDArray[np.int8]
    slip_sign: FloatArray

    @property
    def closed(self) -> BoolArray:
        """Mask (c,) of closed nodes."""
        return np.asarray(self.status != OPEN)

    def same(self, other: NodeSets) -> bool:
        """Whether both are equal."""
        return bool((self.status == other.status).all() and (self.slip_sign == other.slip_sign).all())


@dataclass(frozen=True)
class Linearised:
    """Linearised contact problem for nodes with ``friction`` coefficients (c,).

    Unknowns are changes of ``pressure``, of friction ``shear`` (c,) and of d free motions. Gaps are ``gap`` +
    ``by_gap`` (c, 2c + d) times these, and likewise slips, and the force imbalance ``balance`` (d,), which
    must vanish. Pressures up to ``nothing`` are round-off: the status of nodes at light touch does not
    matter.
    """

    friction: FloatArray
    pressure: FloatArray
    shear: FloatArray
    gap: FloatArray
    slip: FloatArray
    by_gap: FloatArray
    by_slip: FloatArray
    balance: FloatArray = field(default_factory=lambda: np.zeros(0))
    by_balance: FloatArray = field(default_factory=lambda: np.zeros((0, 0)))
    nothing: float = 0.0

    def settled(self, sets: NodeSets) -> tuple[FloatArray, NodeSets, bool]:
        """Changes (2c + d,) that satisfy all conditions, starting from ``sets``, the status, and whether it
        was found.

        Semismooth Newton method: the status follows from pressure minus gap, and shear minus slip, over the
        compliance (Alart and Curnier 1991). If it cycles, complementary pivoting determines the status.
        """
        change, wrong, found = self._exchanged(sets, MAX_PASSES)
        if wrong.any():
            pivoted = self._pivoted()
            if pivoted is not None:
                again = self._exchanged(pivoted, MAX_PASSES_AFTER_PIVOTS)
                if again[1].max() < wrong.max():
                    change, wrong, found = again
        return change, found, not wrong.any()

    def _exchanged(self, sets: NodeSets, most: int) -> tuple[FloatArray, FloatArray, NodeSets]:
        """Changes, violations (c,) and status after at most ``most`` passes."""
        status, slip_sign = sets.status.copy(), sets.slip_sign.copy()
        for number in range(most):
            change, wrong = self._tried(status, slip_sign)
            if not wrong.any() or number == most - 1:
                break
            status, slip_sign = self._better(change)
        return change, wrong, NodeSets(status, slip_sign)

    def _pivoted(self) -> NodeSets | None:
        """The status by complementary pivoting; None if it fails."""
        count, size = len(self.pressure), self._stiffness
        by_all = np.concatenate([self.by_gap, self.by_slip])
        matrix, moved = by_all[:, : 2 * count], np.concatenate([self.gap, self.slip])
        if len(self.balance):
            # Eliminate the free motions by the balance.
            onto = by_all[:, 2 * count :] @ np.linalg.inv(self.by_balance[:, 2 * count :])
            matrix = matrix - onto @ self.by_balance[:, : 2 * count]
            moved = moved - onto @ self.balance
        moved = moved - matrix @ np.concatenate([self.pressure, self.shear])
        (by_gap, by_slip), (gap, slip) = np.split(size * matrix, 2), np.split(size * moved, 2)
        found = complementary_sets(self.friction, gap, slip, by_gap, by_slip)
        return None if found is None else NodeSets(*found)

    @property
    def _stiffness(self) -> float:
        """1 over the largest compliance of a node."""
        largest = float(np.abs(np.diag(self.by_gap)).max(initial=0.0))
        return 1.0 / largest if largest else 1.0

    def _better(self, change: FloatArray) -> tuple[NDArray[np.int8], FloatArray]:
        """Next status (c,) and slip signs."""
        count, mu = len(self.pressure), self.friction
        p, q = self.pressure + change[:count], self.shear + change[count : 2 * count]
        push = p - self._stiffness * (self.gap + self.by_gap @ change)
        pull = q - self._stiffness * (self.slip + self.by_slip @ change)
        closed, holds = push > 0.0, (mu > 0.0) & (np.abs(pull) <= mu * push)
        status = np.where(closed, np.where(holds, STICK, SLIP), OPEN).astype(np.int8)
        return status, np.where((status == SLIP) & (mu > 0.0), np.sign(pull), 0.0)

    def _tried(self, status: NDArray[np.int8], slip_sign: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Changes (2c + d,) for a status, and violations (c,)."""
        count, mu = len(status), self.friction
        opened, stuck, slides = status == OPEN, status == STICK, status == SLIP
        pull = np.where(slides, slip_sign * mu, 0.0)
        own_p, own_q = np.split(np.eye(2 * count, 2 * count + len(self.balance)), 2)
        by_gap = np.where(opened[:, None], own_p, self.by_gap)
        by_slip = np.where(stuck[:, None], self.by_slip, own_q - pull[:, None] * own_p)
        matrix = np.concatenate([by_gap, by_slip, self.by_balance.reshape(-1, by_gap.shape[1])])
        normal = np.where(opened, -self.pressure, -self.gap)
        tangential = np.where(stuck, -self.slip, pull * self.pressure - self.shear)
        rhs = np.concatenate([normal, tangential, -self.balance])
        size = np.abs(matrix).max(axis=1, keepdims=True)
        change: FloatArray = np.linalg.solve(matrix / size, rhs / size[:, 0])
        p, q = self.pressure + change[:count], self.shear + change[count : 2 * count]
        gap, slip = self.gap + self.by_gap @ change, self.slip + self.by_slip @ change
        wrong = np.where(opened, -self._stiffness * gap, -p)
        wrong = np.where(stuck & (mu > 0.0), np.maximum(wrong, np.abs(q) - mu * p), wrong)
        wrong = np.where(slides & (mu > 0.0), np.maximum(wrong, self._stiffness * slip_sign * slip), wrong)
        tiny = max(1e-12 * float(np.abs(p).max(initial=0.0)), self.nothing)
        return change, np.where(wrong > tiny, wrong, 0.0)


PERTURBATION, MIN_PIVOT = 1e-10, 1e-11
"""Relative perturbation of right-hand sides, so that no two nodes change at once; and smallest relative
pivot."""
MAX_PIVOTS = 10
"""Largest number of pivots per unknown."""
GOLDEN = 0.5 * (np.sqrt(5.0) - 1.0)


def complementary_sets(
    friction: FloatArray, gap: FloatArray, slip: FloatArray, by_gap: FloatArray, by_slip: FloatArray
) -> tuple[NDArray[np.int8], FloatArray] | None:
    """Status and slip direction (c,) of nodes with ``friction`` coefficients (c,); None if the path does not
    end. ``gap`` and ``slip`` (c,) without pressure are in units of pressure, ``by_gap`` and ``by_slip`` (c,
    2c) their derivatives by pressures and shears."""
    count, rubs = len(gap), np.flatnonzero(friction > 0.0)
    by_p, by_l = by_gap[:, :count] - by_gap[:, count:] * friction, by_gap[:, count:][:, rubs]
    own_p = (by_slip[:, :count] - by_slip[:, count:] * friction)[rubs]
    own_l, n = by_slip[:, count:][np.ix_(rubs, rubs)], len(rubs)
    limit = np.zeros((n, count))
    limit[np.arange(n), rubs] = 2.0 * friction[rubs]
    matrix = np.block(
        [[by_p, by_l, np.zeros((count, n))], [own_p, own_l, np.eye(n)], [limit, -np.eye(n), np.zeros((n, n))]]
    )
    basis = _lemke(matrix, np.concatenate([gap, slip[rubs], np.zeros(n)]))
    if basis is None:
        return None
    closed, forward, backward = basis[:count], ~basis[count : count + n], basis[count + n :]
    status, sense = np.where(closed, SLIP, OPEN).astype(np.int8), np.zeros(count)
    slides = forward | backward
    status[rubs[closed[rubs] & ~slides]] = STICK
    sense[rubs] = np.where(closed[rubs] & slides, np.where(backward, 1.0, -1.0), 0.0)
    return status, sense


def _lemke(matrix: FloatArray, rest: FloatArray) -> NDArray[np.bool_] | None:
    """Mask (n,) of the unknowns z in the basis of w = M z + r, w >= 0, z >= 0, w z = 0; None if the path does
    not end."""
    n = len(rest)
    largest = float(np.abs(rest).max(initial=0.0))
    rest = rest + PERTURBATION * largest * (1.0 + np.mod(GOLDEN * np.arange(n), 1.0))
    if not (rest < 0.0).any():
        return np.zeros(n, dtype=bool)
    # Columns: all but the basic unknowns, and the right-hand side. w, z and the artificial load are numbered.
    table = np.hstack([-matrix, -np.ones((n, 1)), rest[:, None]])
    basis, others, row, column = np.arange(n), np.arange(n, 2 * n + 1), int(np.argmin(rest)), n
    for _ in range(MAX_PIVOTS * n):
        pivot, changes = table[row, column], table[:, column].copy()
        table[:, column], changes[row] = 0.0, 0.0
        table[row] /= pivot
        table[row, column] = 1.0 / pivot
        dger(-1.0, table[row], changes, a=table.T, overwrite_a=1, overwrite_x=0)
        leaves = int(basis[row])
        basis[row], others[column] = others[column], leaves
        if leaves == 2 * n:
            found = np.zeros(n, dtype=bool)
            found[basis[basis >= n] - n] = True
            return found
        column = int(np.flatnonzero(others == (leaves + n if leaves < n else leaves - n))[0])
        ways = table[:, column]
        up = np.flatnonzero(ways > MIN_PIVOT * max(float(np.abs(ways).max()), 1.0))
        if not len(up):
            return None
        row = int(up[np.argmin(np.maximum(table[up, -1], 0.0) / ways[up])])
    return None
