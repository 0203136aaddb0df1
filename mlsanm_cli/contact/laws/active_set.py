"""Exact contact without friction: p >= 0, h >= 0, p h = 0, solved by an active set on the condensed system.

The primal-dual active set (Hintermuller, Ito and Kunisch 2002, doi:10.1137/S1052623401383558) settles in a
few passes. Should it come back to a set it has seen, the least-index principal pivoting of Murty (Linear
Complementarity, Linear and Nonlinear Programming, 1988, chapter 4) takes over, which cannot cycle while
sym(W A) is positive definite.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mlsanm_cli.arrays import BoolArray, FloatArray
from mlsanm_cli.contact.laws.kkt import kkt_residual
from mlsanm_cli.contact.laws.limit_load import resting_nodes
from mlsanm_cli.contact.laws.set_search import EndlessError, UnbalancedError, moving
from mlsanm_cli.contact.response.condensed import Condensed
from mlsanm_cli.contact.response.dense import DenseSystem, SingularSystemError, smallest_solution

ROUND_OFF = 1e-11


@dataclass(frozen=True)
class ExactState:
    """Pressures (m,), gaps (m,), unknown motions (k,) and tractions (n,) at load factors ``factors`` (L,).

    ``active`` (m,) marks closed nodes, ``stuck`` (m,) those of them that friction holds; ``solves`` counts
    dense systems; ``residual`` is the largest violation of the contact conditions and balances, relative to
    the peak pressure, its elastic gap and the forces.
    """

    factors: FloatArray
    pressure: FloatArray
    gap: FloatArray
    motion: FloatArray
    traction: FloatArray
    active: BoolArray
    stuck: BoolArray
    solves: int
    residual: float


def solve_exact(condensed: Condensed, factors: FloatArray, start: BoolArray | None = None) -> ExactState:
    """Exact state without friction at ``factors`` (L,), the search beginning from the set ``start`` (m,).

    Raises NumericalError where no state balances the loads.
    """
    free_gap = condensed.gap.constant + condensed.gap.load @ factors
    first = _first_guess(condensed, free_gap) if start is None or not start.any() else start.copy()
    try:
        return _searched(condensed, factors, free_gap, first)
    except UnbalancedError:
        # From gaps that are alike all around, as of a pin in its hole, the search lets go of all nodes.
        rest = resting_nodes(condensed, factors, free_gap)
        if rest is None:
            raise
        return _searched(condensed, factors, free_gap, rest)


def _searched(
    condensed: Condensed, factors: FloatArray, free_gap: FloatArray, active: BoolArray
) -> ExactState:
    """The exact state, searched from a set (m,)."""
    gap_map, m = condensed.gap, len(condensed.weight)
    seen: set[bytes] = set()
    one_by_one = False
    limit = 50 * (m + 1)
    for count in range(1, limit + 1):
        pressure, motion, floating = _solve_active(condensed, free_gap, factors, active)
        gap = free_gap + gap_map.motion @ motion + gap_map.pressure @ pressure
        gap[active] = 0.0
        wrong = _violations(condensed, active, pressure, gap, moving(condensed, motion))
        if not wrong.any():
            if floating:
                raise _unbalanced()
            nothing = np.zeros(len(condensed.friction_nodes))
            unknowns = (factors, motion, pressure, nothing)
            residual = kkt_residual(condensed, unknowns, active, np.full(len(nothing), np.nan))
            return ExactState(
                factors,
                pressure,
                gap,
                motion,
                nothing,
                active,
                np.zeros_like(active),
                count,
                residual,
            )
        one_by_one |= active.tobytes() in seen
        if one_by_one:
            wrong[np.flatnonzero(wrong)[0] + 1 :] = False
        seen.add(active.tobytes())
        active = active ^ wrong
    raise EndlessError(limit)


def _first_guess(condensed: Condensed, free_gap: FloatArray) -> BoolArray:
    """Overlapping nodes; where forces must be balanced, at least the closest nodes of every contact."""
    active = np.asarray(free_gap < 0.0, dtype=bool)
    return active | condensed.closest(free_gap) if len(condensed.balance.constant) else active


def _solve_active(
    condensed: Condensed, free_gap: FloatArray, factors: FloatArray, active: BoolArray
) -> tuple[FloatArray, FloatArray, bool]:
    """Pressures (m,) that close the active nodes' gaps, motions (k,) that balance the platens, and whether
    bodies are loose with these nodes alone: where no force drives them they stay, until others touch."""
    closed = np.flatnonzero(active)
    balance = condensed.balance
    a, k = len(closed), len(balance.constant)
    pressure = np.zeros(len(active))
    if a + k == 0:
        return pressure, np.zeros(0), False
    matrix = np.empty((a + k, a + k))
    matrix[:a, :a] = condensed.gap.pressure[np.ix_(closed, closed)]
    matrix[:a, a:] = condensed.gap.motion[closed]
    matrix[a:, :a] = balance.pressure[:, closed]
    matrix[a:, a:] = balance.motion
    rhs = np.concatenate([-free_gap[closed], -(balance.constant + balance.load @ factors)])
    floating = False
    try:
        solution = DenseSystem(matrix, a).solve(rhs)
    except SingularSystemError:
        floating = True
        try:
            solution = smallest_solution(matrix, a, rhs)
        except SingularSystemError as error:
            raise _unbalanced() from error
    pressure[closed] = solution[:a]
    return pressure, solution[a:], floating


def _unbalanced() -> UnbalancedError:
    return UnbalancedError(
        "no contact pressure balances the loads",
        "a force-controlled platen may push its body away from the contact, or a body held by contact "
        "only may be free there; prescribe the displacement instead, or use "
        'contact.regularization.law = "hyperbolic"',
    )


def _violations(
    condensed: Condensed, active: BoolArray, pressure: FloatArray, gap: FloatArray, least: float
) -> BoolArray:
    """Closed nodes in tension and open nodes that overlap, beyond the round-off of the pressures, and of
    ``least``, which counts where nothing is loaded."""
    typical = max(float(np.abs(pressure).max(initial=0.0)), least)
    elastic = condensed.largest_compliance * typical
    tension = active & (pressure < -ROUND_OFF * typical)
    overlap = ~active & (gap < -ROUND_OFF * elastic)
    return np.asarray(tension | overlap, dtype=bool)
