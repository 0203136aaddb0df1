"""Which of a mirror-symmetric body's rows and unknowns symmetric loads need."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from mlsanm_cli.arrays import FloatArray, IntArray
from mlsanm_cli.cloud.cloud import Cloud
from mlsanm_cli.cloud.mirror import Mirror
from mlsanm_cli.mechanics.equations import RowTable
from mlsanm_cli.mechanics.pieces import Pieces
from mlsanm_cli.mechanics.rigid import RigidBodyModes
from mlsanm_cli.operators.folded import Fold


def even_motions(cloud: Cloud, free: RigidBodyModes) -> RigidBodyModes:
    """Of the ``free`` motions those that are their own mirror images: along the mirror."""
    assert cloud.mirror is not None
    along = 1 - cloud.mirror.line.axis
    return replace(free, components=tuple(one for one in free.components if one == along))


def fold_of(cloud: Cloud, table: RowTable, single: Sequence[tuple[int, int]], pieces: Pieces) -> Fold:
    """Keep the rows of the mirror's own nodes, of all the rows (r) in the ``table``, and those of ``pieces``.

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
    strong, strong_image, strong_sign = _kept_pieces(mirror, pieces)
    return Fold(
        own=mirror.own,
        place=(2 * mirror.place[:, None] + np.arange(2)).ravel(),
        sign=sign.ravel(),
        kept=kept,
        image=image[kept],
        row_sign=mirror.line.signs[component[kept]],
        rows=rows,
        still=2 * mirror.place[mirror.side == 0] + across,
        strong_rows_total=3 * pieces.count,
        strong=strong,
        strong_image=strong_image,
        strong_sign=strong_sign,
        along=1 - across,
    )


def _kept_pieces(mirror: Mirror, pieces: Pieces) -> tuple[IntArray, IntArray, FloatArray]:
    """Rows of the pieces on the mirror's own side, their images, and what the mirror multiplies them by.

    Of a piece that is its own image, the force along the mirror says something.
    """
    image, own = np.empty(pieces.count, dtype=np.int64), np.zeros(pieces.count, dtype=bool)
    for level in pieces.levels:
        some = np.flatnonzero(level >= 0)
        image[level[some]] = level[mirror.image[some]]
        own[level[some[mirror.side[some] >= 0]]] = True
    signs = np.append(mirror.line.signs, -1.0)
    alone = image == np.arange(pieces.count)
    kept = (own & (~alone | (signs[:, None] > 0.0))).ravel()
    rows = np.flatnonzero(kept)
    images = (np.arange(3)[:, None] * pieces.count + image).ravel()
    return rows, images[rows], np.repeat(signs, pieces.count)[rows]
