"""The Saint Venant-Kirchhoff law: linear elasticity, of any anisotropy, at finite rotations."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from mlsanm_cli.mechanics.laws.law import Law, Stress
from mlsanm_cli.mechanics.laws.series import Series, Tape, Term, dot, linear
from mlsanm_cli.mechanics.material import PlaneMaterial
from mlsanm_cli.records import dataclass


@dataclass(frozen=True)
class SaintVenantKirchhoff(Law):
    """P = F S, S = C E, E = (F^T F - 1) / 2 with the stiffness of the ``linear`` material. C is that of the
    plane: S_33 = 0 in plane stress is linear in E."""

    name = "saint-venant-kirchhoff"
    linear: PlaneMaterial
    plane: str

    def stress_of(self, tape: Tape, f: Sequence[Series], across: Term | None, apart: bool) -> Stress:
        f11, f12, f21, f22 = f
        squares = [(f11**2, f21**2), (f12**2, f22**2)]
        direct = [linear([(x, 0.5), (y, 0.5)], -0.5) for x, y in squares]
        thickening = 0.0 if across is None else 0.5 * (across**2 - 1.0)
        strain = (*direct, f11 * f12 + f21 * f22, thickening)
        material = self.linear
        moduli = np.column_stack([material.stiffness, material.coupling]).tolist()
        s11, s22, s12 = stress = [linear(zip(strain, row, strict=True)) for row in moduli]
        plane = [
            dot((x, f_x), (y, f_y))
            for f_x, f_y in ((f11, f12), (f21, f22))
            for x, y in ((s11, s12), (s12, s22))
        ]

        def contraction() -> Term:
            return linear(zip(stress, 2.0 * material.contraction, strict=True), 1.0) ** 0.5

        def stress_across() -> Term:
            factors = np.append(material.across, material.across_modulus)
            return stretch() * linear(zip((*stress, thickening), factors, strict=True))

        stretch = contraction if across is None else lambda: across
        return Stress(plane, (lambda: 0.0) if across is None else stress_across, stretch)
