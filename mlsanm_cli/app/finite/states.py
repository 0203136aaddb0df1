"""States, steps and checkpoints of a path at finite strain, and checkpoints in run.h5."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any, TypeAlias

import numpy as np

from mlsanm_cli.app.finite.accuracy import Missing
from mlsanm_cli.app.finite.scene import FiniteScene
from mlsanm_cli.app.output.checkpoint import EarlierRun, as_text, flattened, restored, unreadable
from mlsanm_cli.arrays import BoolArray, FloatArray
from mlsanm_cli.contact.finite.exact import Pressed
from mlsanm_cli.contact.finite.sets import NodeSets
from mlsanm_cli.continuation import Branch
from mlsanm_cli.io.run_file import Value
from mlsanm_cli.io.run_reader import RunOrigin

Missed: TypeAlias = Callable[[], Missing]


@dataclass(frozen=True)
class FiniteState:
    """State of the path: position, load factors (L,), nodal displacement (2N,) of all bodies in order,
    residual; in contact also the converged solution ``pressed``, and with friction the accumulated slip (c,)
    and the dissipated work (c,) per length of the slave."""

    position: float
    factors: FloatArray
    displacement: FloatArray
    residual: float
    pressed: Pressed | None = None
    slip: FloatArray = field(default_factory=lambda: np.zeros(0))
    work: FloatArray = field(default_factory=lambda: np.zeros(0))

    @property
    def stability(self) -> float:
        """Relative stiffness of the contacts against pressures that alternate from node to node."""
        return np.inf if self.pressed is None else self.pressed.stability

    def shown(self, scene: FiniteScene) -> FloatArray:
        """Displacements (2N,) of all bodies, at the nodes of sides in contact those of the surfaces: clouds
        by themselves represent tractions that alternate from node to node wrongly."""
        found = self.displacement.copy()
        if self.pressed is not None:
            own = scene.parts(found)
            for side, here in scene.contacts.sides:
                own[side.body].reshape(-1, 2)[side.nodes] = self.pressed.surface[here].reshape(-1, 2)
        return found

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
    """A limit point of the load factor, a maximum or a minimum."""

    position: float
    maximum: bool


@dataclass(frozen=True)
class FiniteStep:
    """A finished step: the state at its end, the requested states within it in order (including its end),
    its counters, its limit points, and intermediate states ``way`` of a power series.

    ``renewed``: the equations were renewed at its end; ``checkpoint`` is that at its end; ``kept``, the
    work of contact tractions on the displacements that would remove the residuals which equations keep;
    ``missed`` computes what fits of the next degree would change.
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
    checkpoint: FiniteCheckpoint | None = None
    kept: float = 0.0
    way: tuple[FiniteState, ...] = ()
    missed: Missed | None = None


@dataclass(frozen=True)
class FiniteCheckpoint:
    """Checkpoint of a path: a ``state``; the ``base_state`` (2N,) of the equations of all
    bodies in order, and the factors ``acting`` (l,) of their loads there; ``pace``, the next increment with
    contact, the length of the last step of power series.

    Power series also store the ``stage`` and the load factor ``lam`` within it, the ``direction`` (2N + 1,)
    of the path, the requested ``levels`` left in the stage, and whether the equations are to be ``renewed``
    first; paths in contact, whether the equations of each body keep a residual (``keeps``).
    """

    state: FiniteState
    base_state: FloatArray
    acting: FloatArray
    pace: float
    stage: int = 0
    lam: float = 0.0
    direction: FloatArray = field(default_factory=lambda: np.zeros(0))
    levels: FloatArray = field(default_factory=lambda: np.zeros(0))
    renewed: bool = False
    keeps: BoolArray = field(default_factory=lambda: np.zeros(0, dtype=bool))

    @property
    def branch(self) -> Branch | None:
        """The direction as a linear branch, if there is one."""
        if not self.direction.size:
            return None
        x = np.stack([self.state.displacement, self.direction[:-1]])
        return Branch(x, np.array([self.lam, self.direction[-1]]), self.pace)


def renewals_of(steps: Sequence[FiniteStep]) -> tuple[FiniteState, ...]:
    """The states in which a path has renewed its equations, in order."""
    return tuple(
        before.state
        for before, after in pairwise(steps)
        if before.checkpoint
        and after.checkpoint
        and not np.array_equal(before.checkpoint.base_state, after.checkpoint.base_state)
    )


@dataclass(frozen=True)
class InterruptedFiniteRun(EarlierRun):
    """An interrupted run with its ``checkpoint``, None if the path had not begun."""

    checkpoint: FiniteCheckpoint | None


def plain_checkpoint(checkpoint: FiniteCheckpoint, figures: Mapping[str, Any]) -> dict[str, Value]:
    """The checkpoint as datasets."""
    return {**flattened("checkpoint/path", checkpoint), "checkpoint/figures": as_text(figures)}


def interrupted_run(origin: RunOrigin) -> InterruptedFiniteRun:
    """Read the checkpoint of a run. RunError if it is damaged or of another version."""
    stored = origin.checkpoint
    if not origin.rows:
        return InterruptedFiniteRun(0, origin.seconds, {}, None)
    try:
        figures = json.loads(stored["figures"])
        return InterruptedFiniteRun(origin.rows, origin.seconds, figures, _checkpoint(stored["path"]))
    except (KeyError, TypeError, ValueError) as error:
        raise unreadable(error) from error


def _checkpoint(stored: Mapping[str, Any]) -> FiniteCheckpoint:
    state, pressed = stored["state"], None
    if "pressed" in state:
        sets = restored(NodeSets, state["pressed"]["sets"])
        pressed = restored(Pressed, state["pressed"], sets=sets)
    return restored(FiniteCheckpoint, stored, state=restored(FiniteState, state, pressed=pressed))
