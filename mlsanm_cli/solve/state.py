"""States of the load path, and the steps between them. Positions count stages: 1.25 is a quarter of the way
through the second stage."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from mlsanm_cli.arrays import BoolArray, FloatArray
from mlsanm_cli.contact.laws.contact_status import ContactStatus
from mlsanm_cli.solve.condensed_scene import CondensedScene

UNLOADED = 1e-3
"""Part of earlier pressures and forces that unloading leaves: contacts are solved to a tolerance relative to
these, and regularised laws leave as much, on a few nodes. Smaller forces are not checked, residuals are
relative to pressures of at least this part, and contacts with less than this part of these lose them without
a warning of the jump."""


def _none() -> FloatArray:
    return np.zeros(0)


@dataclass(frozen=True)
class State:
    """State of the path: load factors (L,), pressures and gaps (m,), unknown motions (k,), and the status
    OPEN, STICK or SLIP of every node (m,); of contacts with friction tractions, slips and dissipated work per
    length of surface (n,). ``displacement`` (2N,) of all bodies if they are unknowns of the path, else empty.
    """

    position: float
    factors: FloatArray
    pressure: FloatArray
    gap: FloatArray
    motion: FloatArray
    status: NDArray[np.int8]
    residual: float = 0.0
    traction: FloatArray = field(default_factory=_none)
    slip: FloatArray = field(default_factory=_none)
    work: FloatArray = field(default_factory=_none)
    displacement: FloatArray = field(default_factory=_none)

    @property
    def closed(self) -> BoolArray:
        """Mask (m,) of closed nodes."""
        return np.asarray(self.status != 0)

    @property
    def unknowns(self) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        """Load factors, motions, pressures and tractions as arguments of linear maps."""
        return self.factors, self.motion, self.pressure, self.traction

    @property
    def is_finite(self) -> bool:
        """Whether all unknowns are finite."""
        return all(np.isfinite(values).all() for values in (*self.unknowns, self.gap))


@dataclass(frozen=True, eq=False)
class FrictionHistory:
    """History variables of friction: the stick and slip ``sets``, the slips (n,) of sticking nodes at rest
    without their elastic part, and for the regularised law the pressures (n,) at which friction begins."""

    sets: ContactStatus
    stick_reference: FloatArray
    threshold: FloatArray = field(default_factory=_none)


@dataclass(frozen=True, eq=False)
class Checkpoint:
    """State with the history of friction from which a path is continued.

    ``heading`` (size + 1,), of power series and Newton's method, is the direction of the last step in
    unknowns and load parameter per path parameter, and ``pace`` its length. ``steps`` is the number of rows
    so far, and saved levels up to ``told`` have rows of their own. ``armed`` (k,) are the stops of the case
    that have been off their limits before; the one numbered ``ended_by`` has ended the path. A continued path
    has the same states within the solver's tolerance.
    """

    state: State
    history: FrictionHistory | None = None
    heading: FloatArray = field(default_factory=_none)
    pace: float = 0.0
    steps: int = 0
    told: float = -1.0
    armed: BoolArray = field(default_factory=lambda: np.zeros(0, dtype=bool))
    ended_by: int = -1

    @property
    def position(self) -> float:
        """Position on the path."""
        return self.state.position

    @property
    def stage(self) -> int:
        """Current stage."""
        return int(self.position)

    @property
    def fraction(self) -> float:
        """Fraction of the current stage."""
        return self.position - self.stage


@dataclass(frozen=True)
class Polish:
    """Largest changes of pressures and tractions by polishing, over the largest exact pressure at the ends of
    stages; the number of dense systems; and the change ``overall`` in L2 norm."""

    pressure: float
    traction: float
    factorizations: int
    overall: float = 0.0


@dataclass(frozen=True)
class PathStep:
    """A finished step: the state at its end, the requested states within it (including its end), and its
    counters.

    ``series`` holds the arrays from which any state of the step can be evaluated (ANM only), ``order`` that
    of the series or 0; ``iterations`` are updates of the nonlinear solution; ``warning`` is a message for the
    user, ``polish`` the change by the exact laws at its end, ``checkpoint`` the one at its end.
    """

    state: State
    saved: tuple[State, ...]
    length: float = 0.0
    order: int = 0
    iterations: int = 0
    factorizations: int = 0
    solves: int = 0
    series: Mapping[str, FloatArray] = field(default_factory=dict)
    series_attributes: Mapping[str, float] = field(default_factory=dict)
    warning: str = ""
    polish: Polish | None = None
    checkpoint: Checkpoint | None = None


def output_positions(built: CondensedScene) -> tuple[float, ...]:
    """Positions with fields in order; the end of the path by default."""
    return tuple(sorted(set(built.case.output.at))) or (float(len(built.case.stage)),)


def stops(built: CondensedScene) -> list[float]:
    """The start, the ends of the stages and the requested positions, in order."""
    ends = np.arange(0.0, len(built.case.stage) + 1.0).tolist()
    return sorted({*ends, *output_positions(built)})
