"""Pin in a hole of nearly its own size, without friction, both of one material (Persson 1964).

As given by Ciavarella and Decuzzi, International Journal of Solids and Structures 38 (2001) 4507,
doi:10.1016/S0020-7683(00)00289-4: the pin is pressed by a force at its centre, the plate is endless. With
b = tan(ε/2), ε half the angle of contact, Q the force per thickness, ΔR the clearance in radius:

    E* ΔR / Q = (2 - 2 b⁴ - ln(1 + b²)) / (π b² (1 + b²))
    p(θ) = Q/R [2/(π √(1+b²)) √(b²-y²)/(1+y²) + ln((√(1+b²)+√(b²-y²)) / (√(1+b²)-√(b²-y²))) / (2π b² (1+b²))]

y = tan(θ/2), and E* = E in plane stress, E/(1-ν²) in plane strain.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from mlsanm_cli.continuation.roots import root

FloatArray = NDArray[np.float64]

FIT = 0.91357
"""b of a pin without clearance: 84.8 degrees to either side, whatever the force."""


@dataclass(frozen=True)
class PinInHole:
    """A pin of ``radius`` in a hole larger by ``clearance`` > 0, pressed by ``force`` per unit thickness.

    ``modulus`` is E in plane stress and E/(1-ν²) in plane strain.
    """

    radius: float
    clearance: float
    force: float
    modulus: float

    @cached_property
    def b(self) -> float:
        """tan(ε/2)."""
        ratio = self.modulus * self.clearance / self.force
        # The ratio falls as b grows; the half-plane's b² = 2/(π ratio) is above the root.
        high = min(2.0 * FIT, math.sqrt(2.0 / (math.pi * ratio)))
        return root(lambda b: clearance_ratio(b) - ratio, 1e-3 * high, high, 1e-15)

    @property
    def half_angle(self) -> float:
        """ε, half the angle of contact (radian)."""
        return 2.0 * math.atan(self.b)

    @property
    def peak_pressure(self) -> float:
        """Pressure in the middle of the contact."""
        return float(self.pressure(np.zeros(1))[0])

    def pressure(self, angle: FloatArray) -> FloatArray:
        """Pressure (n,) at ``angle`` (n,) from the line of the force (radian)."""
        b2 = self.b**2
        y2 = np.minimum(np.tan(0.5 * np.abs(angle)) ** 2, b2)
        width, root = math.sqrt(1.0 + b2), np.sqrt(b2 - y2)
        first = 2.0 / (math.pi * width) * root / (1.0 + y2)
        second = np.log((width + root) / (width - root)) / (2.0 * math.pi * b2 * (1.0 + b2))
        inside = np.abs(angle) < self.half_angle
        return np.asarray(np.where(inside, self.force / self.radius * (first + second), 0.0))


def clearance_ratio(b: float) -> float:
    """E* ΔR / Q of a contact with tan(ε/2) = ``b``."""
    return (2.0 - 2.0 * b**4 - math.log1p(b**2)) / (math.pi * b**2 * (1.0 + b**2))
