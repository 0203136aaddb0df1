"""Isotropic hyperelastic laws by their energy W per undeformed volume.

In the plane, W depends on c = tr(F^T F) and d = det F of the gradient F in the plane, and on the stretch l
across it, with I1 = c + l^2, I2 = d^2 + c l^2, J = d l::

    P = 2 W_c F + W_d cof F            P_33 = W_l
    W_c = W_1 + l^2 W_2        W_d = 2 d W_2 + l W_J        W_l = 2 l (W_1 + c W_2) + d W_J

Isochoric laws depend on I1' = J^(-2/3) I1 and I2' = J^(-4/3) I2; their energy of volume changes is
K (J - 1)^2 / 2. W = W'(I1', I2') contributes::

    W_1 = J^(-2/3) W'_1        W_2 = J^(-4/3) W'_2        W_J = -2/3 (I1' W'_1 + 2 I2' W'_2) / J

U'(J), the part of W_J that grows beyond bounds for nu -> 0.5, is a mean stress: it adds U' J F^-T to P. In
plane stress l solves P_33 = 0. Holzapfel, Nonlinear Solid Mechanics (Wiley 2000), sections 6.2 to 6.5."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import field
from functools import cached_property

import numpy as np

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.mechanics.laws.law import Law, Stress
from mlsanm_cli.mechanics.laws.series import Series, Tape, Term, dot, exp
from mlsanm_cli.mechanics.material import PlaneMaterial, isotropic
from mlsanm_cli.records import dataclass


class Deformation:
    """Elastic deformation: gradient ``f`` 11, 12, 21, 22 in the plane, the ``trace`` c of F^T F and the
    determinant, ``area`` d, of it; the stretch ``across`` the plane and its ``square``; the invariants
    ``first`` I1 and ``second`` I2, ``volume`` J and ``compression`` 1/J."""

    def __init__(self, f: Sequence[Series], across: Term) -> None:
        self.f, self.across, self.square = f, across, across**2
        f11, f12, f21, f22 = f
        self.trace: Term = f11**2 + f12**2 + f21**2 + f22**2
        self.area: Term = f11 * f22 - f12 * f21
        self.volume = self.area * across
        self.compression = 1.0 / self.volume

    @cached_property
    def first(self) -> Term:
        return self.trace + self.square

    @cached_property
    def second(self) -> Term:
        return self.area**2 + self.trace * self.square


@dataclass(frozen=True, kw_only=True)
class Hyperelastic(Law):
    """A law with Poisson's ratio ``nu`` of the undeformed state and coefficient of thermal expansion
    ``alpha``, in ``plane`` "strain" or "stress". Further fields are keys of the case file."""

    plane: str
    nu: float
    alpha: float = field(default=0.0)

    @property
    @abstractmethod
    def shear(self) -> float:
        """Shear modulus of the undeformed state."""

    @abstractmethod
    def plane_slopes(self, e: Deformation) -> tuple[Term, Term]:
        """W_c and W_d without the energy U of volume changes."""

    @abstractmethod
    def stretch_slope(self, e: Deformation) -> Term:
        """W_l without U."""

    @abstractmethod
    def mean_stress(self, e: Deformation) -> Term:
        """U'(J)."""

    @property
    def bulk(self) -> float:
        """Bulk modulus of the undeformed state."""
        return 2.0 * self.shear * (1.0 + self.nu) / (3.0 * (1.0 - 2.0 * self.nu))

    @property
    def nested(self) -> bool:
        """Whether the mean stress of volume changes is differentiated as a nodal field."""
        return self.linear.nearly_incompressible

    @cached_property
    def linear(self) -> PlaneMaterial:  # type: ignore[override]
        """The law of small strains."""
        return isotropic(2.0 * self.shear * (1.0 + self.nu), self.nu, self.plane, self.alpha)

    def incompressible_stress(self, stretches: FloatArray) -> FloatArray:
        """Nominal stress (n,) along the first of ``stretches`` (3, n) of product 1, none along the third."""
        tape = Tape(0, 1, stretches.shape[1])
        f11, f12, f21, f22, across = (tape.input() for _ in range(5))
        for component, values in zip((f11, f22, across), stretches, strict=True):
            component.values[0, 0] = values
        e = Deformation((f11, f12, f21, f22), across)
        by_trace, by_area = (tape.as_series(slope) for slope in self.plane_slopes(e))
        third = tape.as_series(self.stretch_slope(e))
        tape.advance(0)
        slope, area, thickness = (series.values[0, 0] for series in (by_trace, by_area, third))
        one, two, three = stretches
        return np.asarray(2.0 * slope * one + area * two - three / one * thickness)

    def stress_of(self, tape: Tape, f: Sequence[Series], across: Term | None, apart: bool) -> Stress:
        if across is not None:
            e = Deformation(f, across)
            return self._stress(e, lambda: self._across(e, apart), apart)
        thin = []

        def thickness_force(logarithm: Series) -> Series:
            thin.append(Deformation(f, exp(logarithm)))
            return tape.as_series(self._across(thin[0], apart=False))

        tape.root(thickness_force)
        return self._stress(thin[0], lambda: 0.0, apart=False)

    def _across(self, e: Deformation, apart: bool) -> Term:
        slope = self.stretch_slope(e)
        return slope if apart else slope + self.mean_stress(e) * e.area

    def _stress(self, e: Deformation, across: Callable[[], Term], apart: bool) -> Stress:
        by_trace, by_area = self.plane_slopes(e)
        mean = self.mean_stress(e)
        if not apart:
            by_area = by_area + mean * e.across
        by_trace = 2.0 * by_trace
        f11, f12, f21, f22 = e.f
        opposite = -by_area
        plane = [
            dot((by_trace, f11), (by_area, f22)),
            dot((by_trace, f12), (opposite, f21)),
            dot((by_trace, f21), (opposite, f12)),
            dot((by_trace, f22), (by_area, f11)),
        ]
        return Stress(plane, across, lambda: e.across, mean if apart else None)


class ByInvariants(Hyperelastic):
    """A law by its invariants."""

    @abstractmethod
    def invariant_slopes(self, e: Deformation) -> tuple[Term, Term, Term]:
        """W_1, W_2 and W_J without U'."""

    def plane_slopes(self, e: Deformation) -> tuple[Term, Term]:
        first, second, volume = self.invariant_slopes(e)
        return first + e.square * second, 2.0 * (e.area * second) + e.across * volume

    def stretch_slope(self, e: Deformation) -> Term:
        first, second, volume = self.invariant_slopes(e)
        return 2.0 * (e.across * (first + second * e.trace)) + e.area * volume


class Isochoric(ByInvariants):
    """A law by its isochoric invariants, with the energy K (J - 1)^2 / 2 of volume changes."""

    @abstractmethod
    def reduced_slopes(self, first: Term, second: Term) -> tuple[Term, Term]:
        """W'_1 and W'_2 of the isochoric invariants I1', I2'."""

    @property
    def shear(self) -> float:
        first, second = self.reduced_slopes(3.0, 3.0)
        assert isinstance(first, float)
        assert isinstance(second, float)
        return 2.0 * (first + second)

    def mean_stress(self, e: Deformation) -> Term:
        return self.bulk * (e.volume - 1.0)

    def invariant_slopes(self, e: Deformation) -> tuple[Term, Term, Term]:
        scale = e.volume ** (-2.0 / 3.0)
        square = scale**2
        first, second = scale * e.first, square * e.second
        by_first, by_second = self.reduced_slopes(first, second)
        by_volume = e.compression * (first * by_first + 2.0 * (second * by_second)) * (-2.0 / 3.0)
        return scale * by_first, square * by_second, by_volume
