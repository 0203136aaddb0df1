"""The law of Arruda and Boyce."""

from __future__ import annotations

from mlsanm_cli.mechanics.laws.hyperelastic import Isochoric
from mlsanm_cli.mechanics.laws.series import Term
from mlsanm_cli.records import dataclass

LANGEVIN = (1.0 / 2.0, 1.0 / 20.0, 11.0 / 1050.0, 19.0 / 7000.0, 519.0 / 673750.0)
"""Coefficients of the energy of a network of eight chains, from the series of the inverse Langevin
function."""


@dataclass(frozen=True, kw_only=True)
class ArrudaBoyce(Isochoric):
    """W' = mu sum_i C_i (I1'^i - 3^i) / m^(2 i - 2) with the ``locking_stretch`` m of the chains, to five
    terms (Arruda and Boyce 1993, doi:10.1016/0022-5096(93)90013-6, equation 15)."""

    name = "arruda-boyce"
    mu: float
    locking_stretch: float

    def reduced_slopes(self, first: Term, second: Term) -> tuple[Term, Term]:
        """W'_1 and W'_2."""
        slope: Term = 0.0
        for power in range(len(LANGEVIN), 0, -1):
            factor = self.mu * power * LANGEVIN[power - 1] / self.locking_stretch ** (2 * power - 2)
            slope = factor + slope * first
        return slope, 0.0


LAW = ArrudaBoyce
