"""Differences between the states of two methods, and their limits."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.case import Case
from mlsanm_cli.solve.condensed_scene import CondensedScene
from mlsanm_cli.solve.state import State

SAME_LAW_FACTOR = 100.0
"""Largest difference of methods with the same law over ``solver.tolerance``; that of published cases is 4.4,
of pressures next to the corner of a block 12."""
ETA_FACTOR, STICK_FACTOR = 6.0, 10.0
"""Largest differences of pressures and tractions due to the regularised law, over the root of eta and over
``stick``: it smooths the pressure at the edge of a contact by up to 4.3 times the root of eta."""

SOFTER, CONVERGENCE_RATIO = 10.0, 0.75
"""At corners pressures are unbounded, and these limits do not apply to the largest. The regularised law also
agrees with the exact one if its L2 error is at most this ratio of that with ``SOFTER`` times eta and
stick."""


def difference(
    built: CondensedScene, found: Mapping[float, State], reference: Mapping[float, State]
) -> dict[str, float]:
    """Largest differences of the states ``found`` from those of the ``reference`` over all nodes and common
    levels: pressures and tractions relative to the peak pressure, displacements relative to the largest
    one."""
    pressure = traction = displacement = peak = largest = 0.0
    for position in found.keys() & reference.keys():
        one, other = found[position], reference[position]
        change = tuple(a - b for a, b in zip(one.unknowns, other.unknowns, strict=True))
        pressure = np.maximum(pressure, np.abs(one.pressure - other.pressure).max(initial=0.0))
        traction = np.maximum(traction, np.abs(one.traction - other.traction).max(initial=0.0))
        # Displacements are linear in the unknowns.
        displacement = np.maximum(displacement, _largest_displacement(built, change))
        peak = max(peak, float(other.pressure.max(initial=0.0)))
        largest = max(largest, _largest_displacement(built, other.unknowns))
    return {
        "pressure": float(pressure) / (peak or 1.0),
        "traction": float(traction) / (peak or 1.0),
        "displacement": float(displacement) / (largest or 1.0),
    }


def _largest_displacement(built: CondensedScene, unknowns: tuple[FloatArray, ...]) -> float:
    """Largest displacement of a node for given unknowns."""
    moved = [built.condensed.displacement(built.scene, name, unknowns) for name in built.scene.bodies]
    return max(float(np.hypot(*u.T).max()) for u in moved)


def same_law_limit(case: Case) -> float:
    """Largest difference between methods with the same law."""
    return SAME_LAW_FACTOR * case.solver.tolerance


def other_law_limit(case: Case) -> float:
    """Largest difference between the regularised and the exact law."""
    eta = max(contact.regularization.eta for contact in case.touching)
    stick = max((c.regularization.stick for c in case.touching if c.friction), default=0.0)
    return float(ETA_FACTOR * np.sqrt(eta) + STICK_FACTOR * stick)


def surface_error(built: CondensedScene, found: Mapping[float, State], exact: Mapping[float, State]) -> float:
    """Largest L2 norm over all levels of the difference of pressures and tractions from the exact ones,
    relative to the largest norm of these."""
    weight, nodes = built.condensed.weight, built.condensed.friction_nodes

    def norm(pressure: FloatArray, traction: FloatArray) -> float:
        return float(np.sqrt(weight @ pressure**2 + weight[nodes] @ traction**2))

    worst = max(
        norm(found[position].pressure - state.pressure, found[position].traction - state.traction)
        for position, state in exact.items()
    )
    return worst / max(norm(state.pressure, state.traction) for state in exact.values())


def compared(against: str, apart: Mapping[str, float], limit: float) -> dict[str, Any]:
    """Entries of a method in comparison.json: its differences ``apart`` from the method ``against``."""
    agrees = all(value <= limit for value in apart.values())
    return {"against": against, "difference": apart, "limit": limit, "agrees": agrees}


def agreement(table: Sequence[Mapping[str, Any]]) -> str:
    """The status of a comparison from its rows, ANM first: "agree", "disagree", or "failed" if ANM failed."""
    if table[0]["status"] == "failed":
        return "failed"
    agree = all(row["status"] == "done" and row.get("agrees", True) for row in table)
    return "agree" if agree else "disagree"
