"""Circular hole in an endless plate under tension (Kirsch; Timoshenko and Goodier, section 35)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]


@dataclass(frozen=True)
class KirschHole:
    """A hole of ``radius`` about the origin, the plate pulled along x by ``tension`` far away."""

    radius: float
    tension: float

    def stress(self, points: FloatArray) -> FloatArray:
        """Stress (n, 3) in the order xx, yy, xy at ``points`` (n, 2) outside the hole."""
        x, y = points.T
        angle = np.arctan2(y, x)
        a2 = self.radius**2 / (x**2 + y**2)
        a4 = a2**2
        two, four = 2.0 * angle, 4.0 * angle
        xx = 1.0 - a2 * (1.5 * np.cos(two) + np.cos(four)) + 1.5 * a4 * np.cos(four)
        yy = -a2 * (0.5 * np.cos(two) - np.cos(four)) - 1.5 * a4 * np.cos(four)
        xy = -a2 * (0.5 * np.sin(two) + np.sin(four)) + 1.5 * a4 * np.sin(four)
        return np.asarray(self.tension * np.stack([xx, yy, xy], axis=1))
