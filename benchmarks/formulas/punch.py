"""Flat rigid punch on a half-plane (Johnson, Contact Mechanics, 1985, section 2.8).

doi:10.1017/CBO9781139171731
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]


@dataclass(frozen=True)
class FlatPunch:
    """A smooth punch of ``half_width`` a pressed by ``force`` P per unit thickness."""

    force: float
    half_width: float

    def pressure(self, x: FloatArray) -> FloatArray:
        """P / (pi sqrt(a^2 - x^2)) at |x| < a from the middle; infinite at the edges."""
        result: FloatArray = self.force / (np.pi * np.sqrt(self.half_width**2 - x**2))
        return result
