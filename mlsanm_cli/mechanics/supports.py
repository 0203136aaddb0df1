"""Supports along a body's surfaces, held or by springs, and row weights where the stress concentrates.

A spring of stiffness k is stiff if it gives way less than the body itself, k size > C: it acts as a
support, and its force is computed from the stress. Soft springs act as tractions.

Where a fully held surface meets a free one the stress is singular. Strong-form least squares requires
second derivatives, which are not square-integrable there, and would prefer a smooth wrong solution. Rows
are weighted by a power of the distance to the nearest such place, as in the weighted norms of Cox and Fix
(Computers & Mathematics with Applications 10, 1984) and Lee, Manteuffel and Westphal (SIAM Journal on
Numerical Analysis 44, 2006); near unresolved reentrant corners, notches and holes by a power of the
distance plus the radius."""

from __future__ import annotations

from collections.abc import Collection, Mapping

import numpy as np
from scipy.spatial import cKDTree

from mlsanm_cli.arrays import FloatArray, IntArray
from mlsanm_cli.cloud.cloud import Cloud, nearest
from mlsanm_cli.cloud.sight import SMOOTH_TURN
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


POWER = 1.5
"""Exponent of the weights; above 0.3 weighted second derivatives of the singular displacements are
square-integrable."""

WEIGHT_REACH = 0.5
"""Distance from such corners, in thicknesses, at which the weights reach 1."""

ONE_SIDED_WEIGHT = 0.2
"""Factor on equilibrium rows at boundary nodes of narrow stencils, away from such corners: second derivatives
of one-sided fits miss more of the next degree than those inside."""

MIN_DISTANCE = 0.5
"""Lower bound of distances, in spacings."""

MAX_MIXED_ANGLE = 1.4
"""Turn of the boundary (radians) above which, as at right corners, the change from a sliding to a free side
causes no singular stress; on a straight boundary it is that of a crack."""


def thickness(cloud: Cloud) -> float:
    """Area over half the perimeter: the thickness of a thin body."""
    perimeter = sum(float(surface.weight.sum()) for surface in cloud.surfaces.values())
    return 2.0 * float(cloud.areas.sum()) / perimeter


def corner_weight(
    cloud: Cloud, restraints: Held, springs: Springs, touching: Collection[str] = ()
) -> FloatArray:
    """Factor (n,) on equilibrium and traction rows: min(1, distance / (WEIGHT_REACH thickness))^POWER, with
    the distance from places where ``restraints`` or ``springs`` change. Without the limit, rows at a thin
    body's support would have hardly any weight."""
    nodes = singular_changes(cloud, restraints, springs, touching)
    if not len(nodes):
        return np.ones(len(cloud.points))
    distance = np.maximum(
        nearest(cKDTree(cloud.points[nodes]), cloud.points)[0], MIN_DISTANCE * cloud.spacing
    )
    return np.asarray(np.minimum(distance / (WEIGHT_REACH * thickness(cloud)), 1.0) ** POWER)


def singular_changes(
    cloud: Cloud, restraints: Held, springs: Springs, touching: Collection[str] = ()
) -> IntArray:
    """Nodes (k,) where supports change along the boundary and stresses are singular: corners between a fully
    held and a free surface, and others where the boundary turns by less than about a right angle. There
    springs count as supports. Surfaces ``touching`` with nodal pressures are exempt, as their compliance
    needs these rows."""
    held = {
        name: (x or springs.get(name, NO_SPRING)[0] > 0.0, y or springs.get(name, NO_SPRING)[1] > 0.0)
        for name, (x, y) in ((name, restraints.get(name, FREE)) for name in cloud.surfaces)
    }
    found = set()
    for node, turn, both in cloud.corners:
        if held[both[0]] != held[both[1]]:
            clamped = {sum(restraints.get(each, FREE)) for each in both} == {0, 2}
            if clamped or (turn < MAX_MIXED_ANGLE and not {*both} & set(touching)):
                found.add(node)
    return np.array(sorted(found), dtype=np.int64)


def reentrant_corners(cloud: Cloud) -> IntArray:
    """Nodes where two surfaces meet at a sharp reentrant corner."""
    return np.array([node for node, turn, _ in cloud.corners if turn < -SMOOTH_TURN], dtype=np.int64)
