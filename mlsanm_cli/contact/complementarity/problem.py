"""The mixed linear complementarity problem of unilateral contact with Coulomb friction in the plane.

Unknowns x are pressures p (m), tractions t (n) and motions q (k); rows w are gaps h (m), slips s (n) and
force balances (k). With given free rows w0::

    w = w0 + A x,    0 <= h  _|_  p >= 0,    |t| <= mu p,  t opposes the slip s - s0,    balances = 0

mu = 0 or n = 0 is the problem without friction. The form is that of Klarbring 1986
(doi:10.1007/BF01536422). Equation (14) of docs/method.md.

Gaps and slips are divided by the compliance of their own node, motions by the largest displacement they
cause, balances by their largest coefficient: all conditions are pressures, compared with the largest one.
"""

from __future__ import annotations

from functools import cached_property
from typing import Any, Protocol
from weakref import WeakValueDictionary

import numpy as np
from numpy.typing import NDArray

from mlsanm_cli.arrays import BoolArray, FloatArray, IntArray
from mlsanm_cli.records import dataclass
from mlsanm_cli.roundoff import LAST_DIGITS

FEASIBLE = 1e-10
"""Violation of a condition that is round-off over the largest pressure: 1e-16 times a condition of 1e6."""
GRAZING = SINGULAR = 10.0 * FEASIBLE
"""Distance from a limit at which a condition is at it, as events are located to FEASIBLE; and pivot, relative
to the terms that cancel in it, that is zero."""
DOUBTFUL = SINGULAR**0.5
"""Pivot below which it is computed with new factors: borders of old ones may have lost its digits."""
GRAIN = 100.0 * float(np.finfo(float).eps)
"""Round-off of a row relative to its largest coefficient."""
WEAK = 1e-6
"""Own compliance, or pressure over motion, relative to the largest, below which the latter is the scale."""

OPEN, STICK, SLIP = 0, 1, 2
"""Contact status of a node."""
OPENS, CLOSES, FORWARD, BACKWARD, RESTS = range(5)
"""Changes of status of a node: it opens, closes, slips with traction mu p or -mu p, comes to rest. Those
``allowed`` are a mask (5, m); conditions of others do not hold."""


class Multiplier(Protocol):
    def __matmul__(self, vector: FloatArray, /) -> FloatArray: ...


@dataclass(frozen=True, eq=False)
class ContactStatus:
    """``closed`` (m,) nodes, ``stuck`` (n,) nodes with friction, and the ``slip_sign`` (n,) of friction on
    closed slipping nodes, 0 on others."""

    closed: BoolArray
    stuck: BoolArray
    slip_sign: FloatArray

    @classmethod
    def with_tractions(
        cls, closed: BoolArray, stuck: BoolArray, traction: FloatArray, nodes: IntArray
    ) -> ContactStatus:
        """The status of a state whose ``closed`` nodes slip in the direction of their ``traction`` (n,)
        unless they are ``stuck``."""
        slides = closed[nodes] & ~stuck
        sign = np.where(slides, np.where(traction < 0.0, -1.0, 1.0), 0.0)
        return cls(closed, stuck & closed[nodes], sign)

    @property
    def key(self) -> bytes:
        return self.closed.tobytes() + self.stuck.tobytes() + self.slip_sign.tobytes()

    def status(self, friction_nodes: IntArray) -> NDArray[np.int8]:
        """Status (m,) of every node; closed nodes without friction slip."""
        status = np.where(self.closed, SLIP, OPEN).astype(np.int8)
        status[friction_nodes[self.stuck]] = STICK
        return status

    def active(self, motions: int) -> BoolArray:
        """Mask (m + n + k,) of unknowns that are not given by their limits."""
        return np.concatenate([self.closed, self.stuck, np.ones(motions, dtype=bool)])


@dataclass(frozen=True, eq=False)
class Problem:
    """The scaled ``matrix`` (N, N) of the problem, N = m + n + k. Friction acts at ``nodes`` (n,) of the m
    with coefficients ``friction`` (n,). Scaled quantities are ``rows`` (N,) times gaps, slips and balances,
    and unknowns over ``columns`` (N,); ``unscaled`` multiplies by the matrix before that."""

    matrix: FloatArray
    nodes: IntArray
    friction: FloatArray
    m: int
    rows: FloatArray
    columns: FloatArray
    unscaled: Multiplier

    @classmethod
    def of(
        cls,
        matrix: FloatArray,
        nodes: IntArray,
        friction: FloatArray,
        m: int,
        unscaled: Multiplier | None = None,
    ) -> Problem:
        """Scale a ``matrix`` (N, N) in any units, whose products are those of ``unscaled`` if given."""
        # Next to corners of graded grids own compliances are as little as 1e-4 of what other nodes cause, and
        # gaps that are small against the latter still change pressures.
        count, own = m + len(nodes), np.abs(matrix.diagonal())[: m + len(nodes)]
        moving = np.abs(matrix[:count, count:])
        elastic = _largest(matrix[:count, :count]).max(initial=0.0)
        largest = float(elastic) or float(moving.max(initial=0.0)) or 1.0
        rows, columns = np.ones(len(matrix)), np.ones(len(matrix))
        rows[:count] = 1.0 / np.where(own > WEAK * largest, own, largest)
        columns[count:] = inverse_of((rows[:count, None] * moving).max(axis=0, initial=0.0))
        rows[count:] = inverse_of(np.abs(matrix[count:] * columns).max(axis=1, initial=0.0))
        scaled = rows[:, None] * matrix
        scaled *= columns
        return cls(scaled, nodes, friction, m, rows, columns, matrix if unscaled is None else unscaled)

    @property
    def n(self) -> int:
        return len(self.nodes)

    @property
    def contacts(self) -> int:
        """Number of gaps and slips."""
        return self.m + self.n

    @property
    def k(self) -> int:
        return len(self.rows) - self.contacts

    @cached_property
    def kept(self) -> WeakValueDictionary[str, Any]:
        """The last basis, as long as it is in use."""
        return WeakValueDictionary()

    @cached_property
    def owner(self) -> IntArray:
        """Index (N,) among the nodes with friction of each pressure, -1 of other unknowns."""
        found = np.full(len(self.rows), -1)
        found[self.nodes] = np.arange(self.n)
        return found

    @cached_property
    def rubs(self) -> BoolArray:
        return np.asarray(self.friction > 0.0)

    @cached_property
    def exchange(self) -> FloatArray:
        """Pressure per gap and traction per slip (m + n,) in semismooth Newton steps: by the largest response
        of a row, as other nodes resist too."""
        count = self.contacts
        return inverse_of(_largest(self.matrix[:count, :count]))

    @cached_property
    def largest(self) -> FloatArray:
        """Largest coefficient of each row (N,)."""
        return _largest(self.matrix)

    @cached_property
    def grain(self) -> FloatArray:
        """Round-off of rows (N,) over FEASIBLE, at least 1, where rows are small differences of what
        pressures cause."""
        return np.asarray(np.maximum(1.0, GRAIN / FEASIBLE * self.largest))

    @cached_property
    def levels(self) -> tuple[FloatArray, FloatArray]:
        """Factors (N,) of rows and columns after which their largest coefficients are 1."""
        rows = inverse_of(self.largest)
        scaled = rows[:, None] * self.matrix
        return rows, inverse_of(np.abs(scaled, out=scaled).max(axis=0, initial=0.0))

    @cached_property
    def everything(self) -> BoolArray:
        """All changes (5, m) are admissible: the problem of a state."""
        return np.ones((5, self.m), dtype=bool)

    def touching(self, closed: BoolArray) -> ContactStatus:
        """The status of ``closed`` nodes (m,) that stick if they have friction."""
        return ContactStatus.with_tractions(closed, self.rubs, self.friction, self.nodes)

    def product(self, x: FloatArray) -> FloatArray:
        """Rows (N,) due to unknowns (N,)."""
        return np.asarray(self.rows * (self.unscaled @ (self.columns * x)))

    def size(self, x: FloatArray) -> float:
        """Largest pressure or traction, which round-off is relative to, at least that of which the round-off
        is the last digits of the motions."""
        pressed = float(np.abs(x[: self.contacts]).max(initial=0.0))
        return max(pressed, LAST_DIGITS / FEASIBLE * float(np.abs(x[self.contacts :]).max(initial=0.0)))

    def distances(
        self, status: ContactStatus, allowed: BoolArray, x: FloatArray, w: FloatArray, reference: FloatArray
    ) -> FloatArray:
        """Distance from the limit of each condition (5, m), by change and node; infinite where there is none.
        Given rates and a zero ``reference`` (n,), their rates."""
        pressure, traction, found = x[: self.m], x[self.m : self.contacts], np.full((5, self.m), np.inf)
        stuck = status.stuck & self.rubs
        holds = np.zeros(self.m, dtype=bool)
        holds[self.nodes] = stuck
        # A sticking node that loses its pressure slips before it opens.
        opens, closes = status.closed & ~holds, ~status.closed
        found[OPENS, opens] = pressure[opens]
        found[CLOSES, closes] = w[: self.m][closes]
        limit = self.friction * pressure[self.nodes]
        found[FORWARD, self.nodes[stuck]] = (limit - traction)[stuck]
        found[BACKWARD, self.nodes[stuck]] = (limit + traction)[stuck]
        slides = (status.slip_sign != 0.0) & self.rubs
        opposed = -status.slip_sign * (w[self.m : self.contacts] - reference)
        found[RESTS, self.nodes[slides]] = opposed[slides]
        found[~allowed] = np.inf
        return found

    def changed(self, status: ContactStatus, change: int, node: int, slipped: FloatArray) -> ContactStatus:
        """The status after a ``change`` of a ``node``; one that closes slips against its ``slipped`` (n,)."""
        closed, stuck, slip_sign = status.closed.copy(), status.stuck.copy(), status.slip_sign.copy()
        closed[node] = change != OPENS
        own = self.owner[node]
        if own >= 0:
            stuck[own] = change == RESTS
            against = 1.0 if slipped[own] <= 0.0 else -1.0
            slip_sign[own] = {FORWARD: 1.0, BACKWARD: -1.0, CLOSES: against}.get(change, 0.0)
        return ContactStatus(closed, stuck, slip_sign)


def _largest(matrix: FloatArray) -> FloatArray:
    # Without a copy of the matrix.
    return np.asarray(np.maximum(matrix.max(axis=1, initial=0.0), -matrix.min(axis=1, initial=0.0)))


def inverse_of(values: FloatArray) -> FloatArray:
    """Reciprocals of positive values, else 1."""
    return np.asarray(1.0 / np.where(values > 0.0, values, 1.0))
