"""Frictionless contact of a condensed scene, p >= 0, h >= 0, p h = 0, at given loads. Equation (14) of
docs/method.md without friction.

Many closed nodes with a compressed compliance are solved for by generalised conjugate residuals for nearly
symmetric matrices (GCR: Eisenstat, Elman and Schultz 1983, doi:10.1137/0720023); the search directions are
shared by all right-hand sides of one set. The preconditioner approximates the inverse of the compliance from
each node and a few neighbours, from coarse to fine (Vecchia 1988, doi:10.1111/j.2517-6161.1988.tb01729.x).
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import scipy.sparse as sparse

from mlsanm_cli.arrays import BoolArray, FloatArray, IntArray
from mlsanm_cli.contact.complementarity.basis import Ray
from mlsanm_cli.contact.complementarity.equilibrium import collapse
from mlsanm_cli.contact.complementarity.problem import FEASIBLE, ContactStatus
from mlsanm_cli.contact.complementarity.solution import solve
from mlsanm_cli.contact.laws.contact_state import ContactState, EndlessError, UnbalancedError
from mlsanm_cli.contact.response.compressed import SINGULAR, Compressed, compressed
from mlsanm_cli.contact.response.condensed import Condensed
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
        except NotConvergedError:
            if len(drawn) > MAX_DENSE:
                raise
    if found is None:
        p, rows = condensed.frictionless, condensed.unscaled_rows(factors)
        free = p.rows * np.delete(rows, np.arange(p.m, p.m + len(condensed.friction)))
        try:
            state = solve(p, free, *map(p.touching, starts))
        except Ray as error:
            if p.k and collapse(p, free) is None:
                raise EndlessError from error
            raise UnbalancedError(
                "no contact pressure balances the loads",
                "a force-controlled platen may push its body away from the contact, or a body held by "
                "contact only may be free there; prescribe the displacement instead",
            ) from error
        x = p.columns * state.x
        # Nodes that only touch, with pressures of round-off, are open.
        pressed = x[: p.m] > FEASIBLE * float(x[: p.m].max(initial=0.0))
        found = state.status.closed & pressed, np.where(pressed, x[: p.m], 0.0), x[p.m :], state.systems
    closed, pressure, motion, solves = found
    # Surfaces in contact without a load only had to be separated: their pressures are round-off of the gaps.
    if closed.any() and not load.any() and condensed.elastic_gap(pressure) <= condensed.gap_round_off:
        closed, pressure = np.zeros_like(closed), np.zeros_like(pressure)
    gap = free_gap + condensed.gap.motion @ motion + condensed.gap.pressure @ pressure
    gap[closed] = 0.0
    none = np.zeros(len(condensed.friction_nodes))
    status, slip = ContactStatus(closed, none > 0.0, none), np.full(len(none), np.nan)
    return ContactState(pressure, none, motion, gap, slip, status, factors, none, none, solves=solves)


def _searched(
    condensed: Condensed, free_gap: FloatArray, force: FloatArray, active: BoolArray
) -> tuple[BoolArray, FloatArray, FloatArray, int]:
    """Closed nodes (m,), pressures (m,), motions (k,), and the number of systems solved, for many unknowns
    with ``free_gap`` (m,) and ``force`` (k,): semismooth Newton steps from the set ``active`` (m,), at first
    with rough solutions. Raises NotConvergedError."""
    gap_map, balance, seen = condensed.gap, condensed.balance, set[bytes]()
    compliance = compressed(gap_map.pressure)
    assert compliance is not None
    pressure, parts = np.zeros(len(active)), [SEARCH_TOLERANCE, FINAL_TOLERANCE]
    for count in range(1, MAX_PASSES + 1):
        closed = np.flatnonzero(active)
        if not len(closed) and len(force):
            raise NotConvergedError
        solve_closed = _conjugate_residuals(compliance, closed)
        moved, forces, by_motion = gap_map.motion[closed], balance.pressure[:, closed], np.zeros(0)
        for part in dict.fromkeys([SEARCH_TOLERANCE, *parts]):
            # Pressures due to motions, and the forces that these cause.
            starts = by_motion if by_motion.size else np.zeros_like(moved)
            solved = [solve_closed(*pair, part) for pair in zip(moved.T, starts.T, strict=True)]
            by_motion = np.stack(solved, axis=1) if solved else starts
            reduced = balance.motion - forces @ by_motion
            if part == SEARCH_TOLERANCE and len(force):
                rows = np.abs(balance.motion) + np.abs(forces) @ np.abs(by_motion)
                scale = np.maximum(rows.max(axis=1), np.finfo(float).tiny)
                if np.linalg.cond(reduced / scale[:, None]) > 1.0 / SINGULAR:
                    raise NotConvergedError
            if part not in parts:
                continue
            alone, motion = solve_closed(-free_gap[closed], pressure[closed], part), force
            if len(force):
                motion = np.asarray(np.linalg.solve(reduced, force - forces @ alone), dtype=np.float64)
            pressure = np.zeros(len(active))
            pressure[closed] = alone - by_motion @ motion
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


def _conjugate_residuals(
    compliance: Compressed, closed: IntArray
) -> Callable[[FloatArray, FloatArray, float], FloatArray]:
    """The solver of pressures of the nodes ``closed`` for their gaps (c,), from pressures (c,), to a relative
    residual. Raises NotConvergedError."""
    if not len(closed):
        return lambda gap, start, part: gap
    weight, inverse = compliance.weight[closed], _about_inverse(compliance, closed)
    directions = list[tuple[FloatArray, FloatArray]]()

    def caused_by(pressure: FloatArray) -> FloatArray:
        whole = np.zeros(compliance.shape[1])
        whole[closed] = pressure
        return np.asarray((compliance @ whole)[closed])

    def solved(gap: FloatArray, start: FloatArray, part: float) -> FloatArray:
        total, size = start.copy(), float(np.linalg.norm(weight * gap))
        left = weight * (gap - caused_by(start) if start.any() else gap)
        aim = float(np.linalg.norm(left))
        for way, change in directions:
            share = change @ left
            total += share * way
            left = left - share * change
        for _ in range(MAX_PRODUCTS):
            aim = float(np.linalg.norm(left))
            if aim <= part * size:
                break
            way = inverse.T @ (inverse @ left)
            change = weight * caused_by(way)
            for before, caused in directions:
                share = caused @ change
                way, change = way - share * before, change - share * caused
            length = float(np.linalg.norm(change))
            if length == 0.0:
                break
            way, change = way / length, change / length
            directions.append((way, change))
            share = change @ left
            total += share * way
            left = left - share * change
        if not aim <= max(part, ROUND_OFF) * size:
            raise NotConvergedError
        return total

    return solved


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
