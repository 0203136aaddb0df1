"""Hertz line contact (Johnson, Contact Mechanics, 1985, doi:10.1017/CBO9781139171731, chapter 4). All forces
are per unit thickness; x runs along the surface from the middle of the contact, z into the body."""

from __future__ import annotations

import math

import numpy as np

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.records import dataclass


@dataclass(frozen=True)
class HertzLine:
    """Two cylinders of relative ``radius`` (1/R = 1/R1 + 1/R2) pressed together by ``force``. ``modulus`` is
    E* with 1/E* = 1/E1' + 1/E2', E' = E/(1 - nu^2) in plane strain and E in plane stress."""

    force: float
    radius: float
    modulus: float

    @property
    def half_width(self) -> float:
        """a = 2 sqrt(P R / (pi E*))."""
        return 2.0 * math.sqrt(self.force * self.radius / (math.pi * self.modulus))

    @property
    def peak_pressure(self) -> float:
        """p0 = 2 P / (pi a)."""
        return 2.0 * self.force / (math.pi * self.half_width)

    def pressure(self, x: FloatArray) -> FloatArray:
        """p0 sqrt(1 - (x/a)^2), zero outside."""
        result: FloatArray = self.peak_pressure * np.sqrt(np.maximum(0.0, 1.0 - (x / self.half_width) ** 2))
        return result
