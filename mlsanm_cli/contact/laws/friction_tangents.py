"""Factorised tangents of regularised frictional contact."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.contact.laws.coupling import DenseCoupling, DenseTangent, GapTangent, Local
from mlsanm_cli.kernels.hyperbola import hyperbola_orders

if TYPE_CHECKING:
    from mlsanm_cli.contact.laws.regularized_friction import RegularizedFriction


class CoupledFrictionTangent:
    """Factorised tangent for any coupling."""

    def __init__(self, problem: RegularizedFriction, x: FloatArray) -> None:
        self._problem, law = problem, problem.law
        p, h, _, _ = problem.split(x)
        stuck = problem.sets.stuck
        local = Local(
            gap=(p + law.eta) / law.pressure,
            pressure=h / (law.pressure * law.gap),
            slip=np.where(stuck, 1.0, 0.0),
            traction=np.where(stuck, 0.0, 1.0 / problem.limit),
            friction_slope=np.where(stuck, 0.0, -problem.friction_slope / problem.limit),
        )
        self._tangent = GapTangent(problem.coupling, problem.coupling.tangent(local), local)

    def solve(self, rhs: FloatArray) -> FloatArray:
        """Solution (2m + k + n,)."""
        return np.concatenate(self._tangent.solve(*self._problem.split(rhs)))


class FrictionTangent:
    """The same for dense couplings, faster: tractions of nodes that do not stick are eliminated too."""

    def __init__(self, problem: RegularizedFriction, base: DenseCoupling, x: FloatArray) -> None:
        self._problem, self._base = problem, base
        law, m = problem.law, problem.m
        p, h, _, _ = problem.split(x)
        self._stress = (p + law.eta) / law.pressure
        matrix = problem.reduced.copy(order="F")
        matrix[:m] *= self._stress[:, None]
        matrix[np.arange(m), np.arange(m)] += h / (law.pressure * law.gap)
        # Pivoting compares rows, which are dimensionless, not unknowns of different units.
        self._tangent = DenseTangent(matrix)

    def solve(self, rhs: FloatArray) -> FloatArray:
        """Solution (2m + k + n,)."""
        problem, law, base = self._problem, self._problem.law, self._base
        m, n, stuck = problem.m, problem.n, problem.stuck
        one, two, three, four = problem.split(rhs)
        held = four[stuck]
        known = four * problem.limit
        known[stuck] = 0.0
        # Right-hand sides of a series have no tractions.
        if four.any() and known.any():
            by_known = base.matrix[:, m : m + n] @ known
            two = two + by_known[:m]
            held = held - by_known[m + stuck]
            three = three - by_known[m + n :]
        reduced = np.concatenate([one - self._stress * two, held, three])
        solution = self._tangent.solve(reduced)
        p, q = solution[:m], solution[m + len(stuck) :]
        t = known + problem.friction_slope * p[problem.condensed.friction_nodes]
        t[stuck] = solution[m : m + len(stuck)]
        h = (two + problem.reduced[:m] @ solution) * law.gap
        return np.concatenate([p, h, q, t])

    def orders(
        self, x: FloatArray, lam: FloatArray, slope: FloatArray, normal: FloatArray, size: float
    ) -> None:
        """Compute the orders of a series from 2 on."""
        problem, law = self._problem, self._problem.law
        hyperbola_orders(
            x,
            lam,
            slope,
            normal,
            size,
            self._tangent.factor.T,
            self._tangent.pivots.astype(np.int64),
            problem.reduced.T,
            problem.m,
            law.pressure * law.gap,
            law.gap,
            problem.stuck,
            problem.friction_slope,
            problem.condensed.friction_nodes,
        )
