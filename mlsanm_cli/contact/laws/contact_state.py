"""Contact states in the units of a condensed scene: residuals, and linear responses at a fixed status."""

from __future__ import annotations

from dataclasses import field
from typing import Any

import numpy as np

from mlsanm_cli.arrays import BoolArray, FloatArray
from mlsanm_cli.contact.complementarity.basis import Basis
from mlsanm_cli.contact.complementarity.problem import FEASIBLE, ContactStatus, Problem
from mlsanm_cli.contact.response.condensed import Condensed
from mlsanm_cli.errors import NumericalError
from mlsanm_cli.records import dataclass
from mlsanm_cli.roundoff import COARSE_ROUND_OFF

NONE = np.zeros(0)


@dataclass(frozen=True, eq=False)
class ContactState:
    """Pressures and gaps (m,), tractions and slips (n,) and unknown motions (k,) of a ``status``, or their
    rates, at load ``factors`` (L,).

    Nodes stick at slips ``reference`` (n,); friction has dissipated the energy ``work`` (n,) so far, per
    length of surface. The state is at the ``fraction`` of a stage, came after so many ``solves``, and may
    have ``jumped`` from another one. Eigenstresses change the gaps of other paired nodes by ``shift`` (w,).
    """

    pressure: FloatArray
    traction: FloatArray
    motion: FloatArray
    gap: FloatArray
    slip: FloatArray
    status: ContactStatus
    factors: FloatArray = field(default_factory=lambda: NONE)
    reference: FloatArray = field(default_factory=lambda: NONE)
    work: FloatArray = field(default_factory=lambda: NONE)
    fraction: float = 0.0
    solves: int = 0
    jumped: bool = False
    shift: FloatArray | float = 0.0

    @classmethod
    def unscaled(
        cls, problem: Problem, status: ContactStatus, x: FloatArray, w: FloatArray, **more: Any
    ) -> ContactState:
        """The state of scaled unknowns and rows of a problem."""
        unknowns, rows = problem.columns * x, w / problem.rows
        pressure, traction, motion = np.split(unknowns, [problem.m, problem.contacts])
        gap, slip, _ = np.split(rows, [problem.m, problem.contacts])
        return cls(pressure, traction, motion, gap, slip, status, **more)

    @property
    def closed(self) -> BoolArray:
        """Mask (m,) of closed nodes."""
        return self.status.closed

    @property
    def unknowns(self) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        """Load factors, motions, pressures and tractions as arguments of linear maps."""
        return self.factors, self.motion, self.pressure, self.traction


def response(basis: Basis, gap: FloatArray, slip: FloatArray, imbalance: FloatArray) -> ContactState:
    """Linear response, at the status of a ``basis``, to imposed gaps (m,), slips (n,) and force imbalance
    (k,) without that on held motions."""
    p = basis.problem
    free = basis.undriven(p.rows * np.concatenate([gap, slip, imbalance]))
    return ContactState.unscaled(p, basis.status, *basis.solve(free, np.zeros(p.n)))


def residual(
    condensed: Condensed, state: ContactState, stress: float = 0.0, forces: FloatArray | float = 0.0
) -> float:
    """Largest residual of contact conditions, friction and balances, relative to peak pressure, elastic gap
    and forces. Eigenstresses remain when loads vanish: pressures are measured by at least their ``stress``,
    balances by the ``forces`` (k,) that it exerts on a section."""
    (factors, motion, pressure, traction), closed = state.unknowns, state.closed
    moved = float(np.abs(condensed.gap.motion @ motion).max(initial=0.0))
    largest_compliance = condensed.largest_compliance
    least = COARSE_ROUND_OFF * moved / largest_compliance if largest_compliance > 0.0 else 0.0
    least = max(least, stress)
    typical = max(float(np.abs(pressure).max(initial=0.0)), least) or 1.0
    m, n, balance = len(pressure), len(traction), condensed.balance
    elastic = max(condensed.elastic_gap(pressure), least * largest_compliance) or 1.0
    rows = condensed.unscaled_rows(factors) + condensed.blocks @ np.concatenate([pressure, traction, motion])
    gap, slip, imbalance = np.split(rows, [m, m + n])
    overlap = np.where(closed, np.abs(gap), -gap)
    limit = condensed.friction * pressure[condensed.friction_nodes]
    size = np.maximum(np.abs(pressure), least)
    force = forces + np.abs(balance.load @ factors) + np.abs(balance.pressure) @ size
    force += np.abs(balance.traction) @ (condensed.friction * size[condensed.friction_nodes])
    # Pressures are known to round-off of the largest: so are the forces on what is pressed little.
    slack = FEASIBLE * typical * np.abs(balance.pressure).sum(axis=1)
    # Gaps are known to round-off, and pressures to what it causes.
    length = condensed.gap_round_off
    round_off = length / largest_compliance if largest_compliance > 0.0 else 0.0
    parts = (
        (overlap.max(initial=0.0) - length) / elastic,
        (-pressure.min(initial=0.0) - round_off) / typical,
        (np.abs(slip - state.reference)[state.status.stuck].max(initial=0.0) - length) / elastic,
        ((np.abs(traction) - limit).max(initial=0.0) - round_off) / typical,
        0.0,
        ((np.abs(imbalance) - slack) / np.maximum(force, np.finfo(float).tiny)).max(initial=0.0),
    )
    return float(max(parts))


class UnbalancedError(NumericalError):
    """No contact pressure balances the loads."""


class NoStateError(UnbalancedError):
    """No contact status satisfies all conditions."""

    def __init__(self) -> None:
        super().__init__(
            "no contact state balances the loads",
            "bodies may slide or roll apart: raise friction, or fix them; a force-controlled platen may push "
            "its body away from the contact, or nothing resists its direction: prescribe that direction's "
            "displacement instead",
        )


class EndlessError(NumericalError):
    """The search ended without a state although pressures balance the loads, as may happen where the
    compliance is not positive definite."""

    def __init__(self) -> None:
        super().__init__(
            "no contact state has been found although pressures can balance the loads",
            "the clouds along the contact may be too coarse or too different; at high friction there may "
            "also be no continuous path",
        )


class SlidingError(NumericalError):
    """The contact slides as a whole and nothing else carries the load: the path ends here."""

    def __init__(self, fraction: float, where: str = "") -> None:
        super().__init__(
            f"the contact slides as a whole{where}",
            "prescribe the displacement instead of the force to continue",
        )
        self.fraction = fraction
