"""Ogden's law."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

import numpy as np

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.mechanics.laws.hyperelastic import Deformation, Hyperelastic
from mlsanm_cli.mechanics.laws.series import Series, Term, analytic
from mlsanm_cli.records import dataclass
from mlsanm_cli.roundoff import LAST_DIGITS


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
        """Shear modulus of the undeformed state."""
        return 0.5 * sum(modulus * exponent for modulus, exponent in self._pairs)

    def mean_stress(self, e: Deformation) -> Term:
        """U'(J)."""
        return self.bulk * (e.volume - 1.0)

    def plane_slopes(self, e: Deformation) -> tuple[Term, Term]:
        """W_c and W_d (:meth:`Hyperelastic.plane_slopes`)."""
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
        """W_l (:meth:`Hyperelastic.stretch_slope`)."""
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


_ZERO: Term = 0.0


def taylor(degree: float, x: FloatArray, count: int) -> FloatArray:
    """The first ``count`` Taylor coefficients (count, n) of T_n, n = ``degree``, about ``x`` (n,) >= 1.

    T_n'' (x^2 - 1) + T_n' x = n^2 T_n gives a recurrence in three of them, of which they are the minimal
    solution: ratios of neighbours follow backwards, as a continued fraction (Gautschi 1967,
    doi:10.1137/1009002)."""
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


LAW = Ogden
