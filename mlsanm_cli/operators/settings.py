"""What a user may choose about the moving least-squares operators."""

from __future__ import annotations

from dataclasses import dataclass

NEIGHBORS = {1: 9, 2: 16, 3: 24, 4: 34, 5: 46, 6: 60}
"""Neighbours per stencil by degree: about 2.5 times the polynomial's coefficients."""

SHARPNESS = 4.0
"""Rows of a local fit are multiplied by exp(-SHARPNESS r^2), r the distance over the stencil's radius."""


@dataclass(frozen=True)
class MlsSettings:
    """``degree`` of the local polynomial (1 to 6) and ``neighbors`` per stencil (None: by degree)."""

    degree: int = 2
    neighbors: int | None = None

    @property
    def coefficients(self) -> int:
        """Number of coefficients of the local polynomial."""
        return (self.degree + 1) * (self.degree + 2) // 2

    @property
    def stencil_size(self) -> int:
        """Neighbours of a stencil before any enlargement."""
        return self.neighbors or NEIGHBORS[self.degree]

    @property
    def rank_tolerance(self) -> float:
        """Smallest acceptable ratio of diagonal entries of R; sound stencils lie 20 to 200 times above it.

        Measured on bars 1 to 6 nodes thick: ten times less lets stencils pass that spoil the solution.
        """
        return 10.0 ** -(self.degree + 1)
