"""User settings of the moving least-squares operators."""

from __future__ import annotations

from dataclasses import dataclass

NEIGHBORS = {1: 9, 2: 16, 3: 24, 4: 34, 5: 46, 6: 60}
"""Neighbours per stencil by degree: about 2.5 per polynomial coefficient."""

WEIGHT_EXPONENT = 4.0
"""Rows of a local fit are multiplied by exp(-WEIGHT_EXPONENT r^2), with r the distance over the stencil
radius. With 6 the bulk error is a third smaller, but the compliance of Hertzian contact is no longer
positive."""

ONE_SIDED_RADIUS, ONE_SIDED_DEGREE = 0.9, 4
"""Factor on the radius in these weights at boundary nodes, whose stencils reach one and a half times as far,
from this degree on. It halves some errors; 0.8 doubles noise, and at degree 2 frames became stiffer."""


@dataclass(frozen=True)
class MlsSettings:
    """``degree`` of the local polynomial (1 to 6) and ``neighbors`` per stencil (None: by degree). With
    ``corners`` fits are enriched by singular functions at reentrant corners; with ``narrow`` one-sided fits
    have narrower weights from ONE_SIDED_DEGREE on, and their equilibrium counts less: at finite strain a
    block compressed by two fifths was 0.9 % too stiff with them, 0.4 % without."""

    degree: int = 2
    neighbors: int | None = None
    corners: bool = True
    narrow: bool = True

    @property
    def narrows(self) -> bool:
        """Whether one-sided fits have narrower weights."""
        return self.narrow and self.degree >= ONE_SIDED_DEGREE

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
        """Smallest accepted ratio of diagonal entries of R; sound stencils lie 20 to 200 times above it.
        Measured on bars 1 to 6 nodes thick: with a tenth of it, stencils pass that spoil the solution."""
        return 10.0 ** -(self.degree + 1)
