"""Whether points belong to a body, decided from its boundary nodes alone, as run.h5 keeps them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from mlsanm_cli.arrays import BoolArray, FloatArray, IntArray
from mlsanm_cli.cloud.polygon import BLOCK_SIZE, inside_polygon

BULGE_FACTOR = 1.1
"""Curves other than arcs may bulge over their chords by this factor more than arcs with the same normals."""
ROUND_OFF = 1e-9


def boundary_chords(index: IntArray, names: Sequence[str]) -> IntArray:
    """Pairs (b, 2) of places in ``index`` (nb,) that are neighbours along the boundary, loop by loop.

    ``index`` holds the nodes surface by surface, ``names`` (nb,) the surface of each.
    """
    owner = np.array(names)
    chains = [np.flatnonzero(owner == name) for name in dict.fromkeys(names)]
    starts = {int(index[chain[0]]) for chain in chains}
    # A surface that continues nowhere is closed.
    whole = [chain if int(index[chain[-1]]) in starts else np.append(chain, chain[:1]) for chain in chains]
    return np.concatenate([np.stack([chain[:-1], chain[1:]], axis=1) for chain in whole])


def belongs(
    points: FloatArray, index: IntArray, normal: FloatArray, names: Sequence[str], targets: FloatArray
) -> BoolArray:
    """Which ``targets`` (e, 2) lie in the body of ``points`` (n, 2) or on its boundary.

    Boundary nodes ``index`` (nb,) with outward ``normal`` (nb, 2) and ``names`` as in
    :func:`boundary_chords`. A curve may lie outside its chords by c tan(phi/4)/2, with c the chord and phi
    the angle between the normals at its ends.
    """
    chords = boundary_chords(index, names)
    start, end = points[index[chords[:, 0]]], points[index[chords[:, 1]]]
    along = end - start
    length = np.hypot(along[:, 0], along[:, 1])
    cosine = (normal[chords[:, 0]] * normal[chords[:, 1]]).sum(axis=1)
    bulge = 0.5 * length * np.tan(0.25 * np.arccos(np.clip(cosine, -1.0, 1.0)))
    near = BULGE_FACTOR * bulge + ROUND_OFF * float(np.ptp(points, axis=0).max())
    inside = inside_polygon(np.concatenate([start, end], axis=1), targets)
    # Only what is outside of the chords, and not far from all of them, can be below a bulge.
    low, high = start.min(axis=0) - near.max(), start.max(axis=0) + near.max()
    around = ((targets >= low) & (targets <= high)).all(axis=1)
    for some in _together(np.flatnonzero(around & ~inside), len(start)):
        offset = targets[some, None] - start
        share = np.clip((offset * along).sum(axis=2) / length**2, 0.0, 1.0)
        away = offset - share[:, :, None] * along
        inside[some] = (np.hypot(away[:, :, 0], away[:, :, 1]) <= near).any(axis=1)
    return inside


def _together(targets: IntArray, chords: int) -> list[IntArray]:
    """Targets that are compared with all chords at once."""
    return np.array_split(targets, 1 + len(targets) * chords // BLOCK_SIZE)
