"""Springs along a body's surfaces: stiff ones act as supports, soft ones as tractions.

A spring of stiffness k is stiff if it gives way less than the body itself, k size > C: its force is computed
from the stress, since k times a nearly zero displacement would be mostly error."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from mlsanm_cli.cloud.cloud import Cloud
from mlsanm_cli.mechanics.material import PlaneMaterial

Springs = Mapping[str, tuple[float, float]]
Held = Mapping[str, tuple[bool, bool]]

CORNER_STIFFNESS_RATIO = 30.0
"""Springs up to this times the stiffest soft one leave the corner field of a free surface valid."""
NO_SPRING = (0.0, 0.0)
FREE = (False, False)


def stiffest_soft(cloud: Cloud, material: PlaneMaterial, surface: str | None = None) -> float:
    """Largest stiffness k of a soft spring along a ``surface`` or the whole body."""
    size = float(np.ptp(cloud.points, axis=0).max())
    if surface is not None:
        size = min(size, cloud.surfaces[surface].curve.length)
    return material.modulus / size


def restrained(
    held: Held, springs: Springs, cloud: Cloud, material: PlaneMaterial
) -> dict[str, tuple[bool, bool]]:
    """Components of every surface that are held, or have stiff springs."""
    found = dict(held)
    for name, (x, y) in springs.items():
        limit, before = stiffest_soft(cloud, material, name), held.get(name, FREE)
        if max(x, y) > limit:
            found[name] = (before[0] or x > limit, before[1] or y > limit)
    return found


def restraining(springs: Springs, cloud: Cloud, material: PlaneMaterial) -> list[str]:
    """Surfaces whose springs invalidate the corner field of a free surface."""
    limit = CORNER_STIFFNESS_RATIO * stiffest_soft(cloud, material)
    return [name for name, both in springs.items() if max(both) > limit]


def soft(springs: Springs, cloud: Cloud, material: PlaneMaterial) -> dict[str, tuple[float, float]]:
    """The soft springs, 0 in the other components."""
    limits = {name: stiffest_soft(cloud, material, name) for name in springs}
    found = {name: (x * (x <= limits[name]), y * (y <= limits[name])) for name, (x, y) in springs.items()}
    return {name: both for name, both in found.items() if any(both)}
