"""Options of the asymptotic numerical method."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

# A correction aims at this part of the tolerance, so that the series that follows has the rest.
_CORRECTED = 0.01


@dataclass(frozen=True)
class AnmOptions:
    """Options of a path followed by power series.

    Attributes
    ----------
    order : order N of the series, 2 to 40; 15 to 30 pays
    tolerance : largest residual allowed anywhere on the path
    pade : turn a series into a Padé approximant where that makes the step longer
    max_steps : the path stops after so many steps
    direction : which way to leave the start point: load factor growing (1), falling (-1), or (0) as the piece
        of path before it went on, without one toward the load factor asked for; the sign of later steps is
        that of the path itself
    drift : an end of step is corrected by Newton's method when its residual exceeds this fraction of
        ``tolerance``; below, the next series leads the residual back to zero, which takes no factorisation.
        At 1 only the start and the end of the path are corrected
    min_length : a step shorter than this, in scaled units of the path, ends it
    max_corrections : Newton updates allowed in one correction
    """

    order: int = 20
    tolerance: float = 1e-8
    pade: bool = True
    max_steps: int = 2000
    direction: Literal[-1, 0, 1] = 0
    drift: float = 1.0
    min_length: float = 1e-10
    max_corrections: int = 50

    def __post_init__(self) -> None:
        if not 2 <= self.order <= 40:
            raise ValueError(f"order must lie between 2 and 40, not {self.order}")
        if not 0.0 < self.tolerance < 1.0 or not 0.0 < self.drift <= 1.0:
            raise ValueError("tolerance must lie between 0 and 1, drift must be above 0 and at most 1")
        if self.max_steps < 1 or self.max_corrections < 1:
            raise ValueError("max_steps and max_corrections must be at least 1")
        if self.direction not in (-1, 0, 1):
            raise ValueError(f"direction must be -1, 0 or 1, not {self.direction}")
        if not self.min_length > 0.0:
            raise ValueError("min_length must be positive")

    @property
    def goal(self) -> float:
        """Residual a correction aims at."""
        return self.tolerance * _CORRECTED
