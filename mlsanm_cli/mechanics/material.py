"""Plane elasticity of a material, with thermal expansion. Isotropic and orthotropic materials are reduced
from three dimensions to the plane; a plane stiffness given directly leaves the out-of-plane stress unknown,
nan in plane strain. Bodies of revolution have the hoop stress as a fourth component."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.records import dataclass

LOCKING_RATIO = 8.0
"""Ratio lambda / mu above which the formulation for nearly incompressible materials is used."""


ROOT_DIGITS = 5
"""Digits of results from characteristic roots: double roots are accurate to half of all digits."""


@dataclass(frozen=True)
class PlaneMaterial:
    """``stiffness`` (3, 3) between stresses (xx, yy, xy) and strains (e_xx, e_yy, 2 e_xy) in the plane, and
    ``free_expansion`` (4,), the strains xx, yy, 2 xy, zz of a free body per degree.

    Stress across the plane is ``across`` (3,) times the stress in the plane, plus ``across_modulus`` times
    the mechanical strain zz; both vanish in plane stress, where that strain is ``contraction`` (3,) times the
    stress in the plane. Unknown constants are nan. In bodies of revolution ``stiffness`` is (4, 4), with the
    hoop stress and strain last, and strains per degree are those of a free body. A material that ``flows``
    may strain plastically beyond its elasticity."""

    stiffness: FloatArray
    across: FloatArray
    free_expansion: FloatArray
    across_modulus: float
    contraction: FloatArray
    flows: bool = False

    @cached_property
    def expansion(self) -> FloatArray:
        """Strains (3,) xx, yy, 2 xy per degree of a body free in the plane; with the hoop strain (4,)."""
        if self.revolved:
            return self.free_expansion
        own, thickening = self.free_expansion[:3], float(self.free_expansion[3])
        return own + self.across * thickening if thickening else own

    @property
    def stress_of_expansion(self) -> FloatArray:
        """Stress (3 | 4,) of free thermal expansion by one degree, to be subtracted."""
        return np.asarray(self.stiffness @ self.expansion)

    @property
    def revolved(self) -> bool:
        """Whether stresses have a hoop component."""
        return len(self.stiffness) == 4

    @property
    def in_plane(self) -> FloatArray:
        """Stiffness (3, 3) of xx, yy and xy without strain across the plane."""
        return self.stiffness[:3, :3]

    @property
    def across_heat(self) -> float:
        """Stress across the plane per degree where there is none in the plane."""
        return -self.across_modulus * float(self.free_expansion[3])

    @property
    def coupling(self) -> FloatArray:
        """Stress (3,) in the plane by a unit strain across it."""
        return np.asarray(self.in_plane @ self.across)

    @cached_property
    def modulus(self) -> float:
        """C_xx averaged over all directions; scales rows."""
        c = self.stiffness
        return float(3.0 * (c[0, 0] + c[1, 1]) + 2.0 * c[0, 1] + 4.0 * c[2, 2]) / 8.0

    @cached_property
    def shear(self) -> float:
        """Lame's mu; for an anisotropic material half the second of the three principal stiffnesses."""
        root = np.array([1.0, 1.0, np.sqrt(2.0)])
        return 0.5 * float(np.linalg.eigvalsh(self.in_plane * np.outer(root, root))[1])

    @cached_property
    def _first(self) -> float:
        """Lame's lambda: stiffness against uniform area change minus ``shear``."""
        area = np.array([1.0, 1.0, 0.0])
        return float(1.0 / (area @ np.linalg.solve(self.in_plane, area))) - self.shear

    @property
    def roots(self) -> NDArray[np.complex128]:
        """The two characteristic roots with positive imaginary parts."""
        a = np.linalg.inv(self.in_plane)
        found = np.roots([a[0, 0], -2.0 * a[0, 2], 2.0 * a[0, 1] + a[2, 2], -2.0 * a[1, 2], a[1, 1]])
        return np.asarray(found[found.imag > 0.0], dtype=np.complex128)

    @cached_property
    def stretch(self) -> float:
        """Factor >= 1 by which stresses, functions of x + root y with the characteristic roots (Lekhnitskii
        1963), vary faster in space than in an isotropic material: the larger (1 + |t|) / (1 - |t|) with t =
        (1 + i root) / (1 - i root), independent of the axes."""
        size = np.abs((1.0 + 1j * self.roots) / (1.0 - 1j * self.roots))
        return float(((1.0 + size) / (1.0 - size)).max(initial=1.0).round(ROOT_DIGITS))

    @property
    def nearly_incompressible(self) -> bool:
        """Whether equilibrium by second derivatives would lock."""
        return self._first > LOCKING_RATIO * self.shear

    @property
    def bulk_part(self) -> FloatArray:
        """Part of the stiffness that relates the change of area, or of volume, to equal direct stresses."""
        direct = np.array([1.0, 1.0, 0.0, 1.0])[: len(self.stiffness)]
        return self._first * np.outer(direct, direct)

    @cached_property
    def surface_compliance(self) -> FloatArray:
        """Tensor M (2, 2) of the surface displacement -M f log(r) / pi by line forces f, whatever the
        orientation; 2/E' for an isotropic material. M = s_11 [b d; d e], b = Im(p + q), d = Im(p q), e = Im(p
        q (p + q)*) with the roots p, q and the compliance s (Ting, Anisotropic Elasticity, 1996, ISBN
        9780195074475)."""
        sums, product = self.roots.sum(), self.roots.prod()
        b, d, e = sums.imag, product.imag, (product * np.conj(sums)).imag
        return np.asarray(np.linalg.inv(self.in_plane)[0, 0] * np.array([[b, d], [d, e]]))

    def contact_compliance(self, direction: FloatArray, force: FloatArray | None = None) -> FloatArray:
        """1/E' (m,) of a half-plane's surface along unit vectors ``direction`` (m, 2) due to forces along
        them, or along ``force`` (m, 2): n M n / 2."""
        by = direction if force is None else force
        return np.asarray(0.5 * np.einsum("mi,ij,mj->m", direction, self.surface_compliance, by))

    def out_of_plane_stress(self, stress: FloatArray, temperature: FloatArray | float = 0.0) -> FloatArray:
        """sigma_zz (n,), or the hoop stress, for ``stress`` (n, 3 | 4) and a ``temperature`` change."""
        if self.revolved:
            return stress[:, 3]
        # An unknown (nan) expansion does not matter where nothing is heated.
        heat = np.where(temperature, self.across_heat * np.asarray(temperature), 0.0)
        return np.asarray(stress @ self.across + heat)

    def strain(self, stress: FloatArray, temperature: float | FloatArray = 0.0) -> FloatArray:
        """Plane strains xx, yy, xy (n, 3) for ``stress`` (n, 3 | 4) and a ``temperature`` change."""
        found = np.linalg.solve(self.stiffness, stress.T).T + np.multiply.outer(temperature, self.expansion)
        # Stiffness and expansion use the engineering shear strain.
        return np.asarray(found[:, :3] * np.array([1.0, 1.0, 0.5]), dtype=np.float64)

    @property
    def of_revolution(self) -> PlaneMaterial:
        """The material, that of plane strain, in bodies of revolution."""
        hoop = self.coupling
        across = self.across @ hoop + self.across_modulus
        return replace(self, stiffness=np.block([[self.stiffness, hoop[:, None]], [hoop, across]]))


def isotropic(modulus: float, poisson: float, plane: str, expansion: float = 0.0) -> PlaneMaterial:
    """Isotropic material with Young's ``modulus``, ``poisson`` ratio and ``expansion`` per degree."""
    strain = plane == "strain"
    if strain:
        cross = modulus * poisson / ((1.0 + poisson) * (1.0 - 2.0 * poisson))
        direct = cross + modulus / (1.0 + poisson)
    else:
        direct = modulus / (1.0 - poisson**2)
        cross = direct * poisson
    shear = 0.5 * modulus / (1.0 + poisson)
    stiffness = np.array([[direct, cross, 0.0], [cross, direct, 0.0], [0.0, 0.0, shear]])
    even, none = np.array([1.0, 1.0, 0.0]), np.zeros(3)
    free = expansion * np.array([1.0, 1.0, 0.0, 1.0])
    if strain:
        return PlaneMaterial(stiffness, poisson * even, free, modulus, none)
    return PlaneMaterial(stiffness, none, free, 0.0, -poisson / modulus * even)


def orthotropic(
    moduli: Sequence[float],
    poisson: Sequence[float],
    shear: float,
    angle: float,
    plane: str,
    expansion: Sequence[float] = (0.0, 0.0, 0.0),
) -> PlaneMaterial:
    """Orthotropic material with axes 1, 2 in the plane, 1 rotated by ``angle`` (radians) from x.

    ``moduli`` are E1, E2, E3, ``poisson`` nu12, nu13, nu23 with nu_ij / E_i = nu_ji / E_j, ``shear`` is G12,
    ``expansion`` along the axes per degree. Plane stress ignores axis 3; plane strain eliminates the strain
    along it::

        S'_ij = S_ij - S_i3 S_j3 / S_33        a'_i = a_i - S_i3 a_3 / S_33
        sigma_33 = -(S_3i sigma_i + a_3 dT) / S_33
    """
    e1, e2, e3 = moduli
    nu12, nu13, nu23 = poisson
    compliance = np.array([[1.0 / e1, -nu12 / e1, 0.0], [-nu12 / e1, 1.0 / e2, 0.0], [0.0, 0.0, 1.0 / shear]])
    coupling, across = np.array([-nu13 / e1, -nu23 / e2, 0.0]), np.zeros(3)
    if plane == "strain":
        across = -e3 * coupling
        compliance = compliance - e3 * np.outer(coupling, coupling)
    c, s = np.cos(angle), np.sin(angle)
    # Rotation of strains (e_xx, e_yy, 2 e_xy) from the axes; its transpose rotates stresses back.
    turn = np.array([[c * c, s * s, -c * s], [s * s, c * c, c * s], [2.0 * c * s, -2.0 * c * s, c**2 - s**2]])
    back = np.linalg.inv(turn)
    stiffness = back.T @ np.linalg.inv(compliance) @ back
    stiffness, free = 0.5 * (stiffness + stiffness.T), np.array([expansion[0], expansion[1], 0.0])
    free = np.append(turn @ free, expansion[2])
    if plane == "strain":
        return PlaneMaterial(stiffness, turn @ across, free, e3, np.zeros(3))
    return PlaneMaterial(stiffness, across, free, 0.0, turn @ coupling)


def anisotropic(
    stiffness: FloatArray, plane: str, expansion: Sequence[float] = (0.0, 0.0, 0.0)
) -> PlaneMaterial:
    """Material with the given plane ``stiffness`` (3, 3) and plane strains ``expansion`` (3,) per degree."""
    confined, unknown = plane == "strain", np.full(3, np.nan)
    across, contraction = (unknown, np.zeros(3)) if confined else (np.zeros(3), unknown)
    free, symmetric = np.append(expansion, 0.0), 0.5 * (stiffness + stiffness.T)
    return PlaneMaterial(symmetric, across, free, np.nan if confined else 0.0, contraction)
