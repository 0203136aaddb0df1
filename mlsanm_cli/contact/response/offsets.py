"""Changes of gaps and slips that no elastic body has a part in: moving obstacles, growing interference."""

from __future__ import annotations

from typing import Literal

import numpy as np

from mlsanm_cli.contact.geometry.pairing import Pairing
from mlsanm_cli.contact.response.linear_map import Columns, LinearMap
from mlsanm_cli.mechanics.scene import Obstacle, Scene


def of_obstacles(
    scene: Scene, pairings: tuple[Pairing, ...], columns: Columns, along: Literal["normal", "tangent"]
) -> LinearMap:
    """What obstacles' motions change of every paired node's gap (w,), or of its slip along the tangent."""
    total = columns.zeros(sum(len(pairing.position) for pairing in pairings))
    rows = _rows(pairings)
    unknown = 0
    for constraint in scene.rigid_constraints:
        for motion in constraint.motions:
            if isinstance(constraint, Obstacle) and constraint.contact in rows:
                pairing, own = rows[constraint.contact]
                direction = pairing.normal if along == "normal" else pairing.tangent
                if motion.prescribed is None:
                    total.motion[own, unknown] -= direction[:, motion.component]
                else:
                    total.load[own] -= np.outer(direction[:, motion.component], motion.prescribed)
            unknown += motion.prescribed is None
    return total


def of_fits(scene: Scene, pairings: tuple[Pairing, ...], columns: Columns) -> LinearMap:
    """What interference takes from every paired node's gap (w,)."""
    total = columns.zeros(sum(len(pairing.position) for pairing in pairings))
    for pairing, own in _rows(pairings).values():
        if pairing.interference:
            total.load[own, scene.loads.index(pairing.name)] -= pairing.interference
    return total


def _rows(pairings: tuple[Pairing, ...]) -> dict[str, tuple[Pairing, slice]]:
    """Every contact's paired nodes among those of all."""
    ends = np.cumsum([0, *(len(pairing.position) for pairing in pairings)]).tolist()
    return {p.name: (p, slice(a, b)) for p, a, b in zip(pairings, ends[:-1], ends[1:], strict=True)}
