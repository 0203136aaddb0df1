"""The law of Mooney and Rivlin."""

from __future__ import annotations

from mlsanm_cli.mechanics.laws.hyperelastic import Isochoric
from mlsanm_cli.mechanics.laws.series import Term
from mlsanm_cli.records import dataclass


@dataclass(frozen=True, kw_only=True)
class MooneyRivlin(Isochoric):
    """W' = c10 (I1' - 3) + c01 (I2' - 3) (Rivlin 1948, doi:10.1098/rsta.1948.0024)."""

    name = "mooney-rivlin"
    c10: float
    c01: float

    def reduced_slopes(self, first: Term, second: Term) -> tuple[Term, Term]:
        """W'_1 and W'_2."""
        return self.c10, self.c01


LAW = MooneyRivlin
