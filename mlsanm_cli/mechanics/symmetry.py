"""Planes of symmetry: straight sides of bodies that are held in their normal component only.

Reflected at such a side, the body and all its tractions are those of a whole body without the side. With the
unit tangent e of the side, vectors are reflected by R = 2 e e^T - 1, and stresses by R s R.

Equation (7) of docs/method.md.
"""

from __future__ import annotations

from functools import cached_property

import numpy as np

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.mechanics.near_field import ComplexArray, PointForceField
from mlsanm_cli.records import dataclass
from mlsanm_cli.roundoff import ROUND_OFF


@dataclass(frozen=True)
class SymmetryPlane:
    """The line through ``point`` along the unit vector ``along``."""

    point: complex
    along: complex

    @cached_property
    def matrix(self) -> FloatArray:
        """R (2, 2)."""
        axis = np.array([self.along.real, self.along.imag])
        return np.asarray(2.0 * np.outer(axis, axis) - np.eye(2))

    @cached_property
    def stress_matrix(self) -> FloatArray:
        """Reflection (3, 3) of stresses xx, yy, xy."""
        (a, b), (c, d) = self.matrix
        return np.array([[a * a, b * b, 2 * a * b], [c * c, d * d, 2 * c * d], [a * c, b * d, a * d + b * c]])

    def points(self, z: ComplexArray) -> ComplexArray:
        """Reflected points (...)."""
        return np.asarray(self.point + self.directions(z - self.point))

    def directions(self, v: ComplexArray) -> ComplexArray:
        """Reflected vectors (...)."""
        return np.asarray(self.along**2 * np.conj(v))

    def height(self, z: ComplexArray) -> FloatArray:
        """Signed distances (...) of points from the plane."""
        return np.asarray(((z - self.point) * np.conj(self.along)).imag)

    def coincides(self, other: SymmetryPlane, slack: float) -> bool:
        """Whether another plane is the same line, up to a distance ``slack``."""
        parallel = abs((self.along * np.conj(other.along)).imag) <= ROUND_OFF
        return parallel and abs(float(self.height(np.array(other.point)))) <= slack

    def reflects(self, kernel: PointForceField) -> bool:
        """Whether the near field of a material is symmetric about the plane."""
        w = np.exp(1j * np.arange(1.0, 4.0)) * self.along
        base = np.full(len(w), self.along)
        field = kernel.displacement(self.directions(w), base)
        error = field - self.matrix @ kernel.displacement(w, base) @ self.matrix
        return bool(np.abs(error).max() <= ROUND_OFF * np.abs(field).max())
