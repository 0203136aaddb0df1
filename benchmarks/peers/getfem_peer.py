"""GetFEM: quadratic triangles, augmented Lagrangian contact and friction, Newton with MUMPS.

    python3 getfem_peer.py hertz|slip|history|patch MESH OUT.csv [--levels N] [--condensed]

MESH is an .npz file or a name in meshes.py. The contact law of Alart and Curnier is written in GetFEM's
assembly language, in small sliding: a point of the arc faces the block's point below it. Pressure and
traction are linear along the arc. Started, as scikit-fem is, from the known contact: Hertz's pressure.
--condensed takes matrices only from GetFEM, and the active set on a condensed compliance that scikit-fem has.
Runs on the interpreter GetFEM is installed for, commonly the system's.
"""

from __future__ import annotations

import sys

import getfem
import numpy as np
from meshes import Mesh, load
from scenes import FORCE, FRICTION, HALF_WIDTH, POISSON, RADIUS, YOUNG, Array, path, write_profile

REACH = 1.25 * HALF_WIDTH
"""Faces of the arc within this of the centre may touch."""
AUGMENTATION = 1e5, 1e7
"""Pressure per gap of the augmented Lagrangian, without and with friction: the powers of ten that needed the
fewest iterations, up to half as many as others."""
TOLERANCE = 1e-9
"""Of the residual; with 1e-7 Newton ended at errors of some per cent."""
RULE = "IM_STRUCTURED_COMPOSITE(IM_TRIANGLE(4),2)"
"""In the contact: elements do not match, and fewer points cost accuracy on fine meshes, more bring none."""

ROUND_OFF = 1e-9
SLAVE, HELD, SIDE = 1, 2, 3


def region(mesh: getfem.Mesh, number: int, points: Array) -> None:
    """The region of outer faces all of whose points are in the mask."""
    mesh.set_region(number, mesh.faces_from_pid(np.flatnonzero(points)))
    mesh.set_region(99, mesh.outer_faces())
    mesh.region_intersect(number, 99)


def meshes_of(arrays: Mesh, patch: bool) -> list[getfem.Mesh]:
    """Upper and lower body with their regions."""
    bodies = [
        getfem.Mesh("pt2D", arrays[f"{name}_points"].T.copy(), arrays[f"{name}_triangles"].T.copy())
        for name in ("upper", "lower")
    ]
    (x, y), (below_x, below_y) = bodies[0].pts(), bodies[1].pts()
    surface = below_y.max()
    region(bodies[0], SLAVE, y < surface + ROUND_OFF if patch else (y < 0.5 * REACH) & (np.abs(x) <= REACH))
    region(bodies[0], HELD, y > y.max() - ROUND_OFF)
    region(bodies[1], HELD, below_y < below_y.min() + ROUND_OFF)
    if patch:
        for mesh, at in zip(bodies, (x, below_x), strict=True):
            region(mesh, SIDE, at < ROUND_OFF)
    return bodies


def elasticity(model: getfem.Model, bodies: list[getfem.Mesh], patch: bool) -> None:
    """Displacements u1 and u2, their supports, and the platen's motion d, which is added to u1."""
    model.add_initialized_data("lame", YOUNG * POISSON / (1.0 + POISSON) / (1.0 - 2.0 * POISSON))
    model.add_initialized_data("shear", YOUNG / 2.0 / (1.0 + POISSON))
    for name, mesh in zip(("u1", "u2"), bodies, strict=True):
        space = getfem.MeshFem(mesh, 2)
        space.set_fem(getfem.Fem("FEM_PK(2,2)"))
        rule = getfem.MeshIm(mesh, getfem.Integ("IM_TRIANGLE(2)"))
        model.add_fem_variable(name, space)
        model.add_isotropic_linearized_elasticity_brick(rule, name, "lame", "shear")
        if patch:
            for side in (HELD, SIDE):
                model.add_normal_Dirichlet_condition_with_multipliers(rule, name, 2, side)
        else:
            model.add_Dirichlet_condition_with_simplification(name, HELD)
    model.add_variable("d", 2)


def interface(model: getfem.Model, bodies: list[getfem.Mesh], patch: bool) -> tuple[getfem.MeshIm, Array]:
    """Multipliers p (pressure) and q (traction), the map to the block's surface; rule and x of the nodes."""
    space = getfem.MeshFem(bodies[0], 1)
    space.set_fem(getfem.Fem("FEM_PK(2,1)"))
    for name in ("p", "q"):
        model.add_filtered_fem_variable(name, space, SLAVE)
    model.add_interpolate_transformation_from_expression("below", *bodies, f"[X(1);{1 if patch else 0}]")
    rule = getfem.MeshIm(bodies[0], getfem.Integ(RULE))
    return rule, space.basic_dof_nodes()[0, space.basic_dof_on_region(SLAVE)]


def distance(patch: bool) -> str:
    """Initial gap, in GetFEM's assembly language."""
    return "0" if patch else f"(X(1)*X(1)/({RADIUS}+sqrt({RADIUS**2}-X(1)*X(1))))"


def jump(u: str, axis: int, platen: str) -> str:
    """How far the arc has moved away from the block along an axis."""
    return f"({u}1({axis})+{platen}({axis})-Interpolate({u}2,below)({axis}))"


def law(model: getfem.Model, patch: bool, friction: float) -> str:
    """Weak form of Signorini's and Coulomb's laws; backward Euler for the slip."""
    gap = f"({distance(patch)}+{jump('u', 2, 'd')})"
    text = f"-p*{jump('Test_u', 2, 'Test_d')}-(1/r)*(p-pos_part(p-r*{gap}))*Test_p"
    model.add_initialized_data("r", AUGMENTATION[friction > 0.0])
    if not friction:
        return text
    model.add_initialized_data("cone", friction)
    for name in ("u1", "u2"):
        model.add_fem_data(f"before_{name}", model.mesh_fem_of_variable(name))
    model.add_data("before_d", 2)
    slip = f"({jump('u', 1, 'd')}-{jump('before_u', 1, 'before_d')})"
    limit = f"cone*pos_part(p-r*{gap})"
    text += f"-q*{jump('Test_u', 1, 'Test_d')}"
    return text + f"-(1/r)*(q-max(-{limit},min({limit},q-r*{slip})))*Test_q"


def newton(problem: str, arrays: Mesh, levels: int) -> tuple[Array, Array, Array]:
    """x, pressure and traction after all levels, each solved by GetFEM's Newton."""
    patch, friction = problem == "patch", FRICTION if problem in ("slip", "history") else 0.0
    bodies = meshes_of(arrays, patch)
    model = getfem.Model("real")
    elasticity(model, bodies, patch)
    rule, x = interface(model, bodies, patch)
    model.add_nonlinear_term(rule, law(model, patch, friction), SLAVE)
    if not friction:  # nothing acts sideways
        model.disable_variable("q")
        model.add_linear_term(rule, "d(1)*Test_d(1)", SLAVE)
    platen = model.add_explicit_rhs("d", [0.0, 0.0])
    peak = 2.0 * FORCE / (np.pi * HALF_WIDTH)
    known = np.ones(len(x)) if patch else peak * np.sqrt(np.maximum(1.0 - (x / HALF_WIDTH) ** 2, 0.0))
    model.set_variable("p", known)
    for forces in path(problem, levels):
        model.set_private_rhs(platen, -np.array(forces))
        _, converged = model.solve(
            "max_res", TOLERANCE, "max_iter", 100, "lsolver", "mumps", "lsearch", "simplest"
        )
        if not converged:
            sys.exit(f"Newton has not converged at platen forces {forces}")
        if friction:
            for name in ("u1", "u2", "d"):
                model.set_variable(f"before_{name}", model.variable(name))
    # The pressure swings below zero next to the end of the contact.
    return x, np.maximum(model.variable("p"), 0.0), model.variable("q")


def on_compliance(problem: str, arrays: Mesh, levels: int) -> tuple[Array, Array, Array]:
    """x, pressure and traction after all levels, by an active set on GetFEM's matrices."""
    import scipy.sparse as sparse
    from contact import Scene, condensed, equilibrium, start

    friction = FRICTION if problem in ("slip", "history") else 0.0
    bodies = meshes_of(arrays, patch=False)
    model = getfem.Model("real")
    elasticity(model, bodies, patch=False)
    rule, x = interface(model, bodies, patch=False)
    for multiplier, axis in (("p", 2), ("q", 1)):
        model.add_linear_term(rule, f"{multiplier}*{jump('u', axis, 'd')}", SLAVE)
    model.add_source_term(rule, f"{distance(False)}*Test_p", SLAVE)
    model.assembly()
    tangent = model.tangent_matrix()
    starts, rows = tangent.csc_ind()
    matrix = sparse.csc_matrix((tangent.csc_val(), rows, starts), shape=tangent.size())
    part = {}
    for name in ("u1", "u2", "p", "q", "d"):
        first, size = model.interval_of_variable(name)
        part[name] = np.arange(first, first + size)
    u, multipliers = np.concatenate([part["u1"], part["u2"]]), np.concatenate([part["p"], part["q"]])
    scene = Scene(
        stiffness=matrix[u][:, u],
        jump=sparse.csr_matrix(matrix[multipliers][:, u]),
        x=x,
        weight=matrix[part["p"]][:, part["d"][1]].toarray()[:, 0],
        gap=model.rhs()[part["p"]],
    )
    solve, state = condensed(scene, friction), start(np.abs(x) < HALF_WIDTH)
    for forces in path(problem, levels):
        state = equilibrium(solve, state, forces, friction)
    return x, state.pressure, state.traction


def main(arguments: list[str]) -> None:
    problem, source, out = arguments[:3]
    levels = int(arguments[arguments.index("--levels") + 1]) if "--levels" in arguments else 1
    getfem.util_trace_level(1)
    way = on_compliance if "--condensed" in arguments else newton
    x, pressure, traction = way(problem, load(source), levels)
    order = np.argsort(x)
    write_profile(out, x[order], {"pressure": pressure[order], "traction": traction[order]})


if __name__ == "__main__":
    main(sys.argv[1:])
