"""Places with concentrated stress: corners of held and free surfaces, inward corners, notches and holes.

**Places where the conditions change**: corners where a fully held surface meets a free one, and ends of held
parts of a boundary. The stress is singular there.

Least squares in the strong form asks for second derivatives that are not square-integrable there; left
alone, it would prefer a smooth wrong solution and lose force on the way to the clamped side. So rows are
weighted by a power of the distance to the nearest such corner, in the manner of the weighted norms of Cox and
Fix (Computers & Mathematics with Applications 10, 1984) and of Lee, Manteuffel and Westphal (SIAM Journal on
Numerical Analysis 44, 2006). What is lost all the same shows in the force balance of every run.

**Inward corners, notches, fillets and holes.** The stress is concentrated there, over a length as small as
the radius; where the cloud resolves it poorly, the residuals of few nodes would bend the whole solution. The
weight of a row is a power of the distance plus the radius.
Not so at corners whose fields the fits know (:mod:`mlsanm_cli.operators.cornered`): nothing is poorly
resolved there, and rows with little weight would leave the strength of these fields open.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from mlsanm_cli.arrays import FloatArray, IntArray
from mlsanm_cli.cloud.cloud import Cloud
from mlsanm_cli.cloud.search import nearest
from mlsanm_cli.mechanics.springs import FREE, NO_SPRING, Held, Springs
from mlsanm_cli.startup import cKDTree

POWER = 1.5
"""Corner displacements behave like distance^0.7, whose weighted second derivatives are integrable above 0.3.

Measured on a clamped beam of 8 x 1, degree 2: with spacing 0.05 the tip moves 0.16 of what it should without
weights, 0.82 with power 1, 0.93 with 1.5; at 2 the stress at the clamped side becomes useless.
"""

WEIGHT_REACH = 0.5
"""Part of the thickness over which the weights near such corners grow to 1.

With five nodes across, ten clouds each, clamped beams of 5 to 50 thicknesses are within 0.8 % and a portal
frame with fillets of two spacings within 1.6 %; with 1 the portal loses 3 %, without weights beams are up to
1.6 % too soft.
"""

MIN_DISTANCE = 0.5
"""Distances are never taken below this part of the node spacing."""

MAX_MIXED_ANGLE = 1.4
"""At corners with a larger turning angle (radian), as right ones, a side that slides along a wall and a free
one cause no singular stress; on a straight boundary it is that of a crack."""

MIN_REENTRANT_ANGLE = 0.3
"""Re-entrant corners with a smaller turning angle (radian) count as smooth: their displacements are nearly
linear."""


def thickness(cloud: Cloud) -> float:
    """The body's area over half its perimeter: the thickness of a thin body."""
    perimeter = sum(float(surface.weight.sum()) for surface in cloud.surfaces.values())
    return 2.0 * float(cloud.areas.sum()) / perimeter


def corner_weight(cloud: Cloud, grips: Held, springs: Springs) -> FloatArray:
    """Factor (n,) on the equilibrium and traction rows of every node: up to 1, near places where ``grips`` or
    ``springs`` change along the boundary (distance / (WEIGHT_REACH thickness))^POWER.

    Weights that grew all the way to the far end would leave the rows at a thin body's support with next to
    nothing, and cost the strong rows their digits.
    """
    nodes = np.unique(np.array([*_singular_changes(cloud, grips, springs)], dtype=np.int64))
    if not len(nodes):
        return np.ones(len(cloud.points))
    distance = np.maximum(
        nearest(cKDTree(cloud.points[nodes]), cloud.points)[0], MIN_DISTANCE * cloud.spacing
    )
    factor: FloatArray = np.minimum(distance / (WEIGHT_REACH * thickness(cloud)), 1.0) ** POWER
    return factor


def _singular_changes(cloud: Cloud, grips: Held, springs: Springs) -> Iterator[int]:
    """Nodes where supports change along the boundary and stresses are singular: at corners between a fixed
    and a free surface, and otherwise where the boundary turns by less than about a right angle. There springs
    count as supports: without, the reaction of a block on springs along a part of its side was up to 16 % too
    small."""
    held = {
        name: (x or springs.get(name, NO_SPRING)[0] > 0.0, y or springs.get(name, NO_SPRING)[1] > 0.0)
        for name, (x, y) in ((name, grips.get(name, FREE)) for name in cloud.surfaces)
    }
    for name, one in cloud.surfaces.items():
        for other_name, other in cloud.surfaces.items():
            if one.curve.closed or one.index[-1] != other.index[0] or held[name] == held[other_name]:
                continue
            (x, y), (u, v) = one.normal[-1], other.normal[0]
            clamped = {sum(grips.get(each, FREE)) for each in (name, other_name)} == {0, 2}
            if clamped or np.arctan2(x * v - y * u, x * u + y * v) < MAX_MIXED_ANGLE:
                yield int(other.index[0])


def inward_corners(cloud: Cloud) -> IntArray:
    """Nodes where two surfaces meet at a sharp corner that points into the material."""
    found = []
    for one in cloud.surfaces.values():
        for other in cloud.surfaces.values():
            if not one.curve.closed and one.index[-1] == other.index[0]:
                (x, y), (u, v) = one.normal[-1], other.normal[0]
                if np.arctan2(x * v - y * u, x * u + y * v) < -MIN_REENTRANT_ANGLE:
                    found.append(other.index[0])
    return np.array(found, dtype=np.int64)


def inward_weight(cloud: Cloud, corners: IntArray) -> FloatArray:
    """Factor (n,) on the equilibrium and traction rows: ((distance + radius) / thickness)^POWER, up to 1.

    The distance is that to the nearest of the ``corners`` (c,), of radius 0, or hollow of the outline:
    fillet, notch or hole. Corners whose fields fits know need none: an eye with a shank whose inner corners
    had weights, a mesh of eight nodes across, was 8 % too stiff at degree 2, and 25 % at degree 4.
    A portal frame with fillets of two spacings is 1.3 and 2.9 % too stiff without it (degrees 2 and 4), 0.8
    and 1.4 % with it.
    """
    size = cloud.room
    if len(corners):
        away = nearest(cKDTree(cloud.points[corners]), cloud.points)[0]
        size = np.minimum(size, np.maximum(away, MIN_DISTANCE * cloud.spacing))
    factor: FloatArray = np.minimum(size / thickness(cloud), 1.0) ** POWER
    return factor
