"""Regularised contact with Coulomb friction and its memory, quadratic between two changes of what rubs.

The hyperbola (p + eta) h = eta delta stands for the normal contact. Friction acts where p is above a small
threshold p_0. A sticking node is held where it came to rest by an asperity of softness c, s + c t = anchor; a
slipping one carries t = d mu (p - p_0) with the sense d = +-1; an open one nothing. So no traction leaves
Coulomb's cone, whatever the history, and none jumps where a node opens or closes. The sets change where p_0
or a friction limit is reached, or where a slipping node comes to rest: between these events the equations
are smooth, and linear but for the hyperbola. Unknowns x = (p, h, q, t)::

    r1 = (p + eta) h - eta delta
    r2 = h - gap(f, q, p, t)
    r3 = balance(f, q, p, t)
    r4 = s(f, q, p, t) + c t - anchor  |  t - d mu (p - p_0)  |  t
"""

from __future__ import annotations

import numpy as np
import scipy.linalg as linalg

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.contact.condensed import Condensed
from mlsanm_cli.contact.coulomb import Sets, Values
from mlsanm_cli.contact.hyperbolic import Regularization


class RubbingTangent:
    """Factorised tangent; gaps and the tractions of nodes that do not stick are eliminated."""

    def __init__(self, problem: RubbingContact, x: FloatArray) -> None:
        self._problem = problem
        law = problem.law
        p, h, _, _ = problem.split(x)
        m, k, stuck = problem.m, problem.k, problem.stuck
        self._stress = p + law.eta
        r = m + len(stuck)
        matrix = np.empty((r + k, r + k), order="F")
        matrix[:m, :m], matrix[:m, m:r], matrix[:m, r:] = problem.gap_blocks
        matrix[:m] *= self._stress[:, None] / (law.pressure * law.gap)
        matrix[np.arange(m), np.arange(m)] += h / (law.pressure * law.gap)
        matrix[m:r, :m], matrix[m:r, m:r], matrix[m:r, r:] = problem.slip_blocks
        matrix[m:r] /= law.slip
        matrix[r:, :m], matrix[r:, m:r], matrix[r:, r:] = problem.balance_blocks
        matrix[r:] /= law.force[:, None]
        self._factor, self._pivots, info = linalg.lapack.dgetrf(matrix, overwrite_a=1)
        if info != 0:
            raise np.linalg.LinAlgError("singular tangent of the contact problem")

    def solve(self, rhs: FloatArray) -> FloatArray:
        """Solution (2m + k + n,)."""
        problem, law, c = self._problem, self._problem.law, self._problem.condensed
        m, k, stuck = problem.m, problem.k, problem.stuck
        one, two, three, four = problem.split(rhs)
        known = four * problem.limit
        known[stuck] = 0.0
        shift = two * law.gap + c.gap.traction @ known
        reduced = np.concatenate(
            [
                one - self._stress * shift / (law.pressure * law.gap),
                four[stuck] - (c.slip.traction[stuck] @ known) / law.slip,
                three - (c.balance.traction @ known) / law.force,
            ]
        )
        solution, _ = linalg.lapack.dgetrs(self._factor, self._pivots, reduced, overwrite_b=1)
        p, held, q = solution[:m], solution[m : len(solution) - k], solution[len(solution) - k :]
        t = known + problem.drag * p[c.rubbing]
        t[stuck] = held
        h = two * law.gap + c.gap.pressure @ p + c.gap.traction @ t
        if k:
            h += c.gap.motion @ q
        return np.concatenate([p, h, q, t])


class RubbingContact:
    """The problem over one stage with given ``sets``, in the form the continuation driver asks for.

    ``anchor`` (n,) are the values of s + c t at which sticking nodes came to rest.
    """

    def __init__(
        self,
        condensed: Condensed,
        law: Regularization,
        start: FloatArray,
        end: FloatArray,
        sets: Sets,
        anchor: FloatArray,
    ) -> None:
        self.condensed, self.law, self.start, self.change = condensed, law, start, end - start
        self.sets, self.anchor = sets, anchor
        self.m, self.k, self.n = (len(v) for v in (condensed.weight, law.motion, condensed.rubbing))
        self.size = 2 * self.m + self.k + self.n
        self.limit = condensed.friction * law.pressure
        self.stuck = np.flatnonzero(sets.stuck)
        self.drag = sets.sense * condensed.friction
        self.scale = np.concatenate(
            [np.full(self.m, law.pressure), np.full(self.m, law.gap), law.motion, self.limit]
        )
        gap, slip, balance = condensed.gap, condensed.slip, condensed.balance
        self.gap_blocks = self._blocks(gap.pressure, gap.traction, gap.motion)
        held = self.stuck
        self.slip_blocks = self._blocks(slip.pressure[held], slip.traction[held], slip.motion[held])
        self.slip_blocks[1][np.arange(len(held)), np.arange(len(held))] += law.creep[held]
        self.balance_blocks = self._blocks(balance.pressure, balance.traction, balance.motion)
        rubbed = np.zeros(self.n)
        rubbed[held] = (slip.load @ self.change)[held] / law.slip
        self._load_derivative = np.concatenate(
            [
                np.zeros(self.m),
                -(gap.load @ self.change) / law.gap,
                (balance.load @ self.change) / law.force,
                rubbed,
            ]
        )
        self._ready: tuple[FloatArray, RubbingTangent] | None = None

    def _blocks(
        self, pressure: FloatArray, traction: FloatArray, motion: FloatArray
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Columns of pressures, of sticking nodes' tractions and of motions; slipping nodes' go with p."""
        columns = pressure.copy()
        rubbing = np.flatnonzero(self.drag)
        columns[:, self.condensed.rubbing[rubbing]] += traction[:, rubbing] * self.drag[rubbing]
        return columns, traction[:, self.stuck].copy(), motion

    def factors(self, lam: float) -> FloatArray:
        """Load factors (L,) at path parameter ``lam``."""
        return self.start + lam * self.change

    def split(self, x: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        """Pressures (m,), gaps (m,), motions (k,), tractions (n,)."""
        m, k = self.m, self.k
        return x[..., :m], x[..., m : 2 * m], x[..., 2 * m : 2 * m + k], x[..., 2 * m + k :]

    def pressed(self, p: FloatArray) -> FloatArray:
        """What of the pressures friction goes with (n,): they less the law's threshold."""
        return p[self.condensed.rubbing] - self.law.threshold

    def residual(self, x: FloatArray, lam: float) -> FloatArray:
        """Dimensionless residual (2m + k + n,)."""
        p, h, q, t = self.split(x)
        f, law, c = self.factors(lam), self.law, self.condensed
        hyperbola = ((p + law.eta) * h - law.eta * law.delta) / (law.pressure * law.gap)
        rub = (t - self.drag * self.pressed(p)) / self.limit
        slip = c.slip(f, q, p, t) + law.creep * t - self.anchor
        rub[self.stuck] = slip[self.stuck] / law.slip
        return np.concatenate(
            [hyperbola, (h - c.gap(f, q, p, t)) / law.gap, c.balance(f, q, p, t) / law.force, rub]
        )

    def tangent(self, x: FloatArray, lam: float) -> RubbingTangent:
        """Factorised derivative by x; numpy's LinAlgError where it is singular."""
        if self._ready is None or not np.array_equal(self._ready[0], x):
            self._ready = (x.copy(), RubbingTangent(self, x))
        return self._ready[1]

    def load_derivative(self, x: FloatArray, lam: float) -> FloatArray:
        """Derivative by the path parameter (2m + k + n,)."""
        return self._load_derivative

    def series_rhs(self, x: FloatArray, lam: FloatArray) -> FloatArray:
        """Right-hand side of order k from the coefficients (k, 2m + k + n) of lower orders."""
        rhs = np.zeros(self.size)
        if len(x) > 1:
            p, h, _, _ = self.split(x[1:])
            rhs[: self.m] = np.einsum("ij,ij->j", p, h[::-1]) / (-self.law.pressure * self.law.gap)
        return rhs

    def admissible(self, x: FloatArray, lam: float) -> bool:
        """Whether every gap is open, that is, the state lies on the meaningful branch."""
        p, h, _, _ = self.split(x)
        return bool((h > 0.0).all() and (p > -self.law.eta).all())

    def rates(self, x: FloatArray, lam: float) -> tuple[Values, FloatArray]:
        """Rates of the state and of s + c t (n,), in the form in which :func:`find_sets` judges them.

        An open node closes where its pressure grows, which is told as the gap that its own compliance needs
        for that.
        """
        slope = -self.tangent(x, lam).solve(self._load_derivative)
        p, _, q, t = self.split(slope)
        c = self.condensed
        slip = c.slip.load @ self.change + c.slip.motion @ q + c.slip.pressure @ p + c.slip.traction @ t
        gap = np.where(self.sets.closed, 0.0, -p * np.diagonal(c.gap.pressure))
        return Values(np.where(self.sets.closed, p, 0.0), t, q, gap, slip), slip + self.law.creep * t

    def yielded(self, x: FloatArray, lam: float) -> FloatArray:
        """Slips less what the asperities' softness explains, s + c t (n,)."""
        p, _, q, t = self.split(x)
        return self.condensed.slip(self.factors(lam), q, p, t) + self.law.creep * t
