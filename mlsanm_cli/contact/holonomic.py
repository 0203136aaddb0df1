"""Regularised contact with friction that depends on the total slip alone: for loads that never turn back.

The hyperbola (p + eta) h = eta delta and, with the total slip s of a node and a small slip e,
t sqrt(s^2 + e^2) = -mu (p + eta) s. An auxiliary unknown r makes it quadratic. x = (p, h, q, t, r)::

    r1 = (p + eta) h - eta delta
    r2 = h - gap(f, q, p, t)
    r3 = balance(f, q, p, t)
    r4 = t r + mu (p + eta) s(f, q, p, t)
    r5 = r^2 - s(f, q, p, t)^2 - e^2

Tractions may pass mu p by mu eta, and a turning load is answered as if the slip had been elastic.
"""

from __future__ import annotations

import numpy as np
import scipy.linalg as linalg

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.contact.condensed import Condensed
from mlsanm_cli.contact.hyperbolic import Regularization


class HolonomicTangent:
    """Factorised tangent; gaps and auxiliary unknowns are eliminated."""

    def __init__(self, problem: HolonomicContact, x: FloatArray, lam: float) -> None:
        c, law, m, n, k = problem.condensed, problem.law, problem.m, problem.n, problem.k
        p, h, _, t, r = problem.split(x)
        s = problem.slip(x, lam)
        self._problem, self._stress, self._r = problem, p + law.eta, r
        self._s, self._pull = s, t / r
        # d(r4) = r dt + mu s dp + lever ds, after r dr = s ds.
        lever = self._pull * s + c.friction * self._stress[c.rubbing]
        self._lever = lever
        matrix = np.empty((m + n + k, m + n + k))
        gap, slip, balance = c.gap, c.slip, c.balance
        matrix[:m] = self._stress[:, None] * np.hstack([gap.pressure, gap.traction, gap.motion])
        matrix[np.arange(m), np.arange(m)] += h
        matrix[:m] /= law.pressure * law.gap
        rows = np.arange(m, m + n)
        matrix[m : m + n] = lever[:, None] * np.hstack([slip.pressure, slip.traction, slip.motion])
        matrix[rows, rows] += r
        matrix[rows, c.rubbing] += c.friction * s
        matrix[m : m + n] /= problem.work[:, None]
        matrix[m + n :] = np.hstack([balance.pressure, balance.traction, balance.motion])
        matrix[m + n :] /= law.force[:, None]
        # Pivots are chosen among the unknowns, whose units are unlike.
        matrix *= problem.columns
        self._factor, self._pivots, info = linalg.lapack.dgetrf(matrix.T, overwrite_a=1)
        if info != 0:
            raise np.linalg.LinAlgError("singular tangent of the contact problem")

    def solve(self, rhs: FloatArray) -> FloatArray:
        """Solution (2m + k + 2n,)."""
        problem, law, c = self._problem, self._problem.law, self._problem.condensed
        m, n = problem.m, problem.n
        one, two, three, four, five = problem.split(rhs)
        shift, known = two * law.gap, five * law.slip**2 / (2.0 * self._r)
        reduced = np.concatenate(
            [
                one - self._stress * shift / (law.pressure * law.gap),
                four - self._pull * self._r * known / problem.work,
                three,
            ]
        )
        solution, _ = linalg.lapack.dgetrs(self._factor, self._pivots, reduced, trans=1, overwrite_b=1)
        solution *= problem.columns
        p, t, q = solution[:m], solution[m : m + n], solution[m + n :]
        h = shift + c.gap.pressure @ p + c.gap.traction @ t + c.gap.motion @ q
        s = c.slip.pressure @ p + c.slip.traction @ t + c.slip.motion @ q
        return np.concatenate([p, h, q, t, known + self._s * s / self._r])


class HolonomicContact:
    """The problem over one stage, in the form the continuation driver asks for."""

    def __init__(self, condensed: Condensed, law: Regularization, start: FloatArray, end: FloatArray) -> None:
        self.condensed, self.law, self.start, self.change = condensed, law, start, end - start
        self.m, self.k, self.n = (len(v) for v in (condensed.weight, law.motion, condensed.rubbing))
        self.size = 2 * self.m + self.k + 2 * self.n
        limit = condensed.friction * law.pressure
        self.small: FloatArray = law.creep * limit
        self.work: FloatArray = limit * law.slip
        slips = np.full(self.n, law.slip)
        self.columns = np.concatenate([np.full(self.m, law.pressure), limit, law.motion])
        self.scale = np.concatenate(
            [np.full(self.m, law.pressure), np.full(self.m, law.gap), law.motion, limit, slips]
        )

    def factors(self, lam: float) -> FloatArray:
        """Load factors (L,) at path parameter ``lam``."""
        return self.start + lam * self.change

    def split(self, x: FloatArray) -> tuple[FloatArray, ...]:
        """Pressures (m,), gaps (m,), motions (k,), tractions (n,), auxiliary unknowns (n,)."""
        m, k, n = self.m, self.k, self.n
        ends = np.cumsum([m, m, k, n])
        return tuple(np.split(x, ends, axis=-1))

    def slip(self, x: FloatArray, lam: float) -> FloatArray:
        """Slips (n,)."""
        p, _, q, t, _ = self.split(x)
        return self.condensed.slip(self.factors(lam), q, p, t)

    def with_auxiliary(self, x: FloatArray, lam: float) -> FloatArray:
        """``x`` (2m + k + n,) with the auxiliary unknowns that go with it."""
        whole = np.concatenate([x, self.small])
        whole[-self.n :] = np.hypot(self.slip(whole, lam), self.small)
        return whole

    def residual(self, x: FloatArray, lam: float) -> FloatArray:
        """Dimensionless residual (2m + k + 2n,)."""
        p, h, q, t, r = self.split(x)
        f, law, c = self.factors(lam), self.law, self.condensed
        s = c.slip(f, q, p, t)
        return np.concatenate(
            [
                ((p + law.eta) * h - law.eta * law.delta) / (law.pressure * law.gap),
                (h - c.gap(f, q, p, t)) / law.gap,
                c.balance(f, q, p, t) / law.force,
                (t * r + c.friction * (p + law.eta)[c.rubbing] * s) / self.work,
                (r**2 - s**2 - self.small**2) / law.slip**2,
            ]
        )

    def tangent(self, x: FloatArray, lam: float) -> HolonomicTangent:
        """Factorised derivative by x; numpy's LinAlgError where it is singular."""
        return HolonomicTangent(self, x, lam)

    def load_derivative(self, x: FloatArray, lam: float) -> FloatArray:
        """Derivative by the path parameter (2m + k + 2n,)."""
        c, law = self.condensed, self.law
        p = self.split(x)[0]
        moved = c.slip.load @ self.change
        return np.concatenate(
            [
                np.zeros(self.m),
                -(c.gap.load @ self.change) / law.gap,
                (c.balance.load @ self.change) / law.force,
                c.friction * (p + law.eta)[c.rubbing] * moved / self.work,
                -2.0 * self.slip(x, lam) * moved / law.slip**2,
            ]
        )

    def series_rhs(self, x: FloatArray, lam: FloatArray) -> FloatArray:
        """Right-hand side of order k from the coefficients (k, 2m + k + 2n) of lower orders."""
        rhs = np.zeros(self.size)
        if len(x) < 2:
            return rhs
        c, law = self.condensed, self.law
        p, h, q, t, r = self.split(x[1:])
        maps = c.slip
        s = p @ maps.pressure.T + t @ maps.traction.T + q @ maps.motion.T
        s += np.outer(lam[1:], maps.load @ self.change)
        one, _, _, four, five = self.split(rhs)
        one[:] = np.einsum("ij,ij->j", p, h[::-1]) / (-law.pressure * law.gap)
        rubbed = np.einsum("ij,ij->j", t, r[::-1]) + c.friction * np.einsum(
            "ij,ij->j", p[:, c.rubbing], s[::-1]
        )
        four[:] = -rubbed / self.work
        squares = np.einsum("ij,ij->j", r, r[::-1]) - np.einsum("ij,ij->j", s, s[::-1])
        five[:] = -squares / law.slip**2
        return rhs

    def admissible(self, x: FloatArray, lam: float) -> bool:
        """Whether every gap is open and every auxiliary unknown positive."""
        p, h, _, _, r = self.split(x)
        return bool((h > 0.0).all() and (p > -self.law.eta).all() and (r > 0.0).all())
