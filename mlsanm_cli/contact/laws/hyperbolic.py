"""Regularised unilateral contact: the hyperbola (p + eta) h = eta delta, followed along a load path.

Elhage-Hussein, Potier-Ferry and Damil (Int. J. Solids Structures 37, 2000, 6981): the gap under a pressure p
is about eta delta / p, the spurious tension of an open node stays below eta, and the branch h < 0 means
nothing. Unknowns x = (p, h, q); with s from 0 to 1 along the stage and f(s) = f_a + s (f_b - f_a)::

    r1 = (p + eta) h - eta delta
    r2 = h - gap(f, q, p)
    r3 = balance(f, q, p)
"""

from __future__ import annotations

import numpy as np

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.contact.laws.coupling import Coupling, DenseCoupling, DenseTangent, GapTangent, Local
from mlsanm_cli.kernels.hyperbola import hyperbola_orders


class HyperbolicTangent:
    """Factorised tangent."""

    def __init__(self, problem: HyperbolicContact, x: FloatArray) -> None:
        self._problem, law = problem, problem.law
        p, h, _ = problem.split(x)
        local = Local.frictionless((p + law.eta) / law.pressure, h / (law.pressure * law.gap))
        self._factor = problem.coupling.tangent(local)
        self._tangent = GapTangent(problem.coupling, self._factor, local)

    def solve(self, rhs: FloatArray) -> FloatArray:
        """Solution (2m + k,)."""
        p, h, q, _ = self._tangent.solve(*self._problem.split(rhs), np.zeros(0))
        return np.concatenate([p, h, q])


class DenseHyperbolicTangent(HyperbolicTangent):
    """The same over condensed bodies, which goes through the high orders of a series by itself."""

    def orders(
        self, x: FloatArray, lam: FloatArray, slope: FloatArray, normal: FloatArray, size: float
    ) -> None:
        """Fill the orders of a series from 2 on."""
        problem, law, none = self._problem, self._problem.law, np.zeros(0, dtype=np.int64)
        assert isinstance(problem.coupling, DenseCoupling)
        assert isinstance(self._factor, DenseTangent)
        hyperbola_orders(
            x,
            lam,
            slope,
            normal,
            size,
            self._factor.factor.T,
            self._factor.pivots.astype(np.int64),
            problem.coupling.matrix.T,
            problem.m,
            law.pressure * law.gap,
            law.gap,
            none,
            np.zeros(0),
            none,
        )


class HyperbolicContact:
    """The regularised problem over one stage, in the form the continuation driver asks for."""

    def __init__(self, coupling: Coupling, start: FloatArray, end: FloatArray) -> None:
        self.coupling, self.condensed, self.law = coupling, coupling.condensed, coupling.law
        law = self.law
        self.m, self.k = len(self.condensed.weight), len(coupling.motion)
        self.size = 2 * self.m + self.k
        self.start, self.change = start, end - start
        self.scale = np.concatenate(
            [np.full(self.m, law.pressure), np.full(self.m, law.gap), coupling.motion]
        )
        moved = coupling.load @ self.change
        self._load_derivative = np.concatenate([np.zeros(self.m), -moved[: self.m], moved[self.m :]])

    def factors(self, lam: float) -> FloatArray:
        """Load factors (L,) at path parameter ``lam``."""
        return self.start + lam * self.change

    def split(self, x: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Pressures (m,), gaps (m,), motions (k,)."""
        m = self.m
        return x[..., :m], x[..., m : 2 * m], x[..., 2 * m :]

    def residual(self, x: FloatArray, lam: float) -> FloatArray:
        """Dimensionless residual (2m + k,)."""
        p, h, q = self.split(x)
        law, m = self.law, self.m
        linear = self.coupling(self.factors(lam), np.concatenate([p, q]))
        hyperbola = ((p + law.eta) * h - law.eta * law.delta) / (law.pressure * law.gap)
        return np.concatenate([hyperbola, h / law.gap - linear[:m], linear[m:]])

    def tangent(self, x: FloatArray, lam: float) -> HyperbolicTangent:
        """Factorised derivative by x; numpy's LinAlgError where it is singular."""
        if isinstance(self.coupling, DenseCoupling):
            return DenseHyperbolicTangent(self, x)
        return HyperbolicTangent(self, x)

    def load_derivative(self, x: FloatArray, lam: float) -> FloatArray:
        """Derivative by the path parameter (2m + k,)."""
        return self._load_derivative

    def series_rhs(self, x: FloatArray, lam: FloatArray) -> FloatArray:
        """Right-hand side of order k, -sum p_r h_(k-r), from the coefficients (k, 2m + k) of lower orders."""
        rhs = np.zeros(self.size)
        if len(x) > 1:
            p, h, _ = self.split(x[1:])
            rhs[: self.m] = np.einsum("ij,ij->j", p, h[::-1]) / (-self.law.pressure * self.law.gap)
        return rhs

    def admissible(self, x: FloatArray, lam: float) -> bool:
        """Whether every gap is open, that is, the state lies on the meaningful branch."""
        p, h, _ = self.split(x)
        return bool((h > 0.0).all() and (p > -self.law.eta).all())
