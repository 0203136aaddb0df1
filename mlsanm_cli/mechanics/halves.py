"""Which of a mirror-symmetric body's rows and unknowns symmetric loads need."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.cloud.cloud import Cloud
from mlsanm_cli.mechanics.equations import RowTable
from mlsanm_cli.mechanics.rigid import Freedom
from mlsanm_cli.operators.folded import Fold


def even_motions(cloud: Cloud, free: Freedom) -> Freedom:
    """Of the ``free`` motions those that are their own mirror images: along the mirror."""
    assert cloud.mirror is not None
    along = 1 - cloud.mirror.line.axis
    return replace(free, components=tuple(one for one in free.components if one == along))


def fold_of(cloud: Cloud, table: RowTable, single: Sequence[tuple[int, int]]) -> Fold:
    """Keep the rows of the mirror's own nodes, of all the rows (r) in the ``table``.

    On the mirror itself, rows across it say nothing, and where two surfaces meet there, the rows of one of
    them are enough. ``single`` (node, component) pairs are held on the mirror, or hold a motion along it.
    """
    mirror, count, rows = cloud.mirror, len(cloud.points), table.total
    assert mirror is not None
    # Single nodes first: all the others have images and sides of their own.
    image, side = np.arange(rows), np.zeros(rows, dtype=np.int64)
    component = np.zeros(rows, dtype=np.int64)
    component[table.nodes :] = [one for _, one in single]
    for axis in (0, 1):
        own = slice(axis * count, (axis + 1) * count)
        image[own], side[own], component[own] = axis * count + mirror.image, mirror.side, axis
        for name, surface in cloud.surfaces.items():
            size = len(surface.index)
            other, places = mirror.surfaces[name]
            first, first_image = table.surfaces[name] + axis * size, table.surfaces[other] + axis * size
            own = slice(first, first + size)
            image[own], side[own], component[own] = first_image + places, mirror.side[surface.index], axis
    across, numbers = mirror.line.axis, np.arange(rows)
    on = np.where(image == numbers, component != across, numbers < image)
    kept = np.flatnonzero((side > 0) | ((side == 0) & on))
    sign: FloatArray = np.where((mirror.side < 0)[:, None], mirror.line.signs, 1.0)
    sign[mirror.side == 0, across] = 0.0
    return Fold(
        own=mirror.own,
        place=(2 * mirror.place[:, None] + np.arange(2)).ravel(),
        sign=sign.ravel(),
        kept=kept,
        image=image[kept],
        row_sign=mirror.line.signs[component[kept]],
        rows=rows,
        still=2 * mirror.place[mirror.side == 0] + across,
    )
