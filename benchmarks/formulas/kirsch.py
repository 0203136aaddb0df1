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

    def displacement(self, points: FloatArray, modulus: float, poisson: float) -> FloatArray:
        """Displacement (n, 2) at ``points`` (n, 2) outside the hole, in plane stress."""
        x, y = points.T
        rho, angle = np.hypot(x, y) / self.radius, np.arctan2(y, x)
        kappa = (3.0 - poisson) / (1.0 + poisson)
        scale = self.tension * self.radius * (1.0 + poisson) / (4.0 * modulus)
        one, three = angle, 3.0 * angle
        along = rho * (kappa + 1.0) * np.cos(one) + 2.0 / rho * ((1.0 + kappa) * np.cos(one) + np.cos(three))
        across = rho * (kappa - 3.0) * np.sin(one) + 2.0 / rho * ((1.0 - kappa) * np.sin(one) + np.sin(three))
        both = [along - 2.0 / rho**3 * np.cos(three), across - 2.0 / rho**3 * np.sin(three)]
        return np.asarray(scale * np.stack(both, axis=1))
