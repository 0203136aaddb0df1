"""What a user may choose about the moving least-squares operators."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

Scheme = Literal["least-squares", "collocation", "ghost"]

NEIGHBORS = {1: 9, 2: 16, 3: 24, 4: 34, 5: 46, 6: 60}
"""Neighbours per stencil by degree: about 2.5 times the polynomial's coefficients."""

WEIGHT_EXPONENT = 4.0
"""Rows of a local fit are multiplied by exp(-WEIGHT_EXPONENT r^2), r the distance over the stencil's radius.
At 6 the bulk error is a third smaller, but the compliance of a Hertz contact is no longer positive."""

SQUARE_EXPONENT = 6.0
"""The same for square schemes at degree 4 and above, which fail more often with a smaller one."""


@dataclass(frozen=True)
class MlsSettings:
    """``degree`` of the local polynomial (1 to 6), ``neighbors`` per stencil (None: by degree), and how the
    equations are made of them: "least-squares", "collocation" (one per unknown) or "ghost" (one per unknown,
    with a node outside every boundary node). Beside sharp inward ``corners`` least squares may know more than
    polynomials."""

    degree: int = 2
    neighbors: int | None = None
    scheme: Scheme = "least-squares"
    corners: bool = True

    @property
    def square(self) -> bool:
        """Whether there are as many equations as unknowns."""
        return self.scheme != "least-squares"

    @property
    def coefficients(self) -> int:
        """Number of coefficients of the local polynomial."""
        return (self.degree + 1) * (self.degree + 2) // 2

    @property
    def stencil_size(self) -> int:
        """Neighbours of a stencil before any enlargement."""
        return self.neighbors or NEIGHBORS[self.degree]

    @property
    def sharpness(self) -> float:
        """How fast the weight of a neighbour falls with its distance."""
        return SQUARE_EXPONENT if self.square and self.degree >= 4 else WEIGHT_EXPONENT

    @property
    def rank_tolerance(self) -> float:
        """Smallest acceptable ratio of diagonal entries of R; sound stencils lie 20 to 200 times above it.

        Measured on bars 1 to 6 nodes thick: ten times less lets stencils pass that spoil the solution.
        """
        return 10.0 ** -(self.degree + 1)
