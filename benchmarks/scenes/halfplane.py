"""A rough rigid profile on a half-plane, periodic and even: Fourier compliance, primal-dual active set."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Rough:
    """Largest pressure, and the number of parts that touch."""

    peak: float
    patches: int
    pressure: Array


def rough_contact(profile: Array, modulus: float, mean: float, points: int = 1200) -> Rough:
    """Contact of the profile (n, 2), mirrored at both ends, on a half-plane of plane modulus E/(1-nu²).

    The half-plane answers a pressure cos(k x) by a surface displacement 2 cos(k x) / (modulus k).
    """
    long = profile[-1, 0] - profile[0, 0]
    x = (np.arange(points) + 0.5) * long / points
    gap = np.interp(x, profile[:, 0], profile[:, 1])
    waves = np.pi * np.arange(1, points) / long
    shapes = np.cos(np.outer(x, waves))
    compliance = (shapes * (2.0 / (modulus * waves)) * (2.0 / points)) @ shapes.T
    closed = gap < np.quantile(gap, 0.2)
    for _ in range(400):
        j = np.flatnonzero(closed)
        matrix = np.block(
            [[compliance[np.ix_(j, j)], -np.ones((len(j), 1))], [np.ones((1, len(j))), np.zeros((1, 1))]]
        )
        found = np.linalg.solve(matrix, np.concatenate([-gap[j], [mean * points]]))
        pressure = np.zeros(points)
        pressure[j] = found[:-1]
        overlap = compliance @ pressure + gap - found[-1]
        new = np.where(closed, pressure > 0.0, overlap < -1e-12)
        if np.array_equal(new, closed):
            break
        closed = new
    else:
        raise RuntimeError("the contact of the rough profile has not been found")
    touching = np.concatenate([[False], closed, [False]])
    return Rough(float(pressure.max()), int((touching[1:] & ~touching[:-1]).sum()), pressure)
