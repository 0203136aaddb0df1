"""Hyperelastic laws of rubber and foams, by their energy."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial

import numpy as np

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.mechanics.laws.hyperelastic import ByInvariants, Deformation, Hyperelastic, Isochoric
from mlsanm_cli.mechanics.laws.series import Series, Term, analytic, log
from mlsanm_cli.records import dataclass
from mlsanm_cli.roundoff import LAST_DIGITS

_ZERO: Term = 0.0


@dataclass(frozen=True, kw_only=True)
class NeoHookean(ByInvariants):
    """W = mu/2 (I1 - 3) - mu ln J + lam/2 (ln J)^2 with Young's modulus ``E`` (Bonet and Wood, Nonlinear
    Continuum Mechanics for Finite Element Analysis, section 6.4.3)."""

    name = "neo-hookean"
    E: float

    @property
    def shear(self) -> float:
        return 0.5 * self.E / (1.0 + self.nu)

    def invariant_slopes(self, e: Deformation) -> tuple[Term, Term, Term]:
        return 0.5 * self.shear, 0.0, -self.shear * e.compression

    def mean_stress(self, e: Deformation) -> Term:
        lam = self.bulk - self.shear * (2.0 / 3.0)
        return lam * (log(e.volume) * e.compression)


@dataclass(frozen=True, kw_only=True)
class MooneyRivlin(Isochoric):
    """W' = c10 (I1' - 3) + c01 (I2' - 3) (Rivlin 1948, doi:10.1098/rsta.1948.0024)."""

    name = "mooney-rivlin"
    c10: float
    c01: float

    def reduced_slopes(self, first: Term, second: Term) -> tuple[Term, Term]:
        return self.c10, self.c01


@dataclass(frozen=True, kw_only=True)
class Yeoh(Isochoric):
    """W' = c10 y + c20 y^2 + c30 y^3, y = I1' - 3 (Yeoh 1993, doi:10.5254/1.3538343)."""

    name = "yeoh"
    c10: float
    c20: float
    c30: float

    def reduced_slopes(self, first: Term, second: Term) -> tuple[Term, Term]:
        y = first - 3.0
        return self.c10 + y * (2.0 * self.c20 + 3.0 * self.c30 * y), 0.0


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
        slope: Term = 0.0
        for power in range(len(LANGEVIN), 0, -1):
            factor = self.mu * power * LANGEVIN[power - 1] / self.locking_stretch ** (2 * power - 2)
            slope = factor + slope * first
        return slope, 0.0


@dataclass(frozen=True, kw_only=True)
class BlatzKo(ByInvariants):
    """W = f mu/2 (I1 - 3 + (J^-2b - 1)/b) + (1 - f) mu/2 (I2/J^2 - 3 + (J^2b - 1)/b) with b = nu/(1 - 2 nu)
    and Young's modulus ``E`` (Blatz and Ko 1962, doi:10.1122/1.548937). Foams have ``f`` = 0 and nu = 1/4."""

    name = "blatz-ko"
    E: float
    f: float = 0.0

    @property
    def shear(self) -> float:
        return 0.5 * self.E / (1.0 + self.nu)

    def invariant_slopes(self, e: Deformation) -> tuple[Term, Term, Term]:
        solid, foam = 0.5 * self.f * self.shear, 0.5 * (1.0 - self.f) * self.shear
        square = e.compression**2
        by_volume = -2.0 * foam * (e.second * (square * e.compression)) if foam else 0.0
        return solid, foam * square if foam else 0.0, by_volume

    def mean_stress(self, e: Deformation) -> Term:
        power, total = 2.0 * self.nu / (1.0 - 2.0 * self.nu), _ZERO
        if self.f < 1.0:
            total = (1.0 - self.f) * self.shear * e.volume ** (power - 1.0)
        if self.f > 0.0:
            total = total - self.f * self.shear * e.volume ** (-power - 1.0)
        return total


@dataclass(frozen=True, kw_only=True)
class Ogden(Hyperelastic):
    """W' = sum_p m_p/a_p (l1'^a_p + l2'^a_p + l3'^a_p - 3) of isochoric principal stretches l' = J^(-1/3) l
    with ``shear_moduli`` m and ``exponents`` a (Ogden 1972, doi:10.1098/rspa.1972.0026), and K (J - 1)^2 / 2.

    In the plane, with x = c / (2 d) and Chebyshev functions T, the principal stretches enter by::

        l1^a + l2^a = 2 d^(a/2) T_(a/2)(x)            T_n(x) = cosh(n arcosh x)

    T is analytic at x = 1, where principal stretches are equal and have no derivatives."""

    name = "ogden"
    shear_moduli: Sequence[float]
    exponents: Sequence[float]

    @property
    def _pairs(self) -> list[tuple[float, float]]:
        return list(zip(self.shear_moduli, self.exponents, strict=True))

    @property
    def shear(self) -> float:
        return 0.5 * sum(modulus * exponent for modulus, exponent in self._pairs)

    def mean_stress(self, e: Deformation) -> Term:
        return self.bulk * (e.volume - 1.0)

    def plane_slopes(self, e: Deformation) -> tuple[Term, Term]:
        over, by_trace, by_area = 1.0 / e.area, _ZERO, _ZERO
        x = e.trace * over * 0.5
        for (modulus, a), (value, slope) in zip(self._pairs, self._of_stretches(x), strict=True):
            shrinking = modulus / a * e.volume ** (-a / 3.0)
            scale = shrinking * e.area ** (0.5 * a)
            whole = 2.0 * (scale * value) + shrinking * e.across**a
            by_trace = by_trace + scale * slope
            by_area = by_area + scale * (a * value - 2.0 * (slope * x)) - a / 3.0 * whole
        return by_trace * over, by_area * over

    def stretch_slope(self, e: Deformation) -> Term:
        found, x = _ZERO, e.trace / e.area * 0.5
        for (modulus, a), (value, _) in zip(self._pairs, self._of_stretches(x), strict=True):
            shrinking = modulus * e.volume ** (-a / 3.0)
            plane, across = 2.0 * (value * e.area ** (0.5 * a)), e.across**a
            found = found + shrinking * (2.0 / 3.0 * across - 1.0 / 3.0 * plane)
        return found / e.across

    def _of_stretches(self, x: Term) -> list[tuple[Series, Series]]:
        """T_(a/2) and its derivative for all exponents a."""
        assert isinstance(x, Series)
        functions = [partial(kind, 0.5 * a) for _, a in self._pairs for kind in (taylor, taylor_of_slope)]
        found = analytic(x, *functions)
        return list(zip(found[::2], found[1::2], strict=True))


def taylor(degree: float, x: FloatArray, count: int) -> FloatArray:
    """The first ``count`` Taylor coefficients (count, n) of T_n, n = ``degree``, about ``x`` (n,) >= 1:
    minimal solutions of the recurrence by T_n'' (x^2 - 1) + T_n' x = n^2 T_n, with ratios by a continued
    fraction (Gautschi 1967, doi:10.1137/1009002)."""
    # Round-off of equal stretches.
    x = np.maximum(x, 1.0)
    shrinking = float(((x - 1.0) / (x + 1.0)).max(initial=0.5))
    last = count + int(np.log(LAST_DIGITS) / np.log(shrinking)) + 1
    ratio = -1.0 / (x + 1.0)
    ratios = np.empty((count - 1, len(x)))
    for m in range(last, -1, -1):
        ratio = (degree**2 - m**2) / (m + 1.0) / (x * (2 * m + 1) + (x**2 - 1.0) * (m + 2) * ratio)
        if m < len(ratios):
            ratios[m] = ratio
    first = np.cosh(degree * np.arccosh(x))
    return np.concatenate([first[None], first * np.cumprod(ratios, axis=0)])


def taylor_of_slope(degree: float, x: FloatArray, count: int) -> FloatArray:
    """The first ``count`` coefficients (count, n) of the derivative of T_n, likewise."""
    return np.arange(1.0, count + 1.0)[:, None] * taylor(degree, x, count + 1)[1:]


LAWS: Mapping[str, type[Hyperelastic]] = {
    law.name: law for law in (NeoHookean, MooneyRivlin, Yeoh, ArrudaBoyce, BlatzKo, Ogden)
}
"""The laws by their names in case files."""
