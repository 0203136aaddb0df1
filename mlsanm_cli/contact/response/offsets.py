"""Gap and slip changes without elastic bodies: moving obstacles and interference."""

from __future__ import annotations

from typing import Literal

import numpy as np

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.contact.geometry.pairing import Pairing
from mlsanm_cli.contact.response.drivers import spans
from mlsanm_cli.contact.response.linear_map import Columns
from mlsanm_cli.mechanics.scene import Scene


def of_obstacles(
    scene: Scene, pairings: tuple[Pairing, ...], columns: Columns, along: Literal["normal", "tangent"]
) -> tuple[FloatArray, FloatArray]:
    """Change of every paired node's gap (w,), or slip along the tangent, by obstacles' motions: per load
    factor (w, L) and per unknown motion (w, k)."""
    rows, count = _rows(pairings), sum(len(pairing.position) for pairing in pairings)
    total = np.zeros((count, columns.loads + columns.motions))
    for constraint, motion, by in scene.motions:
        if not constraint.bodies and constraint.name in rows:
            pairing, own = rows[constraint.name]
            direction = pairing.normal if along == "normal" else pairing.tangent
            total[own] -= np.outer(direction @ motion.direction[:2], by)
    return total[:, : columns.loads], total[:, columns.loads :]


def of_fits(scene: Scene, pairings: tuple[Pairing, ...], columns: Columns) -> FloatArray:
    """Change of every paired node's gap by interference per load factor (w, L)."""
    load = np.zeros((sum(len(pairing.position) for pairing in pairings), columns.loads))
    for pairing, own in _rows(pairings).values():
        if pairing.interference:
            load[own, scene.loads.index(pairing.name)] -= pairing.interference
    return load


def _rows(pairings: tuple[Pairing, ...]) -> dict[str, tuple[Pairing, slice]]:
    """Every contact, and the range of its paired nodes among those of all contacts."""
    found = spans([one.name for one in pairings], [len(one.position) for one in pairings])
    return {one.name: (one, found[one.name]) for one in pairings}
