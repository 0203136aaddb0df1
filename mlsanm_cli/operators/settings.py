"""User settings of the moving least-squares operators."""

from __future__ import annotations

from mlsanm_cli.records import dataclass

NEIGHBORS = {1: 9, 2: 16, 3: 24, 4: 34, 5: 46, 6: 60}
"""Neighbours per stencil by degree: about 2.5 per polynomial coefficient."""

WEIGHT_EXPONENT = 4.0
"""Rows of a local fit are multiplied by exp(-WEIGHT_EXPONENT r^2), r the distance over the radius."""

ONE_SIDED_RADIUS, ONE_SIDED_DEGREE = 0.9, 4
"""Factor on this radius at boundary nodes, whose stencils reach farther, from this degree on."""


@dataclass(frozen=True)
class MlsSettings:
    """``degree`` of the local polynomial (1 to 6) and ``neighbors`` per stencil (None: by degree). With
    ``corners`` fits are enriched by singular functions at reentrant corners; with ``narrow`` one-sided fits
    have narrower weights from ONE_SIDED_DEGREE on, and their equilibrium counts less."""

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
        """Smallest accepted ratio of diagonal entries of R; sound stencils lie 20 to 200 times above it."""
        return 10.0 ** -(self.degree + 1)
