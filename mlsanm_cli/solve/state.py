"""States of the load path, and the steps between them.

Positions count stages: 1.25 is a quarter of the way through the second stage.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from mlsanm_cli.arrays import BoolArray, FloatArray
from mlsanm_cli.contact.laws.contact_status import ContactStatus
from mlsanm_cli.solve.condensed_scene import CondensedScene


@dataclass(frozen=True)
class State:
    """One state: load factors (L,), pressures and gaps (m,), unknown motions (k,), and of every node what it
    does (m,): OPEN, STICK or SLIP. Of the contacts with friction tractions, slips and the work dissipated per
    length of surface so far (n,). ``displacement`` (2N,) has the unknowns of all bodies if the path has them,
    else nothing."""

    position: float
    factors: FloatArray
    pressure: FloatArray
    gap: FloatArray
    motion: FloatArray
    traction: FloatArray
    slip: FloatArray
    work: FloatArray
    status: NDArray[np.int8]
    residual: float
    displacement: FloatArray = field(default_factory=lambda: np.zeros(0))

    @property
    def closed(self) -> BoolArray:
        """Which nodes (m,) are closed."""
        return np.asarray(self.status != 0)

    @property
    def unknowns(self) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        """Load factors, motions, pressures and tractions, as linear maps take them."""
        return self.factors, self.motion, self.pressure, self.traction

    @property
    def is_finite(self) -> bool:
        """Whether all its unknowns are numbers."""
        return all(np.isfinite(values).all() for values in (*self.unknowns, self.gap))


@dataclass(frozen=True, eq=False)
class FrictionHistory:
    """What friction remembers: the ``sets`` of nodes that stick and slip, the slips (n,) at which sticking
    nodes rest, less their asperities' give, and of the smooth law the pressures (n,) from which friction
    acts."""

    sets: ContactStatus
    stick_reference: FloatArray
    threshold: FloatArray = field(default_factory=lambda: np.zeros(0))


@dataclass(frozen=True, eq=False)
class Checkpoint:
    """What a path continues from: a state, and how friction came there.

    ``heading`` (size + 1,), of power series and Newton's method, is the way in unknowns and load parameter
    that the last step set out on, per its parameter, which went as far as ``pace``. ``steps`` rows of the
    path are behind it, and saved levels up to ``told`` have rows of their own. Of the case's stops ``armed``
    (k,) are those that have been out of reach before; the one numbered ``ended_by`` has ended the path.
    The path continues to the same states within the solver's tolerance.
    """

    state: State
    history: FrictionHistory | None = None
    heading: FloatArray = field(default_factory=lambda: np.zeros(0))
    pace: float = 0.0
    steps: int = 0
    told: float = -1.0
    armed: BoolArray = field(default_factory=lambda: np.zeros(0, dtype=bool))
    ended_by: int = -1

    @property
    def position(self) -> float:
        """Where on the path it is."""
        return self.state.position

    @property
    def stage(self) -> int:
        """The stage in progress."""
        return int(self.position)

    @property
    def fraction(self) -> float:
        """How much of that stage is behind."""
        return self.position - self.stage


@dataclass(frozen=True)
class Polish:
    """What polishing a state with the exact laws changed of pressures and tractions, at most, over the
    largest exact pressure at the ends of the stages; the dense systems it took; and the change ``overall``,
    as a norm."""

    pressure: float
    traction: float
    factorizations: int
    overall: float = 0.0


@dataclass(frozen=True)
class PathStep:
    """A finished step: the state at its end, the wanted states in it (its end included), what it cost.

    ``series`` holds the arrays from which any state of the step can be had again (ANM only), ``order`` is the
    series' and 0 without one; ``iterations`` are updates of the nonlinear solution; ``warning`` is what the
    user should know about the step, ``polish`` what the exact laws changed at its end; ``checkpoint`` is what
    the path continues from behind this step.
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
    """Where fields are asked for, in order; the end of the path where nothing is said."""
    return tuple(sorted(set(built.case.output.at))) or (float(len(built.case.stage)),)


def stops(built: CondensedScene) -> list[float]:
    """The start, the stages' ends and the wanted positions, in order."""
    ends = np.arange(0.0, len(built.case.stage) + 1.0).tolist()
    return sorted({*ends, *output_positions(built)})
