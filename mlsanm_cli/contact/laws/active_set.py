"""Frictionless contact of a condensed scene, p >= 0, h >= 0, p h = 0, at given loads. Equation (14) of
docs/method.md without friction."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from mlsanm_cli.arrays import BoolArray, FloatArray
from mlsanm_cli.contact.complementarity.basis import Ray
from mlsanm_cli.contact.complementarity.equilibrium import collapse
from mlsanm_cli.contact.complementarity.problem import FEASIBLE, ContactStatus
from mlsanm_cli.contact.complementarity.solution import solve
from mlsanm_cli.contact.laws.contact_state import kkt_residual
from mlsanm_cli.contact.laws.failures import EndlessError, UnbalancedError
from mlsanm_cli.contact.laws.many_unknowns import MAX_DENSE, NotConvergedError, searched
from mlsanm_cli.contact.response.compressed import compressed
from mlsanm_cli.contact.response.condensed import Condensed
from mlsanm_cli.contact.response.dense import SingularSystemError
from mlsanm_cli.records import dataclass


@dataclass(frozen=True)
class ExactState:
    """Pressures (m,), gaps (m,), unknown motions (k,) and tractions (n,) at load ``factors`` (L,).

    ``active`` (m,) marks closed nodes, ``stuck`` (m,) those held by friction; ``solves`` counts dense
    systems; ``residual`` is the largest violation of contact conditions and balances, relative to the peak
    pressure, its elastic gap and the forces. Eigenstresses change the gaps of other paired nodes by
    ``shift`` (w,).
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
    shift: FloatArray | float = 0.0

    @property
    def unknowns(self) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        """Load factors, motions, pressures and tractions as arguments of linear maps."""
        return self.factors, self.motion, self.pressure, self.traction


def solve_exact(condensed: Condensed, factors: FloatArray, start: BoolArray | None = None) -> ExactState:
    """Exact frictionless state at ``factors`` (L,), searched from the set ``start`` (m,). Raises
    UnbalancedError if no pressures balance the loads, EndlessError if no state is found."""
    free_gap = condensed.gap.constant + condensed.gap.load @ factors
    # Overlapping nodes; if forces must be balanced, also the closest nodes of every contact.
    drawn = np.asarray(free_gap < 0.0)
    if len(condensed.balance.constant):
        drawn = drawn | condensed.closest(free_gap)
    starts = [drawn] if start is None or not start.any() else [start, drawn]
    active, pressure, motion, solves = _solved(condensed, factors, starts)
    if active.any() and _only_moved(condensed, factors, pressure):
        active, pressure = np.zeros_like(active), np.zeros_like(pressure)
    gap = free_gap + condensed.gap.motion @ motion + condensed.gap.pressure @ pressure
    gap[active] = 0.0
    nothing = np.zeros(len(condensed.friction_nodes))
    unknowns = (factors, motion, pressure, nothing)
    residual = kkt_residual(condensed, unknowns, active, np.full(len(nothing), np.nan))
    stuck = np.zeros_like(active)
    return ExactState(factors, pressure, gap, motion, nothing, active, stuck, solves, residual)


def _solved(
    condensed: Condensed, factors: FloatArray, starts: Sequence[BoolArray]
) -> tuple[BoolArray, FloatArray, FloatArray, int]:
    """Closed nodes (m,), pressures (m,), motions (k,), and the number of systems solved."""
    if compressed(condensed.gap.pressure) is not None:
        try:
            return searched(condensed, factors, starts[0])
        except (NotConvergedError, SingularSystemError):
            if len(starts[0]) > MAX_DENSE:
                raise
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


def _only_moved(condensed: Condensed, factors: FloatArray, pressure: FloatArray) -> bool:
    """Whether surfaces in contact, drawn overlapping or displaced by others, only had to be separated:
    without a load their ``pressure`` (m,) is round-off of the gaps."""
    if (condensed.balance.constant + condensed.balance.load @ factors).any():
        return False
    return condensed.elastic_gap(pressure) <= condensed.gap_round_off
