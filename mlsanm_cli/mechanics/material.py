"""Plane stiffness of a material."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mlsanm_cli.arrays import FloatArray

LOCKING = 8.0
"""Ratio of Lame's constants, lambda over mu, above which equilibrium is written for nearly incompressible
materials (Poisson's ratio 0.444 in plane strain); it costs two and a half times the fill of the factor."""


@dataclass(frozen=True)
class PlaneMaterial:
    """``stiffness`` (3, 3) between (xx, yy, xy) stresses and (e_xx, e_yy, 2 e_xy); ``out_of_plane`` is the
    ratio sigma_zz / (sigma_xx + sigma_yy); ``contact_modulus`` is the plane modulus E' with 1/E* = sum of
    1/E'."""

    stiffness: FloatArray
    out_of_plane: float
    contact_modulus: float

    @property
    def nearly_incompressible(self) -> bool:
        """Whether equilibrium by second derivatives would lock."""
        return bool(self.stiffness[0, 1] > LOCKING * self.stiffness[2, 2])

    @property
    def bulk_part(self) -> FloatArray:
        """The part (3, 3) of the stiffness that answers to a change of area with equal direct stresses."""
        part = np.zeros((3, 3))
        part[:2, :2] = self.stiffness[0, 1]
        return part


def isotropic(modulus: float, poisson: float, plane: str) -> PlaneMaterial:
    """Isotropic material of Young's ``modulus`` and ``poisson`` ratio in plane "strain" or "stress"."""
    if plane == "strain":
        factor = modulus / ((1.0 + poisson) * (1.0 - 2.0 * poisson))
        direct, cross = factor * (1.0 - poisson), factor * poisson
        out_of_plane, contact = poisson, modulus / (1.0 - poisson**2)
    elif plane == "stress":
        factor = modulus / (1.0 - poisson**2)
        direct, cross = factor, factor * poisson
        out_of_plane, contact = 0.0, modulus
    else:
        raise ValueError(f"plane must be 'strain' or 'stress', not {plane!r}")
    shear = 0.5 * modulus / (1.0 + poisson)
    stiffness = np.array([[direct, cross, 0.0], [cross, direct, 0.0], [0.0, 0.0, shear]])
    return PlaneMaterial(stiffness, out_of_plane, contact)
