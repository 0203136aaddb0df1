"""Where the bulk is to be refined: zones for the places whose local fits leave the largest residual.

The residual r of a node is the stress that fits of the next degree find beyond the body's own, with the
weight that rows near singular corners have. Were the spacing h even, r would grow like h^degree; the sum of
(r h)^2 is least for a given number of nodes where r h is the same everywhere, so a node asks for
h (level / (r h))^(1 / (degree + 1)), at most ``FINER`` times finer than it is. The level is the lowest that
multiplies the number of nodes by no more than ``BUDGET``. Within ``AWAY`` half-widths of a contact its own
zones rule; the mean residual there is a floor for the level, for the bulk need not be better than that.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from mlsanm_cli.app.scene.clouds import spacing_of
from mlsanm_cli.arrays import BoolArray, FloatArray
from mlsanm_cli.cloud.cover import cover
from mlsanm_cli.cloud.mirror import Mirror, SymmetryLine
from mlsanm_cli.cloud.spacing import Zone
from mlsanm_cli.contact.geometry.patches import Patch
from mlsanm_cli.mechanics.body import ElasticBody
from mlsanm_cli.mechanics.body_model import BodyModel
from mlsanm_cli.mechanics.corners import corner_weight
from mlsanm_cli.mechanics.defect import Defect
from mlsanm_cli.solve.condensed_scene import CondensedScene

FINER = 2.0
BUDGET = 2.0
AWAY = 3.0
GROWTH = 0.2
WORTH = 1.15
"""A node that would become finer by less asks for nothing."""
UNLIKE = 0.05
"""What symmetric nodes ask for differs by less than this part of it if the loads are symmetric."""


def residual_zones(
    built: CondensedScene,
    defects: Mapping[str, Defect],
    patches: tuple[Patch, ...],
    planned: tuple[Zone, ...],
) -> tuple[Zone, ...]:
    """Zones beyond the ``planned`` ones; none without defects, or where no residual stands out. Those of a
    body whose nodes are placed symmetrically are so too if what its nodes ask for is."""
    if not defects:
        return ()
    levels, ruled = {}, {}
    for name, defect in defects.items():
        levels[name] = _residual(built.scene.bodies[name], defect)
        ruled[name] = _near_contact(built.scene.bodies[name].model, patches)
    degree = min(body.model.settings.degree for body in built.scene.bodies.values())
    level = _level(np.concatenate(list(levels.values())), np.concatenate(list(ruled.values())), degree)
    zones: list[Zone] = []
    for body in built.case.body:
        cloud = built.scene.bodies[body.name].model.cloud
        finer = np.where(ruled[body.name], 1.0, _finer(levels[body.name], level, degree))
        finer, line = _made_symmetric(finer, cloud.mirror)
        wanted = np.where(finer >= WORTH, cloud.spacing / finer, np.inf)
        spacing = spacing_of(built.case, body).with_zones((*planned, *zones))
        zones += cover(cloud.points, cloud.spacing, wanted, spacing, GROWTH, line)
    return tuple(zones)


def _residual(body: ElasticBody, defect: Defect) -> FloatArray:
    """The residual times the spacing (n,), its square averaged over each node's stencil."""
    cloud, stencils = body.model.cloud, body.model.stencils
    # Ghosts count as the boundary nodes they belong to.
    point = np.concatenate([np.arange(len(cloud.points)), body.model.ghosts])[stencils.indices]
    scale = body.model.material.modulus
    square = (defect.stress**2 * np.array([1.0, 1.0, 2.0])).sum(axis=1) / scale**2
    mean = np.add.reduceat(square[point], stencils.indptr[:-1]) / np.diff(stencils.indptr)
    result: FloatArray = np.sqrt(mean) * cloud.spacing * corner_weight(cloud, body.gripped, body.springs)
    return result


def _made_symmetric(finer: FloatArray, mirror: Mirror | None) -> tuple[FloatArray, SymmetryLine | None]:
    """The same (n,) with equal values at nodes that are each other's images, and the line of symmetry; as it
    is, and no line, where these differ by more than round-off and the discretisation make them."""
    if mirror is None:
        return finer, None
    image = finer[mirror.image]
    if np.abs(finer - image).mean() > UNLIKE * (finer - 1.0).mean():
        return finer, None
    return np.maximum(finer, image), mirror.line


def _near_contact(model: BodyModel, patches: tuple[Patch, ...]) -> BoolArray:
    near = np.zeros(len(model.cloud.points), dtype=bool)
    for patch in patches:
        near |= np.hypot(*(model.cloud.points - patch.middle).T) < AWAY * patch.half_width
    return near


def _finer(residual: FloatArray, level: float, degree: int) -> FloatArray:
    """How many times finer each node should become (n,)."""
    if level <= 0.0:
        return np.ones(len(residual))
    finer: FloatArray = np.clip((residual / level) ** (1.0 / (degree + 1)), 1.0, FINER)
    return finer


def _level(residual: FloatArray, ruled: BoolArray, degree: int) -> float:
    """The level of the module's docstring, found by halving its logarithm's range."""
    free = residual[~ruled]
    if not len(free) or not free.max() > 0.0:
        return 0.0
    high = np.log(float(free.max()))
    low = high - degree * np.log(10.0) * 4.0
    for _ in range(40):
        middle = 0.5 * (low + high)
        if (_finer(free, float(np.exp(middle)), degree) ** 2).sum() > BUDGET * len(free):
            low = middle
        else:
            high = middle
    floor = float(np.sqrt((residual[ruled] ** 2).mean())) if ruled.any() else 0.0
    return max(float(np.exp(high)), floor)
