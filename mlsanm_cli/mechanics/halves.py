"""Which of a mirror-symmetric body's rows and unknowns symmetric loads need."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.cloud.cloud import Cloud
from mlsanm_cli.operators.folded import Fold


def fold_of(cloud: Cloud, first_row: Mapping[str, int], rows: int) -> Fold:
    """Keep the rows of the mirror's own nodes, of all the ``rows`` (r) of a body without single held nodes.

    ``first_row`` tells where those of its surfaces begin. On the mirror itself, rows across it say nothing,
    and where two surfaces meet there, the rows of one of them are enough.
    """
    mirror, count = cloud.mirror, len(cloud.points)
    assert mirror is not None
    image, side = np.empty(rows, dtype=np.int64), np.empty(rows, dtype=np.int64)
    component = np.empty(rows, dtype=np.int64)
    for axis in (0, 1):
        own = slice(axis * count, (axis + 1) * count)
        image[own], side[own], component[own] = axis * count + mirror.image, mirror.side, axis
        for name, surface in cloud.surfaces.items():
            size = len(surface.index)
            other, places = mirror.surfaces[name]
            own = slice(first_row[name] + axis * size, first_row[name] + (axis + 1) * size)
            image[own] = first_row[other] + axis * size + places
            side[own], component[own] = mirror.side[surface.index], axis
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
