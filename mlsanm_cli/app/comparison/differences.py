"""How far the states of two methods are from each other, and how far they may be."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.case import Case
from mlsanm_cli.solve.condensed_scene import CondensedScene
from mlsanm_cli.solve.state import State

AMPLIFIED = 100.0
"""Methods with one law may differ by so many times ``solver.tolerance``; published cases do by 4.4, pressures
next to the corner of a block by 12."""
ROUNDED_EDGE, SOFT_STICK = 6.0, 10.0
"""Largest differences of pressures and tractions that the smooth law may make, over the root of eta and over
``stick``: at the edge of a contact it rounds the pressure off by up to 4.3 times the root of eta."""

SOFTER, CONVERGING = 10.0, 0.75
"""Where surfaces end in corners, pressures have no bound, and the limits above do not hold for the largest.
The smooth law agrees with the exact one as well if its error in the L2 norm is at most this part of the one
with so many times eta and stick."""


@dataclass(frozen=True)
class Difference:
    """Largest differences over all nodes and levels: pressures and tractions over the peak pressure,
    displacements over the largest one."""

    pressure: float
    traction: float
    displacement: float

    def within(self, limit: float) -> bool:
        """Whether all are at most ``limit``; what is no number is not."""
        return all(value <= limit for value in asdict(self).values())


def difference(
    built: CondensedScene, found: Mapping[float, State], reference: Mapping[float, State]
) -> Difference:
    """Of the states ``found`` to those of the ``reference``, at the levels that both have."""
    pressure = traction = displacement = peak = largest = 0.0
    for position in found.keys() & reference.keys():
        one, other = found[position], reference[position]
        change = tuple(a - b for a, b in zip(one.unknowns, other.unknowns, strict=True))
        pressure = np.maximum(pressure, np.abs(one.pressure - other.pressure).max(initial=0.0))
        traction = np.maximum(traction, np.abs(one.traction - other.traction).max(initial=0.0))
        # Displacements are linear in the unknowns, so their difference is that of a difference.
        displacement = np.maximum(displacement, _largest_displacement(built, change))
        peak = max(peak, float(other.pressure.max(initial=0.0)))
        largest = max(largest, _largest_displacement(built, other.unknowns))
    return Difference(
        float(pressure) / (peak or 1.0),
        float(traction) / (peak or 1.0),
        float(displacement) / (largest or 1.0),
    )


def _largest_displacement(built: CondensedScene, unknowns: tuple[FloatArray, ...]) -> float:
    """Largest displacement of a node; of a difference without the initial gaps' part, which has none."""
    moved = [built.condensed.displacement(built.scene, name, unknowns) for name in built.scene.bodies]
    return max(float(np.hypot(*u.T).max()) for u in moved)


def same_law_limit(case: Case) -> float:
    """How far methods with the same law may be from each other."""
    return AMPLIFIED * case.solver.tolerance


def other_law_limit(case: Case) -> float:
    """How far a smooth law may be from the exact one."""
    eta = max(contact.regularization.eta for contact in case.touching)
    stick = max((c.regularization.stick for c in case.touching if c.friction), default=0.0)
    return float(ROUNDED_EDGE * np.sqrt(eta) + SOFT_STICK * stick)


def surface_error(built: CondensedScene, found: Mapping[float, State], exact: Mapping[float, State]) -> float:
    """L2 norm of the distance of pressures and tractions from the exact ones over the norm of these, the
    largest of all levels each."""
    weight, nodes = built.condensed.weight, built.condensed.friction_nodes

    def norm(pressure: FloatArray, traction: FloatArray) -> float:
        return float(np.sqrt(weight @ pressure**2 + weight[nodes] @ traction**2))

    worst = max(
        norm(found[position].pressure - state.pressure, found[position].traction - state.traction)
        for position, state in exact.items()
    )
    return worst / max(norm(state.pressure, state.traction) for state in exact.values())


def agreement(table: Sequence[Mapping[str, Any]]) -> str:
    """The status of a comparison by its rows, ANM first: "agree", "disagree", or "failed" where ANM has."""
    if table[0]["status"] == "failed":
        return "failed"
    agree = all(row["status"] == "done" and row.get("agrees", True) for row in table)
    return "agree" if agree else "disagree"
