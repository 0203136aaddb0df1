"""The law of Blatz and Ko for compressible foams."""

from __future__ import annotations

from mlsanm_cli.mechanics.laws.hyperelastic import ByInvariants, Deformation
from mlsanm_cli.mechanics.laws.series import Term
from mlsanm_cli.records import dataclass


@dataclass(frozen=True, kw_only=True)
class BlatzKo(ByInvariants):
    """W = f mu/2 (I1 - 3 + (J^-2b - 1)/b) + (1 - f) mu/2 (I2/J^2 - 3 + (J^2b - 1)/b) with b = nu/(1 - 2 nu)
    and Young's modulus ``E`` (Blatz and Ko 1962, doi:10.1122/1.548937). Foams have ``f`` = 0 and nu = 1/4."""

    name = "blatz-ko"
    E: float
    f: float = 0.0

    @property
    def shear(self) -> float:
        """mu."""
        return 0.5 * self.E / (1.0 + self.nu)

    def invariant_slopes(self, e: Deformation) -> tuple[Term, Term, Term]:
        """W_1, W_2 and W_J without U'."""
        solid, foam = 0.5 * self.f * self.shear, 0.5 * (1.0 - self.f) * self.shear
        square = e.compression**2
        by_volume = -2.0 * foam * (e.second * (square * e.compression)) if foam else 0.0
        return solid, foam * square if foam else 0.0, by_volume

    def mean_stress(self, e: Deformation) -> Term:
        """U'(J)."""
        power, total = 2.0 * self.nu / (1.0 - 2.0 * self.nu), _ZERO
        if self.f < 1.0:
            total = (1.0 - self.f) * self.shear * e.volume ** (power - 1.0)
        if self.f > 0.0:
            total = total - self.f * self.shear * e.volume ** (-power - 1.0)
        return total


_ZERO: Term = 0.0
LAW = BlatzKo
