"""scikit-fem: quadratic triangles, mortar contact, SuperLU.

    python skfem_peer.py hertz|slip|history|patch MESH.npz OUT.csv [--levels N] [--sparse]

Two ways to solve: the compliance of the contact is condensed with one factorisation (default), or, as finite
elements commonly do, every iteration factorises the sparse saddle point problem (--sparse).
"""

from __future__ import annotations

import sys

import numpy as np
import scipy.sparse as sparse
from activeset import Answer, Solve, State, equilibrium, start
from mortar import Chain, Mortar, couple
from scenes import FRICTION, HALF_WIDTH, POISSON, RADIUS, YOUNG, path, write_profile
from scipy.sparse.linalg import splu
from skfem import Basis, ElementTriP2, ElementVector, MeshTri
from skfem.models.elasticity import lame_parameters, linear_elasticity

REACH = 1.25 * HALF_WIDTH
"""Slave vertices within this of the centre get a multiplier."""

ROUND_OFF = 1e-9


def chain(mesh: MeshTri, basis: Basis, facets: np.ndarray) -> Chain:
    """The facets ordered along x, with the displacement's degrees of freedom."""
    facets = facets[np.argsort(mesh.p[0, mesh.facets[:, facets]].mean(axis=0))]
    ends = mesh.facets[:, facets]
    swap = mesh.p[0, ends[0]] > mesh.p[0, ends[1]]
    ends = np.where(swap, ends[::-1], ends)
    dofs = np.stack([basis.nodal_dofs[:, ends[0]], basis.nodal_dofs[:, ends[1]], basis.facet_dofs[:, facets]])
    vertices = np.append(ends[0], ends[1, -1])
    return Chain(*mesh.p[:, vertices], dofs.transpose(0, 2, 1))


class Scene:
    """Stiffness and mortar matrices of one mesh, restricted to the free displacements."""

    def __init__(self, problem: str, path: str) -> None:
        with np.load(path) as arrays:
            upper, lower = arrays["upper_points"], arrays["lower_points"]
            triangles = np.vstack([arrays["upper_triangles"], arrays["lower_triangles"] + len(upper)])
        points = np.vstack([upper, lower])
        mesh = MeshTri(np.ascontiguousarray(points.T), np.ascontiguousarray(triangles.T))
        basis = Basis(mesh, ElementVector(ElementTriP2()), intorder=2)
        stiffness = linear_elasticity(*lame_parameters(YOUNG, POISSON)).assemble(basis)
        facets = mesh.boundary_facets()
        ends = mesh.facets[:, facets]
        x, y = mesh.p[:, ends]
        above, surface = ends[0] < len(upper), lower[:, 1].max()
        flat = facets[above & (y.min(axis=0) > upper[:, 1].max() - ROUND_OFF)]
        bottom = facets[~above & (y.max(axis=0) < lower[:, 1].min() + ROUND_OFF)]
        slave = above & (y.max(axis=0) < surface + 0.5 * REACH)
        master = ~above & (y.min(axis=0) > surface - ROUND_OFF)
        free = np.ones(basis.N, dtype=bool)
        free[basis.get_dofs(np.concatenate([flat, bottom])).all("u^2")] = False
        if problem == "patch":
            left = facets[x.max(axis=0) < ROUND_OFF]
            free[basis.get_dofs(left).all("u^1")] = False
        else:
            free[basis.get_dofs(np.concatenate([flat, bottom])).all("u^1")] = False
            slave &= np.abs(x).max(axis=0) <= REACH
            master &= np.abs(x).max(axis=0) < 3.0 * REACH
        chains = chain(mesh, basis, facets[slave]), chain(mesh, basis, facets[master])
        self.mortar: Mortar = couple(*chains, None if problem == "patch" else RADIUS, basis.N)
        self.stiffness = sparse.csc_matrix(stiffness[free][:, free])
        self.jump = self.mortar.jump[:, np.flatnonzero(free)]


class System:
    """The linear step both ways of solving share: which multipliers are unknown, and what must hold."""

    def __init__(self, scene: Scene, friction: float) -> None:
        self.scene, self.friction = scene, friction
        self.count = len(scene.mortar.x)
        self.axes = [0, 1] if friction else [1]
        zeros, weight = np.zeros(self.count), scene.mortar.weight
        platen = np.column_stack([np.concatenate([zeros, weight]), np.concatenate([weight, zeros])])
        self.platen = platen[:, self.axes]
        self.gap = np.concatenate([scene.mortar.gap, zeros])

    def unknowns(self, state: State) -> tuple[np.ndarray, sparse.csr_matrix]:
        """Unknown multipliers and the map (2m, unknowns) to all of them; where it slides traction follows."""
        closed = np.flatnonzero(state.closed)
        sticking = closed[state.sliding[closed] == 0] if self.friction else closed[:0]
        unknown = np.concatenate([closed, self.count + sticking])
        values = np.concatenate([np.ones(len(unknown)), self.friction * state.sliding[closed]])
        rows, columns = np.concatenate([unknown, self.count + closed]), np.arange(len(values))
        columns[len(unknown) :] -= len(unknown)
        return unknown, sparse.csr_matrix((values, (rows, columns)), shape=(2 * self.count, len(unknown)))

    def right_hand_side(self, state: State, unknown: np.ndarray, forces: tuple[float, float]) -> np.ndarray:
        wanted = np.concatenate([-self.scene.mortar.gap, state.slip])[unknown]
        return np.concatenate([wanted, np.array(forces)[self.axes]])

    def answer(self, multipliers: np.ndarray, jumps: np.ndarray) -> Answer:
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


def main(arguments: list[str]) -> None:
    problem, mesh, out = arguments[:3]
    method = sparse_steps if "--sparse" in arguments else condensed
    levels = int(arguments[arguments.index("--levels") + 1]) if "--levels" in arguments else 1
    friction = FRICTION if problem in ("slip", "history") else 0.0
    scene = Scene(problem, mesh)
    solve = method(scene, friction)
    x = scene.mortar.x
    state = start(np.full(len(x), True) if problem == "patch" else np.abs(x) < HALF_WIDTH)
    for forces in path(problem, levels):
        state = equilibrium(solve, state, forces, friction)
    write_profile(out, x, {"pressure": state.pressure, "traction": state.traction})


if __name__ == "__main__":
    main(sys.argv[1:])
