"""Circular hole in an endless anisotropic plate under tension (Lekhnitskii, Anisotropic Plates, section 38).

Two functions of z_k = x + mu_k y, with the roots mu_k of the characteristic equation above the real axis,
A_k / zeta_k each, where zeta_k maps what is outside the hole's image in that plane to outside of a circle.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]


@dataclass(frozen=True)
class AnisotropicHole:
    """A hole of ``radius`` about the origin in a plate with a ``stiffness`` (3, 3) in plane stress, pulled
    along x by ``tension`` far away. Not for isotropic plates, whose roots are one."""

    stiffness: FloatArray
    radius: float
    tension: float

    def _parts(self, points: FloatArray) -> Iterator[tuple[complex, ComplexArray, ComplexArray]]:
        """Both roots, their functions (n,) and derivatives (n,) at ``points`` (n, 2)."""
        a, (x, y) = np.linalg.inv(self.stiffness), points.T
        roots = np.roots([a[0, 0], -2.0 * a[0, 2], 2.0 * a[0, 1] + a[2, 2], -2.0 * a[1, 2], a[1, 1]])
        one, other = roots[roots.imag > 0.0]
        factor = 0.5j * self.tension * self.radius / (other - one)
        for root, share in ((one, factor), (other, -factor)):
            z, unit = x + root * y, self.radius * (1.0 - 1j * root)
            away = np.sqrt(z**2 - self.radius**2 * (1.0 + root**2))
            # The branch outside the circle.
            away = np.where(np.abs(z + away) < np.abs(z - away), -away, away)
            zeta = (z + away) / unit
            yield root, share / zeta, -share / zeta**2 * (1.0 + z / away) / unit

    def stress(self, points: FloatArray) -> FloatArray:
        """Stress (n, 3) in the order xx, yy, xy at ``points`` (n, 2) outside the hole."""
        found = np.tile([self.tension, 0.0, 0.0], (len(points), 1))
        for root, _, slope in self._parts(points):
            found += 2.0 * np.stack([root**2 * slope, slope, -root * slope], axis=1).real
        return found

    def displacement(self, points: FloatArray) -> FloatArray:
        """Displacement (n, 2) at ``points`` (n, 2) outside the hole, but for a rigid motion."""
        a, (x, y) = np.linalg.inv(self.stiffness), points.T
        far = [a[0, 0] * x + 0.5 * a[0, 2] * y, a[0, 1] * y + 0.5 * a[0, 2] * x]
        found = self.tension * np.stack(far, axis=1)
        for root, value, _ in self._parts(points):
            along = a[0, 0] * root**2 + a[0, 1] - a[0, 2] * root
            across = a[0, 1] * root + a[1, 1] / root - a[1, 2]
            found += 2.0 * np.stack([along * value, across * value], axis=1).real
        return found
