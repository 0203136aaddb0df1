"""Springs along a body's surfaces: which of them hold like supports, and which give way.

A spring is stiff where it gives way by less than the body itself, k size > C. Its force then comes from the
stress inside the body, as that of a held surface does: k times displacements that are nearly zero
would be their errors only. That of a soft spring is k u; it says how far the body moves as a whole.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from mlsanm_cli.cloud.cloud import Cloud
from mlsanm_cli.mechanics.material import PlaneMaterial

Springs = Mapping[str, tuple[float, float]]
Held = Mapping[str, tuple[bool, bool]]

MAX_STIFFNESS_RATIO = 30.0
"""Stiffness over that of the stiffest soft spring up to which springs have little influence next to a corner.
For a block on a rough base, beside springs 2.6 or 87 times as stiff, the force is within 0.3 % of that with
fine nodes; nodal pressures, for which the corner has no fields, were 8 and 22 % off."""
NO_SPRING = (0.0, 0.0)
FREE = (False, False)


def stiffest_soft(cloud: Cloud, material: PlaneMaterial, surface: str | None = None) -> float:
    """Stiffness k (traction per displacement) above which springs along a ``surface``, or on the whole body,
    are stiffer than the body: its compliance under a load on a part of its boundary is proportional to the
    length of the part."""
    size = float(np.ptp(cloud.points, axis=0).max())
    if surface is not None:
        size = min(size, cloud.surfaces[surface].curve.length)
    return material.modulus / size


def gripped(
    held: Held, springs: Springs, cloud: Cloud, material: PlaneMaterial
) -> dict[str, tuple[bool, bool]]:
    """Components of every surface that are held, or supported by springs too stiff to deform."""
    found = dict(held)
    for name, both in springs.items():
        limit = stiffest_soft(cloud, material, name)
        if max(both) > limit:
            before = held.get(name, FREE)
            found[name] = (before[0] or both[0] > limit, before[1] or both[1] > limit)
    return found


def occupying(springs: Springs, cloud: Cloud, material: PlaneMaterial) -> list[str]:
    """Surfaces with springs too stiff to count as free at their corners."""
    limit = MAX_STIFFNESS_RATIO * stiffest_soft(cloud, material)
    return [name for name, both in springs.items() if max(both) > limit]


def soft(springs: Springs, cloud: Cloud, material: PlaneMaterial) -> dict[str, tuple[float, float]]:
    """Springs that are not too stiff to deform, 0 where there is none."""
    kept = {}
    for name, (x, y) in springs.items():
        limit = stiffest_soft(cloud, material, name)
        kept[name] = (x if x <= limit else 0.0, y if y <= limit else 0.0)
    return {name: both for name, both in kept.items() if any(both)}
