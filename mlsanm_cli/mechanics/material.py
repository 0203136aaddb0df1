"""Plane elasticity of a material, with its thermal expansion.

Isotropic and orthotropic materials are known in space and reduced to the plane; a plane stiffness given as
such says nothing about the stress across the plane, which then is nan in plane strain.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.mechanics.half_plane import surface_compliance

INCOMPRESSIBLE_RATIO = 8.0
"""Ratio of Lame's constants, lambda over mu, above which the mean pressure is a nodal field (Poisson's ratio
0.444 in plane strain); the fill of the factor is then two and a half times as large."""


ROOT_DIGITS = 5
"""Digits of the roots of a characteristic equation: equal ones are found to half of all digits."""


@dataclass(frozen=True)
class PlaneMaterial:
    """``stiffness`` (3, 3) between (xx, yy, xy) stresses and (e_xx, e_yy, 2 e_xy).

    Per degree of temperature a free body takes the plane strains ``expansion`` (3,). The stress across the
    plane is ``across`` (3,) times the plane stresses plus ``across_heat`` per degree.
    """

    stiffness: FloatArray
    across: FloatArray
    expansion: FloatArray
    across_heat: float

    @cached_property
    def modulus(self) -> float:
        """The stiffness C_xx, averaged over all directions of x: what scales rows."""
        c = self.stiffness
        return float(3.0 * (c[0, 0] + c[1, 1]) + 2.0 * c[0, 1] + 4.0 * c[2, 2]) / 8.0

    @cached_property
    def shear(self) -> float:
        """Lame's mu; of an anisotropic material half the second of the three principal stiffnesses."""
        root = np.array([1.0, 1.0, np.sqrt(2.0)])
        return 0.5 * float(np.linalg.eigvalsh(self.stiffness * np.outer(root, root))[1])

    @cached_property
    def _first(self) -> float:
        """Lame's lambda: what an even change of area meets beyond ``shear``."""
        area = np.array([1.0, 1.0, 0.0])
        return float(1.0 / (area @ np.linalg.solve(self.stiffness, area))) - self.shear

    @cached_property
    def stretch(self) -> float:
        """How much faster than in an isotropic material stresses may change from place to place, at least 1.

        They are functions of x + root y, by the two roots of the characteristic equation (Lekhnitskii 1963):
        isotropic ones of coordinates in which one direction is so many times as long. Whichever way x points,
        this is (1 + |t|) / (1 - |t|) with t = (1 + i root) / (1 - i root), the larger of both.
        """
        a = np.linalg.inv(self.stiffness)
        found = np.roots([a[0, 0], -2.0 * a[0, 2], 2.0 * a[0, 1] + a[2, 2], -2.0 * a[1, 2], a[1, 1]])
        roots = found[found.imag > 0.0]
        size = np.abs((1.0 + 1j * roots) / (1.0 - 1j * roots))
        return float(((1.0 + size) / (1.0 - size)).max(initial=1.0).round(ROOT_DIGITS))

    @property
    def nearly_incompressible(self) -> bool:
        """Whether equilibrium by second derivatives would lock."""
        return self._first > INCOMPRESSIBLE_RATIO * self.shear

    @property
    def bulk_part(self) -> FloatArray:
        """The part (3, 3) of the stiffness that answers to a change of area with equal direct stresses."""
        part = np.zeros((3, 3))
        part[:2, :2] = self._first
        return part

    @cached_property
    def _surface(self) -> FloatArray:
        return surface_compliance(self.stiffness)

    def contact_compliance(self, direction: FloatArray, force: FloatArray | None = None) -> FloatArray:
        """1/E' (m,) of a half-plane's surface along unit vectors ``direction`` (m, 2), by forces that way or
        along ``force`` (m, 2); 1/E* is the sum of two bodies'."""
        by = direction if force is None else force
        result: FloatArray = 0.5 * np.einsum("mi,ij,mj->m", direction, self._surface, by)
        return result

    def out_of_plane_stress(self, stress: FloatArray, temperature: FloatArray | float = 0.0) -> FloatArray:
        """sigma_zz (n,) with plane ``stress`` (n, 3) after a change of ``temperature``, one or (n,)."""
        # Where nothing is heated, an expansion that is not known does not matter.
        heat = np.where(temperature, self.across_heat * np.asarray(temperature), 0.0)
        result: FloatArray = stress @ self.across + heat
        return result

    def strain(self, stress: FloatArray, temperature: float | FloatArray = 0.0) -> FloatArray:
        """Strains (n, 3) in the plane, xx, yy, xy, of ``stress`` (n, 3) and a change of ``temperature``, one
        number or (n,)."""
        found = np.linalg.solve(self.stiffness, stress.T).T + np.multiply.outer(temperature, self.expansion)
        # Stiffnesses and expansions know twice the shear strain.
        return np.asarray(found * np.array([1.0, 1.0, 0.5]), dtype=np.float64)


def isotropic(modulus: float, poisson: float, plane: str, expansion: float = 0.0) -> PlaneMaterial:
    """Isotropic material of Young's ``modulus``, ``poisson`` ratio and ``expansion`` per degree."""
    strain = _is_strain(plane)
    if strain:
        factor = modulus / ((1.0 + poisson) * (1.0 - 2.0 * poisson))
        direct, cross = factor * (1.0 - poisson), factor * poisson
    else:
        factor = modulus / (1.0 - poisson**2)
        direct, cross = factor, factor * poisson
    shear = 0.5 * modulus / (1.0 + poisson)
    stiffness = np.array([[direct, cross, 0.0], [cross, direct, 0.0], [0.0, 0.0, shear]])
    even = np.array([1.0, 1.0, 0.0])
    if strain:
        free = (1.0 + poisson) * expansion * even
        return PlaneMaterial(stiffness, poisson * even, free, -modulus * expansion)
    return PlaneMaterial(stiffness, np.zeros(3), expansion * even, 0.0)


def orthotropic(
    moduli: Sequence[float],
    poisson: Sequence[float],
    shear: float,
    angle: float,
    plane: str,
    expansion: Sequence[float] = (0.0, 0.0, 0.0),
) -> PlaneMaterial:
    """Orthotropic material whose axes 1, 2 lie in the plane, 1 turned by ``angle`` (radian) from x.

    ``moduli`` are E1, E2, E3, ``poisson`` nu12, nu13, nu23 with nu_ij / E_i = nu_ji / E_j, ``shear`` is G12,
    ``expansion`` along the axes per degree. Plane stress does not look at axis 3. In plane strain the strain
    along axis 3 is eliminated::

        S'_ij = S_ij - S_i3 S_j3 / S_33        a'_i = a_i - S_i3 a_3 / S_33
        sigma_33 = -(S_3i sigma_i + a_3 dT) / S_33
    """
    e1, e2, e3 = moduli
    nu12, nu13, nu23 = poisson
    compliance = np.array([[1.0 / e1, -nu12 / e1, 0.0], [-nu12 / e1, 1.0 / e2, 0.0], [0.0, 0.0, 1.0 / shear]])
    free, across, heat = np.array([expansion[0], expansion[1], 0.0]), np.zeros(3), 0.0
    if _is_strain(plane):
        coupling = np.array([-nu13 / e1, -nu23 / e2, 0.0])
        across, heat = -e3 * coupling, -e3 * expansion[2]
        compliance = compliance - e3 * np.outer(coupling, coupling)
        free = free - e3 * coupling * expansion[2]
    c, s = np.cos(angle), np.sin(angle)
    # Strains (e_xx, e_yy, 2 e_xy) from those along the axes; its transpose turns stresses the other way.
    turn = np.array([[c * c, s * s, -c * s], [s * s, c * c, c * s], [2.0 * c * s, -2.0 * c * s, c**2 - s**2]])
    back = np.linalg.inv(turn)
    stiffness = back.T @ np.linalg.inv(compliance) @ back
    return PlaneMaterial(0.5 * (stiffness + stiffness.T), turn @ across, turn @ free, heat)


def anisotropic(
    stiffness: FloatArray, plane: str, expansion: Sequence[float] = (0.0, 0.0, 0.0)
) -> PlaneMaterial:
    """A plane ``stiffness`` (3, 3) as it is, with the plane strains ``expansion`` (3,) per degree."""
    unknown = np.nan if _is_strain(plane) else 0.0
    return PlaneMaterial(0.5 * (stiffness + stiffness.T), np.full(3, unknown), np.array(expansion), unknown)


def _is_strain(plane: str) -> bool:
    if plane not in ("strain", "stress"):
        raise ValueError(f"plane must be 'strain' or 'stress', not {plane!r}")
    return plane == "strain"
