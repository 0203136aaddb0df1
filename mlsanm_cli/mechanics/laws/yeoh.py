"""Yeoh's law."""

from __future__ import annotations

from mlsanm_cli.mechanics.laws.hyperelastic import Isochoric
from mlsanm_cli.mechanics.laws.series import Term
from mlsanm_cli.records import dataclass


@dataclass(frozen=True, kw_only=True)
class Yeoh(Isochoric):
    """W' = c10 y + c20 y^2 + c30 y^3, y = I1' - 3 (Yeoh 1993, doi:10.5254/1.3538343)."""

    name = "yeoh"
    c10: float
    c20: float
    c30: float

    def reduced_slopes(self, first: Term, second: Term) -> tuple[Term, Term]:
        """W'_1 and W'_2."""
        y = first - 3.0
        return self.c10 + y * (2.0 * self.c20 + 3.0 * self.c30 * y), 0.0


LAW = Yeoh
