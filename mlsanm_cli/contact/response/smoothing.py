"""Displacements along a contact, without waves too short for a body's cloud.

Errors of least squares vary from node to node, and pressures amplify short waves: gaps that were off by a
thousandth of the displacements, over a wavelength of three spacings, moved the peak in a hole of 34 nodes by
up to 6 %, unseen by estimates. Displacements computed on a cloud, those of remainders and loads, are smooth:
they are replaced by polynomials, fitted by least squares at the samples of a contact's grid.
"""

from __future__ import annotations

import numpy as np

from mlsanm_cli.arrays import FloatArray

SHORTEST_WAVE = 6.0
"""Wavelength in spacings, in the middle of a contact, of the highest polynomial. In holes of 25 to 45 nodes
errors of pressures were 1.7 to 5.7 % without, 0.7 to 3.6 % with 5, 0.6 to 3.3 % with 6."""
LEAST_ORDER = 6
"""Order up to which polynomials are kept on contacts shorter than that."""
DEPENDENT = 1e-9
"""Part of the extent of points below which their coordinates are polynomials of the others."""


def smoothing(points: FloatArray, length: float, spacing: float) -> FloatArray | None:
    """Projection (k, k) of values at Chebyshev ``points`` (k, 2) along a contact of some ``length`` onto
    polynomials resolved by nodes of some ``spacing``; linear displacements stay exact. None if the points
    resolve nothing more."""
    count = len(points)
    order = max(LEAST_ORDER, int(np.ceil(np.pi * length / (SHORTEST_WAVE * spacing))))
    if order >= count - 1:
        return None
    angle = np.pi * (np.arange(count) + 0.5) / count
    waves = np.cos(np.outer(angle, np.arange(order + 1))) * np.sqrt(2.0 / count)
    waves[:, 0] = np.sqrt(1.0 / count)
    extent = points - points.mean(axis=0)
    more, size, _ = np.linalg.svd(extent - waves @ (waves.T @ extent), full_matrices=False)
    shapes = np.hstack([waves, more[:, size > DEPENDENT * np.linalg.norm(extent)]])
    return np.asarray(shapes @ shapes.T)
