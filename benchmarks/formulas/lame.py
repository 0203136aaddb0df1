"""Thick ring under pressure (Lame; Timoshenko and Goodier, Theory of Elasticity, section 28)."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]


@dataclass(frozen=True)
class LameRing:
    """A ring of radii ``inner`` and ``outer`` under ``pressure`` from inside.

    ``modulus`` and ``poisson`` are E and nu in plane stress, E/(1 - nu^2) and nu/(1 - nu) in plane strain.
    """

    inner: float
    outer: float
    pressure: float
    modulus: float
    poisson: float

    @property
    def _factor(self) -> float:
        return self.pressure * self.inner**2 / (self.outer**2 - self.inner**2)

    def stress(self, r: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Radial and hoop stress (n,) at radii ``r`` (n,)."""
        ratio = (self.outer / r) ** 2
        return self._factor * (1.0 - ratio), self._factor * (1.0 + ratio)

    def displacement(self, r: FloatArray) -> FloatArray:
        """Radial displacement (n,)."""
        radial, hoop = self.stress(r)
        result: FloatArray = r / self.modulus * (hoop - self.poisson * radial)
        return result


def press_fit(inner: LameRing, outer: LameRing, interference: float) -> float:
    """Pressure between two rings, the inner one too large by ``interference`` in its radius.

    The ``pressure`` of the rings does not count. The inner ring's outer radius is the outer's inner one::

        interference = p (u_outer + u_inner) with u their radial displacements there under a unit pressure
    """
    radius = np.array([outer.inner])
    widened = float(replace(outer, pressure=1.0).displacement(radius)[0])
    # A pressure from outside is one from both sides less one from inside.
    even = -radius[0] * (1.0 - inner.poisson) / inner.modulus
    narrowed = even - float(replace(inner, pressure=1.0).displacement(radius)[0])
    return float(interference / (widened - narrowed))
