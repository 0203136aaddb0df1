"""Refinement of the bulk where the residual of local fits is large.

The residual r of a node is the difference between the stress of fits of the next degree and that of the
solution, weighted as the equations near singular corners. With a uniform spacing h it would grow like
h^degree; the sum of (r h)^2 is least for a given number of nodes if r h is uniform, so that the required
spacing is h (level / (r h))^(1 / (degree + 1)), but at least h / ``MAX_REFINEMENT``. The level is the lowest
that multiplies the number of nodes by no more than ``NODE_BUDGET``. Within ``CONTACT_DISTANCE`` half-widths
of a contact its own zones apply; the mean residual there is a lower bound of the level, as the bulk need not
be more accurate.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from mlsanm_cli.app.scene.boundaries import Boundaries
from mlsanm_cli.app.scene.clouds import spacing_of
from mlsanm_cli.arrays import BoolArray, FloatArray
from mlsanm_cli.cloud.mirror import Mirror, SymmetryLine
from mlsanm_cli.cloud.spacing import Zone, cover
from mlsanm_cli.contact.geometry.profile import Patch
from mlsanm_cli.mechanics.body import ElasticBody
from mlsanm_cli.mechanics.corners import corner_weight
from mlsanm_cli.mechanics.defect import Corrected, Defect
from mlsanm_cli.solve.condensed_scene import CondensedScene

MAX_REFINEMENT = 2.0
NODE_BUDGET = 2.0
CONTACT_DISTANCE = 3.0
GROWTH = 0.2
MIN_REFINEMENT = 1.15
"""Nodes that would become finer by less are not refined."""
SYMMETRY_TOLERANCE = 0.05
"""Relative difference of the spacings requested by symmetric nodes, if the loads are symmetric."""


def residual_zones(
    built: CondensedScene,
    bodies: Mapping[str, Corrected],
    patches: tuple[Patch, ...],
    planned: tuple[Zone, ...],
) -> tuple[Zone, ...]:
    """Zones in addition to the ``planned`` ones; none without corrected ``bodies``. Those of
    symmetric clouds are symmetric if the requirements of the nodes are."""
    if not bodies:
        return ()
    levels, ruled = {}, {}
    for name, body in built.scene.bodies.items():
        levels[name] = _residual(body, bodies[name].defect)
        points = body.model.cloud.points
        ruled[name] = np.zeros(len(points), dtype=bool)
        for patch in patches:
            ruled[name] |= np.hypot(*(points - patch.middle).T) < CONTACT_DISTANCE * patch.half_width
    degree = min(body.model.settings.degree for body in built.scene.bodies.values())
    level = _level(np.concatenate(list(levels.values())), np.concatenate(list(ruled.values())), degree)
    zones: list[Zone] = []
    boundaries = Boundaries.of(built.case)
    for given in built.case.body:
        cloud = built.scene.bodies[given.name].model.cloud
        finer = np.where(ruled[given.name], 1.0, _finer(levels[given.name], level, degree))
        finer, line = _made_symmetric(finer, cloud.mirror)
        wanted = np.where(finer >= MIN_REFINEMENT, cloud.spacing / finer, np.inf)
        spacing = spacing_of(built.case, boundaries, given).with_zones((*planned, *zones))
        zones += cover(cloud.points, cloud.spacing, wanted, spacing, GROWTH, line)
    return tuple(zones)


def _residual(body: ElasticBody, defect: Defect) -> FloatArray:
    """Residual times spacing (n,), with its square averaged over the stencil of each node."""
    cloud, stencils = body.model.cloud, body.model.stencils
    scale = body.model.material.modulus
    square = (defect.stress**2 * np.array([1.0, 1.0, 2.0])).sum(axis=1) / scale**2
    mean = np.add.reduceat(square[stencils.indices], stencils.indptr[:-1]) / np.diff(stencils.indptr)
    result: FloatArray = np.sqrt(mean) * cloud.spacing * corner_weight(cloud, body.restrained, body.springs)
    return result


def _made_symmetric(finer: FloatArray, mirror: Mirror | None) -> tuple[FloatArray, SymmetryLine | None]:
    """``finer`` (n,) with equal values at mirror images, and the line of symmetry; unchanged without a line
    if these differ by more than the discretisation explains."""
    if mirror is None:
        return finer, None
    image = finer[mirror.image]
    if np.abs(finer - image).mean() > SYMMETRY_TOLERANCE * (finer - 1.0).mean():
        return finer, None
    return np.maximum(finer, image), mirror.line


def _finer(residual: FloatArray, level: float, degree: int) -> FloatArray:
    """Required refinement factor (n,) of each node."""
    if level <= 0.0:
        return np.ones(len(residual))
    finer: FloatArray = np.clip((residual / level) ** (1.0 / (degree + 1)), 1.0, MAX_REFINEMENT)
    return finer


def _level(residual: FloatArray, ruled: BoolArray, degree: int) -> float:
    """Level of the module's docstring, by bisection of its logarithm."""
    free = residual[~ruled]
    if not len(free) or not free.max() > 0.0:
        return 0.0
    high = np.log(float(free.max()))
    low = high - degree * np.log(10.0) * 4.0
    for _ in range(40):
        middle = 0.5 * (low + high)
        if (_finer(free, float(np.exp(middle)), degree) ** 2).sum() > NODE_BUDGET * len(free):
            low = middle
        else:
            high = middle
    floor = float(np.sqrt((residual[ruled] ** 2).mean())) if ruled.any() else 0.0
    return max(float(np.exp(high)), floor)
