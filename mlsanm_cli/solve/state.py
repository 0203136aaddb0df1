"""States of the load path, and the steps between them. Positions count stages: 1.25 is a quarter of the way
through the second stage."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import field
from types import MappingProxyType
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from mlsanm_cli.arrays import BoolArray, FloatArray, IntArray
from mlsanm_cli.contact.complementarity.problem import OPEN, STICK, ContactStatus
from mlsanm_cli.contact.laws.contact_state import ContactState
from mlsanm_cli.records import dataclass

UNLOADED = 1e-3
"""Part of earlier pressures and forces that unloading leaves, in regularised laws on a few nodes. Smaller
forces are not checked, residuals are relative to pressures of at least this part, and contacts with less lose
them without a warning of the jump."""
INSTABILITY_RATIO = 0.8
"""Ratio of the moments neglected by small displacements to those that turn a body above which it is
unstable."""

Fields: TypeAlias = Mapping[str, FloatArray]
"""Fields of a body in a state by name: ``displacement`` (n, 2), ``stress`` (n, 3), ``stress_zz`` and
``von_mises`` (n,), ``strain`` (n, 3) as xx, yy, xy including thermal strain; ``rest`` (N, 2), the
displacement of its elastic system, and ``near`` (n, 3), the stress of the near fields of contacts."""
NOTHING: Mapping[str, Any] = MappingProxyType({})


def _none() -> FloatArray:
    return np.zeros(0)


@dataclass(frozen=True, eq=False)
class State:
    """State of the path: load factors (L,) and residual; at the contact nodes pressures and gaps (m,) and the
    status OPEN, STICK or SLIP (m,); on contacts with friction tractions, slips and dissipated work per length
    of surface (n,), at finite strain on all nodes; unknown rigid motions (k,). ``displacement`` (2N,) of all
    bodies if they are unknowns of the path. ``solver`` are further arrays of the solution method by name."""

    position: float
    factors: FloatArray
    pressure: FloatArray = field(default_factory=_none)
    gap: FloatArray = field(default_factory=_none)
    motion: FloatArray = field(default_factory=_none)
    status: NDArray[np.int8] = field(default_factory=lambda: np.zeros(0, dtype=np.int8))
    residual: float = 0.0
    traction: FloatArray = field(default_factory=_none)
    slip: FloatArray = field(default_factory=_none)
    work: FloatArray = field(default_factory=_none)
    displacement: FloatArray = field(default_factory=_none)
    solver: Mapping[str, FloatArray] = field(default_factory=dict)

    @classmethod
    def of(
        cls,
        contacts: ContactState,
        nodes: IntArray,
        position: float,
        residual: float = 0.0,
        solver: Mapping[str, FloatArray] = NOTHING,
    ) -> State:
        """The state with ``contacts`` with friction at ``nodes`` (n,)."""
        c = contacts
        values = c.pressure, c.gap, c.motion, c.status.status(nodes), residual, c.traction, c.slip, c.work
        return cls(position, c.factors, *values, solver=solver)

    def contacts(self, nodes: IntArray) -> ContactState:
        """The contacts with friction at ``nodes`` (n,)."""
        stuck = self.status[nodes] == STICK
        status = ContactStatus.with_tractions(self.closed, stuck, self.traction, nodes)
        values = self.pressure, self.traction, self.motion, self.gap, self.slip, status, self.factors
        return ContactState(*values, self.slip, self.work)

    @property
    def closed(self) -> BoolArray:
        """Mask (m,) of closed nodes."""
        return np.asarray(self.status != OPEN)

    @property
    def unknowns(self) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        """Load factors, motions, pressures and tractions as arguments of linear maps."""
        return self.factors, self.motion, self.pressure, self.traction

    @property
    def driven(self) -> FloatArray:
        """Load factors and unknown motions (L + k,)."""
        return np.append(self.factors, self.motion)

    @property
    def side_traction(self) -> FloatArray:
        """Nominal tractions (2s,) at the nodes of both sides of all contacts; finite strain only."""
        return self.solver.get("side_traction", _none())

    def history(self, body: str) -> FloatArray:
        """Plastic strain xx, yy, zz, 2 xy and its accumulated amount (n, 5) of a body that flows."""
        return self.solver[f"history.{body}"]

    @property
    def is_finite(self) -> bool:
        return all(np.isfinite(values).all() for values in (*self.unknowns, self.gap))


@dataclass(frozen=True, eq=False)
class Checkpoint:
    """State from which a path is continued, to the same states within the solver's tolerance. ``heading``
    (size + 1,) is the direction of the last step of power series and Newton's method in unknowns and load
    parameter, and ``pace`` its length, or that of the next increment. ``steps`` counts rows. ``armed`` (k,)
    are the stops that have been off their limits; the one numbered ``ended_by`` has ended the path.
    ``history`` are further arrays by name."""

    state: State
    history: Mapping[str, Any] = field(default_factory=dict)
    heading: FloatArray = field(default_factory=_none)
    pace: float = 0.0
    steps: int = 0
    armed: BoolArray = field(default_factory=lambda: np.zeros(0, dtype=bool))
    ended_by: int = -1

    @property
    def position(self) -> float:
        return self.state.position

    @property
    def stage(self) -> int:
        return int(self.position)

    @property
    def fraction(self) -> float:
        """Part of the current stage."""
        return self.position - self.stage


@dataclass(frozen=True, eq=False)
class Bifurcation:
    """A loss of stability at a ``position`` that is no limit point, with the ``motion`` (2N,) in which the
    branches differ, whether a stable branch is ``followed``, and whether a deflection before ``decided`` on
    its side."""

    position: float
    motion: FloatArray
    followed: bool
    decided: bool


@dataclass(frozen=True)
class PathStep:
    """A finished step: the state at its end, the requested states within it (including its end), its counts,
    and the checkpoint at its end. ``series`` holds the arrays from which any state of the step can be
    evaluated (ANM only), ``order`` that of the series or 0; ``iterations`` are updates of the nonlinear
    solution; ``warning`` is for the user. ``limit_points`` of the load factor are positions, and whether
    these are maxima.

    At finite strain: ``bifurcations``; whether the equations were ``renewed`` at its end; the work ``kept``
    of contact tractions on the displacements that would remove the residuals which equations keep;
    intermediate states ``way`` of a power series; ``missed`` computes what fits of the next degree would
    change."""

    state: State
    saved: tuple[State, ...] = ()
    length: float = 0.0
    order: int = 0
    iterations: int = 0
    factorizations: int = 0
    solves: int = 0
    series: Mapping[str, FloatArray] = field(default_factory=dict)
    series_attributes: Mapping[str, float] = field(default_factory=dict)
    warning: str = ""
    checkpoint: Checkpoint | None = None
    limit_points: tuple[tuple[float, bool], ...] = ()
    bifurcations: tuple[Bifurcation, ...] = ()
    renewed: bool = False
    kept: float = 0.0
    way: tuple[State, ...] = ()
    missed: Callable[[], Any] | None = None
