"""Regularised unilateral contact: the hyperbola (p + eta) h = eta delta, followed along a load path.

Elhage-Hussein, Potier-Ferry and Damil (Int. J. Solids Structures 37, 2000, 6981): the gap under a pressure p
is about eta delta / p, the spurious tension of an open node stays below eta, and the branch h < 0 means
nothing. Unknowns x = (p, h, q); with s from 0 to 1 along the stage and f(s) = f_a + s (f_b - f_a)::

    r1 = (p + eta) h - eta delta
    r2 = h - gap(f, q, p)
    r3 = balance(f, q, p)
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import scipy.linalg as linalg

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.contact.condensed import Condensed
from mlsanm_cli.kernels.hyperbola import hyperbola_orders


@dataclass(frozen=True)
class Regularization:
    """``eta`` (m,) pressures, ``delta`` (m,) lengths, and the reference pressure, gap, force and motion that
    scale residuals and unknowns; with friction a reference ``slip`` and the asperities' softness ``creep``
    (n,), a length per traction."""

    eta: FloatArray
    delta: FloatArray
    pressure: float
    gap: float
    force: FloatArray
    motion: FloatArray
    slip: float = 0.0
    creep: FloatArray = field(default_factory=lambda: np.zeros(0))
    threshold: FloatArray = field(default_factory=lambda: np.zeros(0))


class HyperbolicTangent:
    """Factorised tangent; gaps are eliminated, so only a dense (m + k) system is factorised."""

    def __init__(self, problem: HyperbolicContact, x: FloatArray) -> None:
        self._problem = problem
        p, h, _ = problem.split(x)
        balance = problem.condensed.balance
        m, k = problem.m, problem.k
        self._stress = p + problem.law.eta
        matrix = np.empty((m + k, m + k), order="F")
        np.multiply(problem.rows, self._stress[:, None], out=matrix[:m])
        matrix[np.arange(m), np.arange(m)] += h
        matrix[m:, :m] = balance.pressure / problem.law.force[:, None]
        matrix[m:, m:] = balance.motion / problem.law.force[:, None]
        matrix[:m] /= problem.law.pressure * problem.law.gap
        self._factor, self._pivots, info = linalg.lapack.dgetrf(matrix, overwrite_a=1)
        if info != 0:
            raise np.linalg.LinAlgError("singular tangent of the contact problem")

    def solve(self, rhs: FloatArray) -> FloatArray:
        """Solution (2m + k,)."""
        problem, m = self._problem, self._problem.m
        scale = problem.law.gap
        shift = rhs[m : 2 * m] * scale
        reduced = np.concatenate(
            [rhs[:m] - self._stress * shift / (problem.law.pressure * scale), rhs[2 * m :]]
        )
        solution, _ = linalg.lapack.dgetrs(self._factor, self._pivots, reduced, overwrite_b=1)
        p, q = solution[:m], solution[m:]
        h = shift + problem.rows @ solution
        return np.concatenate([p, h, q])

    def orders(
        self, x: FloatArray, lam: FloatArray, slope: FloatArray, normal: FloatArray, size: float
    ) -> None:
        """Fill the orders of a series from 2 on."""
        problem, law, none = self._problem, self._problem.law, np.zeros(0, dtype=np.int64)
        hyperbola_orders(
            x,
            lam,
            slope,
            normal,
            size,
            self._factor.T,
            self._pivots.astype(np.int64),
            problem.rows.T,
            problem.m,
            law.pressure * law.gap,
            1.0,
            none,
            np.zeros(0),
            none,
        )


class HyperbolicContact:
    """The regularised problem over one stage, in the form the continuation driver asks for."""

    def __init__(self, condensed: Condensed, law: Regularization, start: FloatArray, end: FloatArray) -> None:
        self.condensed = condensed
        self.law = law
        self.m = len(condensed.weight)
        self.k = len(condensed.balance.constant)
        self.size = 2 * self.m + self.k
        self.start = start
        self.change = end - start
        self.scale = np.concatenate([np.full(self.m, law.pressure), np.full(self.m, law.gap), law.motion])
        gap, balance = condensed.gap, condensed.balance
        self.rows = np.asfortranarray(np.hstack([gap.pressure, gap.motion]))
        self._load_derivative = np.concatenate(
            [np.zeros(self.m), -(gap.load @ self.change) / law.gap, (balance.load @ self.change) / law.force]
        )

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
        f = self.factors(lam)
        law = self.law
        hyperbola = ((p + law.eta) * h - law.eta * law.delta) / (law.pressure * law.gap)
        gap = (h - self.condensed.gap(f, q, p)) / law.gap
        return np.concatenate([hyperbola, gap, self.condensed.balance(f, q, p) / law.force])

    def tangent(self, x: FloatArray, lam: float) -> HyperbolicTangent:
        """Factorised derivative by x; numpy's LinAlgError where it is singular."""
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
