"""Displacements along a contact, without waves too short for a body's cloud.

Errors of least squares vary from node to node, and pressures amplify short waves. Displacements computed on a
cloud, those of remainders and loads, are smooth: they are replaced by polynomials, fitted by least squares at
the samples of a contact's grid; around a closed surface by periodic functions, as polynomials would end at
another displacement than they begin with; at planes of symmetry by even and by odd functions.
"""

from __future__ import annotations

import numpy as np

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.contact.geometry.contact_grid import ContactGrid
from mlsanm_cli.roundoff import ROUND_OFF

SHORTEST_WAVE = 6.0
"""Wavelength in spacings, in the middle of a contact, of the highest polynomial."""
LEAST_ORDER = 6
"""Order up to which polynomials are kept on contacts shorter than that."""


def smoothing(grid: ContactGrid, points: FloatArray, spacing: float) -> tuple[FloatArray, FloatArray] | None:
    """Projections (k, k) of values at a grid's samples ``points`` (k, 2) along its two axes onto functions
    resolved by nodes of some ``spacing``; rigid displacements stay exact. None if the samples resolve nothing
    more."""
    if not grid.mirrored:
        both = plain_smoothing(points, grid.last - grid.first, spacing, grid.hats.period is not None)
        return None if both is None else (both, both)
    length, closed = grid.last - grid.first, grid.unfolding.period is not None
    order = max(LEAST_ORDER, int(np.ceil((2.0 if closed else np.pi) * length / (SHORTEST_WAVE * spacing))))
    if order >= grid.count - 1:
        return None
    # A body moves along one plane, and not at all between two at an angle.
    along = next(plane.along for plane in grid.mirrors if plane is not None)
    rigid = grid.axes @ np.array([along.real, along.imag])
    even, odd = zip(grid.unfolding.waves(order), rigid, strict=True)
    return _projection(even[0], even[1][:, None]), _projection(odd[0], odd[1][:, None])


def plain_smoothing(
    points: FloatArray, length: float, spacing: float, closed: bool = False
) -> FloatArray | None:
    """:func:`smoothing` at Chebyshev ``points`` (k, 2) along a contact of some ``length``, or all around a
    ``closed`` surface; linear displacements stay exact."""
    count = len(points)
    order = max(LEAST_ORDER, int(np.ceil(np.pi * length / (SHORTEST_WAVE * spacing))))
    angle = np.pi * (np.arange(count) + 0.5) / count
    if closed:
        order = max(LEAST_ORDER, 2 * int(np.ceil(length / (SHORTEST_WAVE * spacing))))
        turns = np.outer(np.pi * (1.0 - np.cos(angle)), np.arange(order // 2 + 1))
        waves = np.hstack([np.cos(turns), np.sin(turns[:, 1:])])
    else:
        waves = np.cos(np.outer(angle, np.arange(order + 1)))
    if order >= count - 1:
        return None
    return _projection(waves, points - points.mean(axis=0))


def _projection(waves: FloatArray, extent: FloatArray) -> FloatArray:
    """Projection (k, k) onto ``waves`` (k, n) and what these lack of the columns of ``extent`` (k, c)."""
    waves = np.linalg.qr(waves)[0]
    more, size, _ = np.linalg.svd(extent - waves @ (waves.T @ extent), full_matrices=False)
    more = more[:, size > ROUND_OFF * np.linalg.norm(extent)]
    # Small remainders lose their orthogonality.
    shapes = np.linalg.qr(np.hstack([waves, more]))[0]
    return np.asarray(shapes @ shapes.T)
