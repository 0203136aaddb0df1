"""Cantilever under an end load (Timoshenko and Goodier, Theory of Elasticity, section 21)."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Cantilever:
    """A beam of ``length`` and ``depth``, unit thickness, built in at one end, loaded across by ``force`` at
    the other.

    ``modulus`` is E' = E/(1 - nu^2) in plane strain and E in plane stress, ``shear`` is G.
    """

    length: float
    depth: float
    force: float
    modulus: float
    shear: float

    @property
    def tip_deflection(self) -> float:
        """P L^3 / (3 E' I) + 6 P L / (5 G D) with I = D^3/12: bending, and shear (factor 6/5, parabola)."""
        bending = 4.0 * self.force * self.length**3 / (self.modulus * self.depth**3)
        return bending + 1.2 * self.force * self.length / (self.shear * self.depth)
