"""scikit-fem: quadratic triangles, mortar contact, SuperLU.

    python skfem_peer.py hertz|slip|history|patch MESH OUT.csv [--levels N] [--sparse]

MESH is an .npz file or a name in meshes.py. The compliance of the contact is condensed with one
factorisation, or (--sparse) every iteration factorises the sparse saddle point problem.
"""

from __future__ import annotations

import sys

import numpy as np
import scipy.sparse as sparse
from contact import Chain, Scene, condensed, couple, equilibrium, sparse_steps, start
from meshes import Mesh, load
from numpy.typing import NDArray
from scenes import FRICTION, HALF_WIDTH, POISSON, RADIUS, YOUNG, path, write_profile
from skfem import Basis, ElementTriP2, ElementVector, MeshTri
from skfem.models.elasticity import lame_parameters, linear_elasticity

REACH = 1.25 * HALF_WIDTH
"""Slave vertices within this of the centre get a multiplier."""

ROUND_OFF = 1e-9


def chain(mesh: MeshTri, basis: Basis, facets: NDArray[np.int64]) -> Chain:
    """The facets ordered along x, with the displacement's degrees of freedom."""
    facets = facets[np.argsort(mesh.p[0, mesh.facets[:, facets]].mean(axis=0))]
    ends = mesh.facets[:, facets]
    swap = mesh.p[0, ends[0]] > mesh.p[0, ends[1]]
    ends = np.where(swap, ends[::-1], ends)
    dofs = np.stack([basis.nodal_dofs[:, ends[0]], basis.nodal_dofs[:, ends[1]], basis.facet_dofs[:, facets]])
    vertices = np.append(ends[0], ends[1, -1])
    return Chain(*mesh.p[:, vertices], dofs.transpose(0, 2, 1))


def assemble(problem: str, arrays: Mesh) -> Scene:
    """Stiffness and mortar matrices of one mesh, restricted to the free displacements."""
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
    mortar = couple(*chains, None if problem == "patch" else RADIUS, basis.N)
    stiffness, jump = sparse.csc_matrix(stiffness[free][:, free]), mortar.jump[:, np.flatnonzero(free)]
    return Scene(stiffness, jump, mortar.x, mortar.weight, mortar.gap)


def main(arguments: list[str]) -> None:
    problem, source, out = arguments[:3]
    method = sparse_steps if "--sparse" in arguments else condensed
    levels = int(arguments[arguments.index("--levels") + 1]) if "--levels" in arguments else 1
    friction = FRICTION if problem in ("slip", "history") else 0.0
    scene = assemble(problem, load(source))
    solve = method(scene, friction)
    state = start(np.full(len(scene.x), True) if problem == "patch" else np.abs(scene.x) < HALF_WIDTH)
    for forces in path(problem, levels):
        state = equilibrium(solve, state, forces, friction)
    write_profile(out, scene.x, {"pressure": state.pressure, "traction": state.traction})


if __name__ == "__main__":
    main(sys.argv[1:])
