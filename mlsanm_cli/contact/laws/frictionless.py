"""Frictionless contact of a condensed scene, p >= 0, h >= 0, p h = 0, at given loads. Equation (14) of
docs/method.md without friction.

Many closed nodes with a compressed compliance are solved for by generalised conjugate residuals for nearly
symmetric matrices (GCR: Eisenstat, Elman and Schultz 1983, doi:10.1137/0720023); the search directions are
shared by all right-hand sides of one set. The preconditioner approximates the inverse of the compliance from
each node and a few neighbours, from coarse to fine (Vecchia 1988, doi:10.1111/j.2517-6161.1988.tb01729.x).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import scipy.sparse as sparse

from mlsanm_cli.arrays import BoolArray, FloatArray, IntArray
from mlsanm_cli.contact.complementarity.basis import Ray
from mlsanm_cli.contact.complementarity.equilibrium import collapse
from mlsanm_cli.contact.complementarity.problem import FEASIBLE, ContactStatus
from mlsanm_cli.contact.complementarity.solution import solve
from mlsanm_cli.contact.laws.contact_state import ContactState
from mlsanm_cli.contact.laws.failures import EndlessError, UnbalancedError
from mlsanm_cli.contact.response.compressed import Compressed, compressed
from mlsanm_cli.contact.response.condensed import Condensed
from mlsanm_cli.contact.response.dense import SINGULAR, SingularSystemError
from mlsanm_cli.errors import NumericalError
from mlsanm_cli.roundoff import ROUND_OFF

NEIGHBOURS = np.array([-7, -5, -4, -3, -2, -1, 1, 3, 5, 7, 0])
"""Neighbours for the approximate inverse, the node itself last: offsets times the largest power of two that
divides the node's number, so that coarser nodes have wider stencils."""
SEARCH_TOLERANCE, FINAL_TOLERANCE, MAX_PRODUCTS = 1e-7, 1e-13, 400
"""Relative residuals during the active-set search and at the end, and largest number of products."""
NOISE, MAX_PASSES = 1000.0, 300
"""Tolerance of conditions over the residual of solutions; and largest number of Newton steps."""
MAX_DENSE = 6000
"""Largest number of closed nodes whose equations are solved directly where iterations do not converge."""


class NotConvergedError(NumericalError):
    """The iterations have not found the pressures: a slender loose body yields to long waves of pressure a
    million times as much as to short ones."""

    def __init__(self) -> None:
        super().__init__(
            "the pressures of a contact with many unknowns have not been found",
            "make contact.accuracy larger, which takes fewer unknowns",
        )


def solve_exact(condensed: Condensed, factors: FloatArray, start: BoolArray | None = None) -> ContactState:
    """Exact frictionless state at ``factors`` (L,), searched from the set ``start`` (m,). Raises
    UnbalancedError if no pressures balance the loads, EndlessError if no state is found."""
    free_gap = condensed.gap.constant + condensed.gap.load @ factors
    load = condensed.balance.constant + condensed.balance.load @ factors
    # Overlapping nodes; if forces must be balanced, also the closest nodes of every contact.
    drawn = np.asarray(free_gap < 0.0)
    if len(load):
        drawn = drawn | condensed.closest(free_gap)
    starts = [drawn] if start is None or not start.any() else [start, drawn]
    found = None
    if compressed(condensed.gap.pressure) is not None:
        try:
            found = _searched(condensed, free_gap, -load, starts[0])
        except (NotConvergedError, SingularSystemError):
            if len(drawn) > MAX_DENSE:
                raise
    closed, pressure, motion, solves = found or _by_pivots(condensed, factors, starts)
    # Surfaces in contact without a load only had to be separated: their pressures are round-off of the gaps.
    if closed.any() and not load.any() and condensed.elastic_gap(pressure) <= condensed.gap_round_off:
        closed, pressure = np.zeros_like(closed), np.zeros_like(pressure)
    gap = free_gap + condensed.gap.motion @ motion + condensed.gap.pressure @ pressure
    gap[closed] = 0.0
    none = np.zeros(len(condensed.friction_nodes))
    status, slip = ContactStatus(closed, none > 0.0, none), np.full(len(none), np.nan)
    return ContactState(pressure, none, motion, gap, slip, status, factors, none, none, solves=solves)


def _by_pivots(
    condensed: Condensed, factors: FloatArray, starts: Sequence[BoolArray]
) -> tuple[BoolArray, FloatArray, FloatArray, int]:
    """Closed nodes (m,), pressures (m,), motions (k,), and the number of systems solved."""
    p, none = condensed.frictionless, np.zeros(0)
    free = p.rows * np.delete(condensed.unscaled_rows(factors), np.arange(p.m, p.m + len(condensed.friction)))
    try:
        found = solve(p, free, *(ContactStatus(first, none > 0.0, none) for first in starts))
    except Ray as error:
        if p.k and collapse(p, free) is None:
            raise EndlessError from error
        raise UnbalancedError(
            "no contact pressure balances the loads",
            "a force-controlled platen may push its body away from the contact, or a body held by contact "
            "only may be free there; prescribe the displacement instead",
        ) from error
    x = p.columns * found.x
    # Nodes that only touch, with pressures of round-off, are open.
    pressed = x[: p.m] > FEASIBLE * float(x[: p.m].max(initial=0.0))
    return found.status.closed & pressed, np.where(pressed, x[: p.m], 0.0), x[p.m :], found.systems


def _searched(
    condensed: Condensed, free_gap: FloatArray, force: FloatArray, active: BoolArray
) -> tuple[BoolArray, FloatArray, FloatArray, int]:
    """The same of many unknowns with ``free_gap`` (m,) and ``force`` (k,): semismooth Newton steps from the
    set ``active`` (m,), at first with rough solutions. Raises NotConvergedError, SingularSystemError."""
    gap_map, balance, seen = condensed.gap, condensed.balance, set[bytes]()
    compliance = compressed(gap_map.pressure)
    assert compliance is not None
    pressure, parts = np.zeros(len(active)), [SEARCH_TOLERANCE, FINAL_TOLERANCE]
    for count in range(1, MAX_PASSES + 1):
        closed = np.flatnonzero(active)
        moved, forces = gap_map.motion[closed], balance.pressure[:, closed]
        if not len(closed) and len(force):
            raise SingularSystemError
        system = ManyClosed(compliance, closed, moved, forces, balance.motion) if len(closed) else None
        for part in parts:
            near, pressure, motion = pressure[closed], np.zeros(len(active)), force
            if system is not None:
                pressure[closed], motion = system.solve(-free_gap[closed], force, near, part)
            gap = free_gap + gap_map.motion @ motion + compliance @ pressure
            tolerance = NOISE * part * max(float(np.abs(pressure).max(initial=0.0)), np.finfo(float).tiny)
            elastic = tolerance * condensed.largest_compliance
            wrong = np.where(active, pressure < -tolerance, gap < -elastic)
            if wrong.any():
                break
        if not wrong.any():
            return active, pressure, motion, count
        if active.tobytes() in seen:
            if len(parts) == 1:
                break
            parts = [FINAL_TOLERANCE]
            seen.clear()
        seen.add(active.tobytes())
        active = active ^ wrong
    raise NotConvergedError


class ManyClosed:
    """The equations C p + M q = a, F p + G q = b for closed nodes. C is the ``compliance`` (m, m) restricted
    to the indices ``closed`` (c,), M = ``moved`` the gaps per motion, F = ``forces`` and G = ``stiffness``
    the forces per pressure and motion. Raises SingularSystemError if bodies are loose, NotConvergedError."""

    def __init__(
        self,
        compliance: Compressed,
        closed: IntArray,
        moved: FloatArray,
        forces: FloatArray,
        stiffness: FloatArray,
    ) -> None:
        self._compliance, self._closed = compliance, closed
        self._weight = compliance.weight[closed]
        self._inverse = _about_inverse(compliance, closed)
        self._directions = list[tuple[FloatArray, FloatArray]]()
        self._forces, self._moved, self._stiffness = forces, moved, stiffness
        self._by_motion, self._reduced = np.zeros_like(moved), stiffness
        self._left = np.inf
        self._by_motions(SEARCH_TOLERANCE)
        if len(stiffness):
            rows = np.abs(stiffness) + np.abs(forces) @ np.abs(self._by_motion)
            scale = np.maximum(rows.max(axis=1), np.finfo(float).tiny)
            if np.linalg.cond(self._reduced / scale[:, None]) > 1.0 / SINGULAR:
                raise SingularSystemError

    def _by_motions(self, part: float) -> None:
        """Compute the pressures due to motions, unless a relative residual ``part`` is reached already."""
        if part >= self._left:
            return
        for column, moved in enumerate(self._moved.T):
            self._by_motion[:, column] = self._own(moved, self._by_motion[:, column], part)
        self._reduced = self._stiffness - self._forces @ self._by_motion
        self._left = part

    def solve(
        self, gap: FloatArray, force: FloatArray, start: FloatArray, part: float = FINAL_TOLERANCE
    ) -> tuple[FloatArray, FloatArray]:
        """Pressures (c,) and motions (k,) for right-hand sides a and b, from pressures ``start``, to a
        relative residual ``part``."""
        self._by_motions(part)
        alone = self._own(gap, start, part)
        if not len(force):
            return alone, force
        motion = np.asarray(np.linalg.solve(self._reduced, force - self._forces @ alone), dtype=np.float64)
        return alone - self._by_motion @ motion, motion

    def _product(self, pressure: FloatArray) -> FloatArray:
        """Gaps (c,) due to pressures (c,)."""
        whole = np.zeros(self._compliance.shape[1])
        whole[self._closed] = pressure
        return np.asarray((self._compliance @ whole)[self._closed])

    def _own(self, gap: FloatArray, start: FloatArray, part: float) -> FloatArray:
        """Pressures (c,) for gaps (c,) to a relative residual ``part``, from ``start``."""
        total, size = start.copy(), float(np.linalg.norm(self._weight * gap))
        left = self._weight * (gap - self._product(start) if start.any() else gap)
        aim = float(np.linalg.norm(left))
        for way, change in self._directions:
            share = change @ left
            total += share * way
            left = left - share * change
        for _ in range(MAX_PRODUCTS):
            aim = float(np.linalg.norm(left))
            if aim <= part * size:
                break
            way = self._inverse.T @ (self._inverse @ left)
            change = self._weight * self._product(way)
            for before, caused in self._directions:
                share = caused @ change
                way, change = way - share * before, change - share * caused
            length = float(np.linalg.norm(change))
            if length == 0.0:
                break
            way, change = way / length, change / length
            self._directions.append((way, change))
            share = change @ left
            total += share * way
            left = left - share * change
        if not aim <= max(part, ROUND_OFF) * size:
            raise NotConvergedError
        return total


def _about_inverse(compliance: Compressed, closed: IntArray) -> sparse.csr_array:
    """A matrix (c, c) whose product with its transpose approximates the inverse of the weighted
    compliance."""
    count = len(closed)
    rank = np.arange(1, count + 1)
    other = rank[:, None] + NEIGHBOURS * (rank & -rank)[:, None]
    there = (other >= 1) & (other <= count)
    other = np.where(there, other, rank[:, None]) - 1
    size = len(NEIGHBOURS)
    local = compliance.weighted(closed[other])
    local = np.where(there[:, :, None] & there[:, None, :], local, 0.0)
    local[:, np.arange(size), np.arange(size)] += ~there
    units = np.zeros((count, size, 1))
    units[:, -1] = 1.0
    rows = np.linalg.solve(local, units)[:, :, 0]
    rows = np.where(there, rows / np.sqrt(np.abs(rows[:, -1:])), 0.0)
    places = np.repeat(np.arange(count), size), other.ravel()
    return sparse.csr_array((rows.ravel(), places), shape=(count, count))
