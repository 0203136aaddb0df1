"""GMRES (Saad and Schultz 1986, doi:10.1137/0907058) for equations known by their products."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from mlsanm_cli.arrays import FloatArray

BASIS = 300
"""Largest number of vectors kept; no restarts, which stall."""


def gmres(
    product: Callable[[FloatArray], FloatArray], rhs: FloatArray, tolerance: float
) -> tuple[FloatArray, int]:
    """An approximate solution (n,) for ``rhs`` (n,) whose residual is ``tolerance`` times as large, or the
    best in BASIS vectors; and the number of products."""
    size = float(np.linalg.norm(rhs))
    if size == 0.0:
        return np.zeros_like(rhs), 0
    vectors, count = [rhs / size], min(BASIS, len(rhs))
    matrix = np.zeros((count + 1, count))
    rotations = np.zeros((count, 2))
    left = np.zeros(count + 1)
    left[0] = size
    for k in range(count):
        new = product(vectors[k])
        # Twice, against loss of orthogonality.
        for _ in (0, 1):
            for row, vector in enumerate(vectors):
                share = float(vector @ new)
                matrix[row, k] += share
                new = new - share * vector
        length = float(np.linalg.norm(new))
        matrix[k + 1, k] = length
        column = matrix[:, k]
        for row in range(k):
            c, s = rotations[row]
            column[row], column[row + 1] = (
                c * column[row] + s * column[row + 1],
                c * column[row + 1] - s * column[row],
            )
        radius = float(np.hypot(column[k], length))
        rotations[k] = c, s = column[k] / radius, length / radius
        column[k], column[k + 1] = radius, 0.0
        left[k], left[k + 1] = c * left[k], -s * left[k]
        if abs(left[k + 1]) <= tolerance * size or length <= np.finfo(float).eps * radius:
            break
        vectors.append(new / length)
    used = k + 1
    shares = np.linalg.solve(np.triu(matrix[:used, :used]), left[:used])
    return np.asarray(np.stack(vectors[:used], axis=1) @ shares), used
