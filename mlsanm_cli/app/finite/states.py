"""States of a path at finite strain, the steps between them, and what a path continues from."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np

from mlsanm_cli.app.finite.scene import FiniteScene
from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.contact.finite.exact import Pressed
from mlsanm_cli.continuation import Branch


@dataclass(frozen=True)
class FiniteState:
    """One state of the path: position, load factors (L,), nodal displacement (2N,) of all bodies in turn,
    residual; in contact also ``pressed``, what Newton's method found there, and of friction the slips (c,) so
    far and the work (c,) per length of the slave that it has dissipated."""

    position: float
    factors: FloatArray
    displacement: FloatArray
    residual: float
    pressed: Pressed | None = None
    slip: FloatArray = field(default_factory=lambda: np.zeros(0))
    work: FloatArray = field(default_factory=lambda: np.zeros(0))

    @property
    def stability(self) -> float:
        """How well the contacts resist pressures that change from node to node."""
        return np.inf if self.pressed is None else self.pressed.stability

    def shown(self, scene: FiniteScene) -> FloatArray:
        """The displacements (2N,) by which bodies are shown."""
        return scene.shown(self.displacement, self.pressed.surface) if self.pressed else self.displacement

    @property
    def whole(self) -> FloatArray:
        """Load factors and free motions (L + d,)."""
        return self.factors if self.pressed is None else np.append(self.factors, self.pressed.free)

    @property
    def traction(self) -> FloatArray:
        """Nominal tractions (2s,) at the nodes of all sides in contact."""
        return np.zeros(0) if self.pressed is None else self.pressed.traction


@dataclass(frozen=True)
class Turn:
    """A limit point: where the load factors turn back, and whether it is a maximum of them."""

    position: float
    maximum: bool


@dataclass(frozen=True)
class FiniteStep:
    """A finished step: the state at its end, wanted states in it as they follow each other (its end may be
    one), what it cost, limit points in it, and states on the ``way`` of a power series.

    ``renewed`` means that the equations were renewed at its end; ``mark`` is what the path continues from.
    """

    state: FiniteState
    saved: tuple[FiniteState, ...] = ()
    length: float = 0.0
    order: int = 0
    iterations: int = 0
    factorizations: int = 0
    solves: int = 0
    turns: tuple[Turn, ...] = ()
    renewed: bool = False
    mark: FiniteMark | None = None
    way: tuple[FiniteState, ...] = ()


@dataclass(frozen=True)
class FiniteMark:
    """What a path continues from: a ``state``; the ``station`` (2N,) of the equations of all bodies in turn,
    and ``acting`` (l,), the factors of the bodies' loads there, in turn; the ``pace``, of contacts the next
    increment, of power series the length of the last step.

    Power series also know the ``stage`` and the part ``lam`` of it, the ``direction`` (2N + 1,) of the path,
    ``levels`` of the stage still to come, and whether equations are to be ``renewed`` first.
    """

    state: FiniteState
    station: FloatArray
    acting: FloatArray
    pace: float
    stage: int = 0
    lam: float = 0.0
    direction: FloatArray = field(default_factory=lambda: np.zeros(0))
    levels: FloatArray = field(default_factory=lambda: np.zeros(0))
    renewed: bool = False

    @property
    def branch(self) -> Branch | None:
        """The direction as a straight piece of path, if there is any."""
        if not self.direction.size:
            return None
        x = np.stack([self.state.displacement, self.direction[:-1]])
        return Branch(x, np.array([self.lam, self.direction[-1]]), self.pace)


def renewals_of(steps: Sequence[FiniteStep]) -> tuple[FiniteState, ...]:
    """The states in which a path has renewed its equations, in their order."""
    return tuple(
        before.state
        for before, after in pairwise(steps)
        if before.mark and after.mark and not np.array_equal(before.mark.station, after.mark.station)
    )
