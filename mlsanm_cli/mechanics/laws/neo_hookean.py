"""The compressible neo-Hookean law."""

from __future__ import annotations

from mlsanm_cli.mechanics.laws.hyperelastic import ByInvariants, Deformation
from mlsanm_cli.mechanics.laws.series import Term, log
from mlsanm_cli.records import dataclass


@dataclass(frozen=True, kw_only=True)
class NeoHookean(ByInvariants):
    """W = mu/2 (I1 - 3) - mu ln J + lam/2 (ln J)^2 with Young's modulus ``E`` (Bonet and Wood, Nonlinear
    Continuum Mechanics for Finite Element Analysis, section 6.4.3)."""

    name = "neo-hookean"
    E: float

    @property
    def shear(self) -> float:
        """mu."""
        return 0.5 * self.E / (1.0 + self.nu)

    def invariant_slopes(self, e: Deformation) -> tuple[Term, Term, Term]:
        """W_1, W_2 and W_J without U'."""
        return 0.5 * self.shear, 0.0, -self.shear * e.compression

    def mean_stress(self, e: Deformation) -> Term:
        """U'(J)."""
        lam = self.bulk - self.shear * (2.0 / 3.0)
        return lam * (log(e.volume) * e.compression)


LAW = NeoHookean
