"""Equilibrium of bodies and contacts: the forces that are missing, relative to those that act."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.roundoff import ROUND_OFF
from mlsanm_cli.solve.condensed_scene import CondensedScene
from mlsanm_cli.solve.state import UNLOADED, State


def worst_of(errors: Mapping[str, float]) -> str:
    """The body with the error largest in magnitude, or with nan."""
    return max(errors, key=lambda name: np.nan_to_num(abs(errors[name]), nan=np.inf))


def force_balance(built: CondensedScene, state: State) -> dict[str, float]:
    """Resultant of all forces on each body over the largest force on it, in a state."""
    unbalanced = built.condensed.imbalance(*state.unknowns).reshape(-1, 2)
    per_body = {}
    for number, name in enumerate(built.scene.bodies):
        largest = max(largest_force(built, name, state.unknowns), least_force(built, name))
        size = float(np.hypot(*unbalanced[number]))
        per_body[name] = 0.0 if largest == 0.0 else size / largest
    return per_body


def largest_force(built: CondensedScene, body: str, unknowns: Sequence[FloatArray]) -> float:
    """Largest force on a body in a state f, q, p, t. The magnitudes of pressures, tractions and body forces
    are summed, so that press fits and couples, whose resultants vanish, count."""
    condensed, (factors, _, pressure, _) = built.condensed, unknowns
    sizes = [
        float(condensed.weight[span] @ np.abs(pressure[span]))
        for pairing, span in zip(condensed.pairings, condensed.spans.values(), strict=True)
        if body in pairing.bodies
    ]
    for pairing in condensed.bonds.pairings:
        if body in pairing.bodies:
            size = np.hypot(*condensed.bonds.values(pairing.name, unknowns))
            sizes.append(float(pairing.weight[pairing.candidate] @ size))
    maps = [condensed.forces[load.name] for load in built.case.load if body in load.owners]
    sizes += [abs(factors[number]) * size for number, size in built.scene.sizes[body]]
    sizes.append(built.scene.heat_force(body, factors))
    return float(np.max([*sizes, *(np.hypot(*force(*unknowns)) for force in maps)]))


def least_force(built: CondensedScene, body: str) -> float:
    """Force below which those on a body are not checked, from those at the ends of stages: on it, and, if
    nothing loads it, on all."""
    sizes = {
        name: max((largest_force(built, name, end.unknowns) for end in built.ends), default=0.0)
        for name in built.scene.bodies
    }
    return max(UNLOADED * sizes[body], ROUND_OFF * max(sizes.values()))


def force_mismatch(built: CondensedScene, state: State) -> dict[str, float]:
    """Difference of the forces on slave and master over the normal force, by contact."""
    found = {}
    for name, span in built.condensed.spans.items():
        pressed = float(built.condensed.weight[span] @ np.abs(state.pressure[span]))
        lost = float(np.hypot(*built.condensed.mismatches[name](*state.unknowns)))
        found[name] = lost / pressed if pressed else 0.0
    return found
