"""Fields of the bodies in states of the path."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TypeAlias

import numpy as np
import scipy.sparse as sparse

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.mechanics.elasticity import von_mises
from mlsanm_cli.mechanics.laws.von_mises import ZZ, VonMises, plastic_stress
from mlsanm_cli.mechanics.material import PlaneMaterial
from mlsanm_cli.solve.condensed_scene import CondensedScene
from mlsanm_cli.solve.state import NOTHING, Fields, State

MAX_STATES = 4
"""States solved for together: twice the work of one; more would only take more memory."""


def fields_of(
    built: CondensedScene, states: Sequence[State], stress: bool, starts: Mapping[str, FloatArray] = NOTHING
) -> list[tuple[dict[str, Fields], float]]:
    """Fields of all bodies in each state, stresses only if requested, and the largest relative error of the
    linear solutions. States are solved together. ``starts`` are approximate solutions (2N, 1) by body."""
    found: list[tuple[dict[str, Fields], float]] = []
    for first in range(0, len(states), MAX_STATES):
        some = states[first : first + MAX_STATES]
        bodies = {name: _displacements(built, name, some, starts.get(name)) for name in built.scene.bodies}
        for number, state in enumerate(some):
            # Unlike the built-in max, np.max propagates nan.
            worst = float(np.max([worth[number] for _, worth in bodies.values()]))
            fields = {
                name: _fields(built, name, state, displacements[number], stress)
                for name, (displacements, _) in bodies.items()
            }
            found.append((fields, worst))
    return found


def _fields(built: CondensedScene, name: str, state: State, displacement: FloatArray, stress: bool) -> Fields:
    """Fields of a body from the ``displacement`` (n, 2) of its elastic system."""
    model = built.scene.bodies[name].model
    moved, stressed = built.condensed.contact_fields(built.scene, name, state.unknowns)
    none, flow = np.zeros((0, len(model.material.stiffness))), flow_of(built, name, state)
    sigma, degrees, near = none, np.zeros(0), none
    if stress:
        degrees = built.scene.degrees(name, state.factors)
        near = stressed
        sigma = model.stress(displacement) + near
        sigma = sigma - degrees[:, None] * model.material.stress_of_expansion
    whole = displacement + moved
    return {**named_fields(model.material, whole, sigma, degrees, flow), "rest": displacement, "near": near}


FlowState: TypeAlias = tuple[VonMises, FloatArray]
"""A law with histories (n, 5) of points."""


def flow_of(
    built: CondensedScene, body: str, state: State, at: sparse.csr_array | None = None
) -> FlowState | None:
    """The law and the histories of a body that flows, at its nodes or by values of a nodal field ``at``
    points; None of an elastic one."""
    if body not in built.laws:
        return None
    history = state.history(body)
    return built.laws[body], history if at is None else at @ history


def named_fields(
    material: PlaneMaterial,
    displacement: FloatArray,
    stress: FloatArray,
    degrees: FloatArray,
    flow: FlowState | None = None,
) -> dict[str, FloatArray]:
    """Fields at n points from displacement (n, 2), stress (n, 3 | 4) and temperature (n,), or no stress. The
    stress of bodies that flow is that of their whole strain."""
    if flow is not None and len(stress):
        return _flowing_fields(*flow, displacement, stress, degrees)
    across = material.out_of_plane_stress(stress, degrees)
    return {
        "displacement": displacement,
        "stress": stress[:, :3],
        "stress_zz": across,
        "von_mises": von_mises(stress, across),
        "strain": material.strain(stress, degrees),
        # Of elastic bodies in scenes with a yield stress.
        **dict.fromkeys(("plastic_strain", "flow_stress", "yield_ratio"), np.zeros(len(stress))),
    }


def _flowing_fields(
    law: VonMises, history: FloatArray, displacement: FloatArray, whole: FloatArray, degrees: FloatArray
) -> dict[str, FloatArray]:
    """Fields of a body that flows from the stress (n, 3) of its ``whole`` strain: also the accumulated
    plastic strain, the flow stress, and the equivalent stress over it."""
    material, amount = law.linear, np.maximum(history[:, 4], 0.0)
    stress = whole - plastic_stress(material, history)
    across = material.out_of_plane_stress(stress, degrees) - material.across_modulus * history[:, ZZ]
    flow = law.hardening.flow(amount)[0]
    equivalent = law.equivalent(np.column_stack([stress[:, :2], across, stress[:, 2]]), history)
    return {
        "displacement": displacement,
        "stress": stress,
        "stress_zz": across,
        "von_mises": von_mises(stress, across),
        "strain": material.strain(whole, degrees),
        "plastic_strain": amount,
        "flow_stress": flow,
        "yield_ratio": equivalent / flow,
    }


def _displacements(
    built: CondensedScene, name: str, states: Sequence[State], start: FloatArray | None
) -> tuple[list[FloatArray], FloatArray]:
    """Displacements (n, 2) of a body in each state, and the relative change (c,) by iterative
    refinement."""
    condensed = built.condensed
    if not len(states[0].displacement):
        unknowns = [state.unknowns for state in states]
        return condensed.checked_displacements(built.scene, name, unknowns, start)
    solution = np.stack([state.displacement[built.scene.places[name]] for state in states], axis=1)
    sources = sparse.hstack([condensed.source(name, *state.unknowns) for state in states], format="csc")
    residual = built.scene.bodies[name].system.residual(sparse.csc_array(sources), solution)
    return [one.reshape(-1, 2) for one in solution.T], residual
