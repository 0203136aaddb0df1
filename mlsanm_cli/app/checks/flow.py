"""Figures of bodies that flow, and checks of their states."""

from __future__ import annotations

from typing import Any

import numpy as np

from mlsanm_cli.mechanics.energy import over_body
from mlsanm_cli.solve.condensed_scene import CondensedScene
from mlsanm_cli.solve.state import State


def has_flowed(built: CondensedScene, state: State) -> bool:
    """Whether some body has plastic strains in a state."""
    return any(state.history(name)[:, 4].any() for name in built.laws)


def flow_error(built: CondensedScene, state: State) -> float:
    """The largest error of displacements by the spacings on the path to a ``state`` of a scene ``built`` with
    its plastic strains, over the displacements of the bodies that flow (root mean squares)."""
    squares = 0.0
    for name in built.laws:
        moved = built.condensed.displacement(built.scene, name, state.unknowns)
        squares += float(built.scene.bodies[name].model.cloud.areas @ (moved**2).sum(axis=1))
    return float(state.solver["errors"][1] / np.sqrt(squares)) if squares else 0.0


def flow_figures(built: CondensedScene, state: State) -> dict[str, Any]:
    """The estimated error of the increments up to a state, and of every body that flows its largest plastic
    strain, the part of its area that has any, the work of plastic strains and the stored energy. The work is
    dissipated except for what back stresses store."""
    bodies = {}
    for name, law in built.laws.items():
        cloud, history = built.scene.bodies[name].model.cloud, state.history(name)
        stress, plastic = state.solver[f"stress.{name}"], history[:, :4]
        tensor = np.array([1.0, 1.0, 1.0, 0.5])
        back = law.hardening.kinematic / 3.0 * over_body(cloud, plastic * tensor, plastic)
        bodies[name] = {
            "plastic_strain": float(history[:, 4].max()),
            "plastic_area": float(cloud.areas @ (history[:, 4] > 0.0) / cloud.areas.sum()),
            "plastic_work": float(cloud.areas @ state.solver[f"work.{name}"]),
            "stored_energy": 0.5 * over_body(cloud, stress, law.elastic_strain(stress)) + back,
        }
    if not bodies:
        return {}
    return {"flow": {"increment_error": float(state.solver["errors"][0]), "bodies": bodies}}
