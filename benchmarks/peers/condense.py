"""Contact in finite elements whose stiffness and mortar matrices are given, whichever program made them.

Two ways to solve: the compliance of the contact is condensed with one factorisation, or, as finite elements
commonly do, every iteration factorises the sparse saddle point problem.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sparse
from activeset import Answer, Solve, State
from numpy.typing import NDArray
from scenes import Array
from scipy.sparse.linalg import splu


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
