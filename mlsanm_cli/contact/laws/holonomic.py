"""Regularised contact with holonomic friction, a function of the total slip: for monotonic loading.

The hyperbola (p + eta) h = eta delta and, with the total slip s of a node and a small slip e,
t sqrt(s^2 + e^2) = -mu (p + eta) s. An auxiliary unknown r makes it quadratic. x = (p, h, q, t, r)::

    r1 = (p + eta) h - eta delta
    r2 = h - gap(f, q, p, t)
    r3 = balance(f, q, p, t)
    r4 = t r + mu (p + eta) s(f, q, p, t)
    r5 = r^2 - s(f, q, p, t)^2 - e^2

Tractions may exceed mu p by mu eta; on unloading the slip is reversible.
"""

from __future__ import annotations

import numpy as np

from mlsanm_cli.arrays import BoolArray, FloatArray
from mlsanm_cli.contact.laws.coupling import Coupling, GapTangent, Local, RegularizedContact


class HolonomicTangent:
    """Factorised tangent with eliminated gaps and auxiliary unknowns."""

    def __init__(self, problem: HolonomicContact, x: FloatArray, lam: float) -> None:
        c, law = problem.condensed, problem.law
        p, h, _, t, r = problem.split(x)
        s = problem.slip(x, lam)
        self._problem, self._r, self._s, self._pull = problem, r, s, t / r
        # d(r4) = r dt + mu s dp + lever ds, using r dr = s ds.
        lever = self._pull * s + c.friction * (p + law.eta)[c.friction_nodes]
        local = Local(
            gap=(p + law.eta) / law.pressure,
            pressure=h / (law.pressure * law.gap),
            slip=lever * law.slip / problem.work,
            traction=r / problem.work,
            friction_slope=c.friction * s / problem.work,
        )
        self._tangent = GapTangent(problem.coupling, problem.coupling.tangent(local), local)

    def solve(self, rhs: FloatArray) -> FloatArray:
        """Solution (2m + k + 2n,)."""
        problem, law = self._problem, self._problem.law
        one, two, three, four, five = problem.split(rhs)
        known = five * law.slip**2 / (2.0 * self._r)
        four = four - self._pull * self._r * known / problem.work
        p, h, q, t = self._tangent.solve(one, two, three, four)
        s = problem.coupling.slips @ np.concatenate([p, t, q]) * law.slip
        return np.concatenate([p, h, q, t, known + self._s * s / self._r])


class HolonomicContact(RegularizedContact):
    """The problem over one stage, for the continuation driver."""

    def __init__(self, coupling: Coupling, start: FloatArray, end: FloatArray) -> None:
        super().__init__(coupling, start, end)
        self.size = 2 * self.m + self.k + 2 * self.n
        self.small: FloatArray = self.law.stick_compliance * self.limit
        self.work: FloatArray = self.limit * self.law.slip
        self.scale = np.append(self.scale, np.full(self.n, self.law.slip))

    def over(self, start: FloatArray, end: FloatArray) -> HolonomicContact:
        """The same problem between other load factors (L,)."""
        return HolonomicContact(self.coupling, start, end)

    def split(self, x: FloatArray) -> tuple[FloatArray, ...]:
        """Pressures (m,), gaps (m,), motions (k,), tractions (n,), auxiliary unknowns (n,)."""
        return *super().split(x), x[..., self.size - self.n :]

    def sticking(self, x: FloatArray, lam: float) -> BoolArray:
        """Mask (n,) of nodes that have slipped by less than the law's small slip."""
        return np.abs(self.slip(x, lam)) < self.small

    def with_auxiliary(self, x: FloatArray, lam: float) -> FloatArray:
        """``x`` (2m + k + n,) extended by the auxiliary unknowns."""
        whole = np.concatenate([x, self.small])
        whole[-self.n :] = np.hypot(self.slip(whole, lam), self.small)
        return whole

    def residual(self, x: FloatArray, lam: float) -> FloatArray:
        """Dimensionless residual (2m + k + 2n,)."""
        p, h, q, t, r = self.split(x)
        m, n, law, c = self.m, self.n, self.law, self.condensed
        linear = self.coupling(self.factors(lam), np.concatenate([p, t, q]))
        s = linear[m : m + n] * law.slip
        return np.concatenate(
            [
                ((p + law.eta) * h - law.eta * law.delta) / (law.pressure * law.gap),
                h / law.gap - linear[:m],
                linear[m + n :],
                (t * r + c.friction * (p + law.eta)[c.friction_nodes] * s) / self.work,
                (r**2 - s**2 - self.small**2) / law.slip**2,
            ]
        )

    def tangent(self, x: FloatArray, lam: float) -> HolonomicTangent:
        """Factorised derivative by x; raises numpy's LinAlgError if singular."""
        return HolonomicTangent(self, x, lam)

    def load_derivative(self, x: FloatArray, lam: float) -> FloatArray:
        """Derivative by the path parameter (2m + k + 2n,)."""
        c, law, m, n = self.condensed, self.law, self.m, self.n
        p = self.split(x)[0]
        linear = self.coupling.load @ self.change
        moved = linear[m : m + n] * law.slip
        return np.concatenate(
            [
                np.zeros(self.m),
                -linear[:m],
                linear[m + n :],
                c.friction * (p + law.eta)[c.friction_nodes] * moved / self.work,
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
        s = np.hstack([p, t, q]) @ self.coupling.slips.T
        s += np.outer(lam[1:], self.coupling.load[self.m : self.m + self.n] @ self.change)
        s *= law.slip
        one, _, _, four, five = self.split(rhs)
        one[:] = np.einsum("ij,ij->j", p, h[::-1]) / (-law.pressure * law.gap)
        products = np.einsum("ij,ij->j", t, r[::-1]) + c.friction * np.einsum(
            "ij,ij->j", p[:, c.friction_nodes], s[::-1]
        )
        four[:] = -products / self.work
        squares = np.einsum("ij,ij->j", r, r[::-1]) - np.einsum("ij,ij->j", s, s[::-1])
        five[:] = -squares / law.slip**2
        return rhs

    def admissible(self, x: FloatArray, lam: float) -> bool:
        """Whether all gaps and auxiliary unknowns are positive."""
        p, h, _, _, r = self.split(x)
        return bool((h > 0.0).all() and (p > -self.law.eta).all() and (r > 0.0).all())
