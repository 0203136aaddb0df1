"""Solutions of plane elasticity with known derivatives."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass

import numpy as np

from mlsanm_cli.arrays import FloatArray

NUMBERS = ((2.0, 1.0), (1.0, -1.5))
PHASES = (0.3, 1.1)


class Exact(ABC):
    """A displacement field with its stress and body force for a plane ``stiffness`` (3, 3)."""

    stiffness: FloatArray

    @abstractmethod
    def derivative(self, at: FloatArray, dx: int, dy: int) -> FloatArray:
        """A derivative (n, 2) of the displacement."""

    def displacement(self, at: FloatArray) -> FloatArray:
        """Displacements (n, 2)."""
        return self.derivative(at, 0, 0)

    def stress(self, at: FloatArray, dx: int = 0, dy: int = 0) -> FloatArray:
        """Stresses (n, 3), or a derivative of them."""
        by_x, by_y = self.derivative(at, dx + 1, dy), self.derivative(at, dx, dy + 1)
        strain = np.stack([by_x[:, 0], by_y[:, 1], by_y[:, 0] + by_x[:, 1]], axis=1)
        return strain @ self.stiffness

    def force(self, at: FloatArray) -> FloatArray:
        """The body force (n, 2) that keeps it in equilibrium."""
        by_x, by_y = self.stress(at, 1, 0), self.stress(at, 0, 1)
        return -np.stack([by_x[:, 0] + by_y[:, 2], by_x[:, 2] + by_y[:, 1]], axis=1)


@dataclass(frozen=True)
class Wave(Exact):
    """u = curl psi + small grad phi: the change of area shrinks as the material's resistance to it grows, and
    the stress is bounded for every Poisson ratio.

    ``stiffness`` (3, 3) is isotropic. psi and phi are sines of the wave ``numbers`` about ``center``, scaled
    by ``length``.
    """

    stiffness: FloatArray
    numbers: tuple[tuple[float, float], ...] = NUMBERS
    phases: tuple[float, ...] = PHASES
    center: tuple[float, float] = (0.0, 0.0)
    length: float = 1.0

    def derivative(self, at: FloatArray, dx: int, dy: int) -> FloatArray:
        shear, bulk = self.stiffness[2, 2], self.stiffness[0, 1]
        small = shear / (shear + bulk)
        psi = [self._potential(0, at, dx + a, dy + b) for a, b in ((1, 0), (0, 1))]
        phi = [self._potential(1, at, dx + a, dy + b) for a, b in ((1, 0), (0, 1))]
        return np.stack([psi[1] + small * phi[0], -psi[0] + small * phi[1]], axis=1)

    def _potential(self, which: int, at: FloatArray, dx: int, dy: int) -> FloatArray:
        """A derivative (n,) of psi (0) or phi (1)."""
        (k_x, k_y), order = self.numbers[which], dx + dy
        angle = (at - np.array(self.center)) / self.length @ np.array([k_x, k_y]) + self.phases[which]
        sine: FloatArray = np.sin(angle + 0.5 * np.pi * order)
        return sine * k_x**dx * k_y**dy * self.length ** (2 - order)
