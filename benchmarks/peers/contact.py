"""Contact of finite elements with friction, whichever program made their matrices.

Mortar coupling of two straight chains of quadratic edges with piecewise linear multipliers at the slave's
vertices: with hat functions phi_i and the slave's arc length s, the weak gap and slip are
integral phi_i (u_slave - u_master) ds. Both chains run along x; the pieces between all their vertices are
integrated with three Gauss points each, which is exact for straight edges.

Signorini's and Coulomb's laws by a primal-dual active set: unknown are the nodal pressures p, tractions t,
and the motion d = (dx, dy) of a rigid platen that carries prescribed forces. The states decide which
equations a ``solve`` callable gets: the compliance of the contact is condensed with one factorisation, or, as
finite elements commonly do, every iteration factorises the sparse saddle point problem.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import scipy.sparse as sparse
from numpy.typing import NDArray
from scenes import Array
from scipy.sparse.linalg import splu

Bools = NDArray[np.bool_]

MAX_TRIALS = 300
PATIENCE = 25
CHATTER = 1e-7  # of the largest: with less tension, overlap, excess or slip a node stays as it is


@dataclass(frozen=True)
class State:
    """Per multiplier: ``closed``, ``sliding`` (0 sticks, else the sign of the traction), ``slip`` (m,)."""

    closed: Bools
    sliding: NDArray[np.int8]
    slip: Array
    pressure: Array
    traction: Array


@dataclass(frozen=True)
class Answer:
    """One linear step: ``pressure``, ``traction``, weak ``gap`` and ``slip`` (m,) each."""

    pressure: Array
    traction: Array
    gap: Array
    slip: Array


Solve = Callable[[State, tuple[float, float]], Answer]


def start(closed: Bools) -> State:
    """Nothing has slipped yet; all that is closed sticks."""
    zeros = np.zeros(len(closed))
    return State(closed, np.zeros(len(closed), np.int8), zeros, zeros, zeros)


def equilibrium(solve: Solve, state: State, forces: tuple[float, float], friction: float) -> State:
    """State under resultants (x, y) of the contact after ``state``; backward Euler for the slip."""
    step = state
    for trial in range(MAX_TRIALS):
        answer = solve(step, forces)
        tension, overlap = CHATTER * answer.pressure.max(), CHATTER * np.abs(answer.gap).max()
        closed = np.where(step.closed, answer.pressure > -tension, answer.gap < -overlap)
        sliding = step.sliding
        if friction:
            sliding = friction_states(step, answer, state.slip, friction)
            # What closes slides as it moves: stuck it could be torn open again, without end.
            sliding = np.where(closed & ~step.closed, -np.sign(answer.slip - state.slip), sliding)
            sliding = np.where(closed, sliding, 0).astype(np.int8)
        if np.array_equal(closed, step.closed) and np.array_equal(sliding, step.sliding):
            return replace(step, slip=answer.slip, pressure=answer.pressure, traction=answer.traction)
        if trial > PATIENCE:  # the set cycles: only the first change of all is made (Murty's least index)
            first = np.flatnonzero((closed != step.closed) | (sliding != step.sliding))[0]
            keep = np.arange(len(closed)) != first
            closed = np.where(keep, step.closed, closed)
            sliding = np.where(keep, step.sliding, sliding).astype(np.int8)
        step = replace(step, closed=closed, sliding=sliding)
    raise RuntimeError(f"the active set has not settled at platen forces {forces}")


def friction_states(step: State, answer: Answer, before: Array, friction: float) -> Array:
    """Sticking multipliers beyond the cone slide, sliding ones that went with their traction stick."""
    residual_vector = np.abs(answer.traction) - friction * np.maximum(answer.pressure, 0.0)
    breaks = (step.sliding == 0) & (residual_vector > CHATTER * friction * answer.pressure.max())
    turned = (answer.slip - before) * step.sliding > CHATTER * np.abs(answer.slip).max()
    return np.where(breaks, np.sign(answer.traction), np.where(turned, 0, step.sliding))


@dataclass(frozen=True)
class Scene:
    """What a mesh comes down to; m multipliers, n free displacements of bodies held at platen and floor.

    ``stiffness`` (n, n); ``jump`` (2m, n): weak gap in rows 0..m-1, weak slip in m..2m-1; of the multipliers
    the places ``x``, the integrals ``weight`` and the weak initial ``gap`` (m,).
    """

    stiffness: sparse.csc_matrix
    jump: sparse.csr_matrix
    x: Array
    weight: Array
    gap: Array


class System:
    """The linear step both ways of solving share: which multipliers are unknown, and what must hold."""

    def __init__(self, scene: Scene, friction: float) -> None:
        self.scene, self.friction = scene, friction
        self.count = len(scene.x)
        self.axes = [0, 1] if friction else [1]
        zeros, weight = np.zeros(self.count), scene.weight
        platen = np.column_stack([np.concatenate([zeros, weight]), np.concatenate([weight, zeros])])
        self.platen = platen[:, self.axes]
        self.gap = np.concatenate([scene.gap, zeros])

    def unknowns(self, state: State) -> tuple[NDArray[np.int64], sparse.csr_matrix]:
        """Unknown multipliers and the map (2m, unknowns) to all of them; where it slides traction follows."""
        closed = np.flatnonzero(state.closed)
        sticking = closed[state.sliding[closed] == 0] if self.friction else closed[:0]
        unknown = np.concatenate([closed, self.count + sticking])
        values = np.concatenate([np.ones(len(unknown)), self.friction * state.sliding[closed]])
        rows, columns = np.concatenate([unknown, self.count + closed]), np.arange(len(values))
        columns[len(unknown) :] -= len(unknown)
        return unknown, sparse.csr_matrix((values, (rows, columns)), shape=(2 * self.count, len(unknown)))

    def right_hand_side(self, state: State, unknown: NDArray[np.int64], forces: tuple[float, float]) -> Array:
        wanted = np.concatenate([-self.scene.gap, state.slip])[unknown]
        return np.concatenate([wanted, np.array(forces)[self.axes]])

    def answer(self, multipliers: Array, jumps: Array) -> Answer:
        gap, m = jumps + self.gap, self.count
        return Answer(multipliers[:m], multipliers[m:], gap[:m], gap[m:])


def condensed(scene: Scene, friction: float) -> Solve:
    """One factorisation; every iteration is a small dense system in multipliers and platen motion."""
    system = System(scene, friction)
    options = {"SymmetricMode": True}
    factor = splu(scene.stiffness, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options=options)
    compliance = np.zeros((2 * system.count, 2 * system.count))
    size = len(system.axes) * system.count
    jump = scene.jump[:size]
    compliance[:size, :size] = jump @ factor.solve(jump.T.toarray())

    def solve(state: State, forces: tuple[float, float]) -> Answer:
        unknown, spread = system.unknowns(state)
        spread = spread.toarray()
        size, platens = len(unknown), len(system.axes)
        matrix = np.zeros((size + platens, size + platens))
        matrix[:size, :size] = compliance[unknown] @ spread
        matrix[:size, size:] = system.platen[unknown]
        matrix[size:, :size] = system.platen.T @ spread
        solution = np.linalg.solve(matrix, system.right_hand_side(state, unknown, forces))
        multipliers = spread @ solution[:size]
        return system.answer(multipliers, compliance @ multipliers + system.platen @ solution[size:])

    return solve


def sparse_steps(scene: Scene, friction: float) -> Solve:
    """Every iteration factorises displacements, multipliers and platen motion together."""
    system = System(scene, friction)

    def solve(state: State, forces: tuple[float, float]) -> Answer:
        unknown, spread = system.unknowns(state)
        platen = sparse.csr_matrix(system.platen)
        blocks = [
            [scene.stiffness, -scene.jump.T @ spread, None],
            [scene.jump[unknown], None, platen[unknown]],
            [None, platen.T @ spread, None],
        ]
        matrix = sparse.csc_matrix(sparse.bmat(blocks))
        free, size = scene.stiffness.shape[0], len(unknown)
        right = np.concatenate([np.zeros(free), system.right_hand_side(state, unknown, forces)])
        factor = splu(matrix, permc_spec="COLAMD")
        solution = factor.solve(right)
        solution += factor.solve(right - matrix @ solution)
        multipliers = spread @ solution[free : free + size]
        return system.answer(
            multipliers, scene.jump @ solution[:free] + system.platen @ solution[free + size :]
        )

    return solve


Integers = NDArray[np.int64]


@dataclass(frozen=True)
class Chain:
    """``x``, ``y`` (n+1,) of the vertices, ascending in x; ``dofs`` (3, n, 2): ends and middle, x and y."""

    x: Array
    y: Array
    dofs: Integers


@dataclass(frozen=True)
class Mortar:
    """``jump`` (2m, dofs): rows 0..m-1 along y (normal), m..2m-1 along x; ``weight`` and ``gap`` (m,)."""

    x: Array
    jump: sparse.csr_matrix
    weight: Array
    gap: Array


def couple(slave: Chain, master: Chain, circle: float | None, dofs: int) -> Mortar:
    """Mortar matrices; ``circle`` is the radius the slave's gap is measured with, None for a flat slave."""
    inside = (master.x > slave.x[0]) & (master.x < slave.x[-1])
    breaks = np.unique(np.concatenate([slave.x, master.x[inside]]))
    breaks = breaks[np.concatenate([[True], np.diff(breaks) > 1e-12])]
    middle, half = 0.5 * (breaks[1:] + breaks[:-1]), 0.5 * np.diff(breaks)
    points, gauss = np.polynomial.legendre.leggauss(3)
    x = middle + half * points[:, None]
    on_slave = np.clip(np.searchsorted(slave.x, middle) - 1, 0, len(slave.x) - 2)
    on_master = np.clip(np.searchsorted(master.x, middle) - 1, 0, len(master.x) - 2)
    stretch = np.hypot(np.diff(slave.x), np.diff(slave.y)) / np.diff(slave.x)
    weights = half * gauss[:, None] * stretch[on_slave]

    s, m = local(slave, x, on_slave), local(master, x, on_master)
    hats = np.stack([1.0 - s, s])
    weighted = hats * weights
    rows = np.stack([on_slave, on_slave + 1])
    count = len(slave.x)
    blocks = []
    for axis in (1, 0):
        entries = [np.einsum("iqk,jqk->ijk", weighted, quadratic(s)).ravel()]
        entries.append(-np.einsum("iqk,jqk->ijk", weighted, quadratic(m)).ravel())
        row = np.broadcast_to(rows[:, None], (2, 3, len(middle))).ravel()
        columns = [
            np.broadcast_to(chain.dofs[None, :, piece, axis], (2, 3, len(middle))).ravel()
            for chain, piece in ((slave, on_slave), (master, on_master))
        ]
        where = (np.concatenate([row, row]), np.concatenate(columns))
        blocks.append(sparse.csr_matrix((np.concatenate(entries), where), shape=(count, dofs)))
    gap = np.zeros_like(x) if circle is None else circle - np.sqrt(circle**2 - x**2)
    return Mortar(
        x=slave.x,
        jump=sparse.csr_matrix(sparse.vstack(blocks)),
        weight=np.bincount(rows.ravel(), weighted.sum(axis=1).ravel(), count),
        gap=np.bincount(rows.ravel(), np.einsum("iqk,qk->ik", weighted, gap).ravel(), count),
    )


def local(chain: Chain, x: Array, piece: Integers) -> Array:
    """Coordinate 0 to 1 of x on its edge."""
    return (x - chain.x[piece]) / np.diff(chain.x)[piece]


def quadratic(t: Array) -> Array:
    """Shape functions of a quadratic edge: two ends and the middle."""
    return np.stack([(1.0 - t) * (1.0 - 2.0 * t), t * (2.0 * t - 1.0), 4.0 * t * (1.0 - t)])
