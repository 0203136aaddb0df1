"""Factorised tangents of regularised frictional contact."""

from __future__ import annotations

from functools import cached_property

import numpy as np

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.contact.laws.contact_status import ContactStatus
from mlsanm_cli.contact.laws.coupling import Coupling, DenseCoupling, GapTangent, Local
from mlsanm_cli.kernels.hyperbola import hyperbola_orders
from mlsanm_cli.startup import dgetrf, dgetrs


class FrictionEquations:
    """Coupling and ``sets`` of regularised frictional contact, and what its tangents need of them."""

    def __init__(self, coupling: Coupling, sets: ContactStatus) -> None:
        self.coupling, self.sets = coupling, sets
        self.condensed, self.law = condensed, law = coupling.condensed, coupling.law
        self.m, self.k, self.n = len(condensed.weight), len(coupling.motion), len(condensed.friction_nodes)
        self.limit = condensed.friction * law.pressure
        self.stuck = np.flatnonzero(sets.stuck)
        self.friction_slope = sets.slip_sign * condensed.friction

    def split(self, x: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        """Pressures (m,), gaps (m,), motions (k,), tractions (n,)."""
        m, k = self.m, self.k
        return x[..., :m], x[..., m : 2 * m], x[..., 2 * m : 2 * m + k], x[..., 2 * m + k :]

    @cached_property
    def reduced(self) -> FloatArray:
        """Rows of gaps, sticking nodes' slips and balances over pressures, sticking tractions and motions.
        Tractions of slipping nodes are eliminated by their pressures. Dense couplings only."""
        assert isinstance(self.coupling, DenseCoupling)
        m, n = self.m, self.n
        # LAPACK is column-major: columns are rows of the transposed matrices.
        columns = self.coupling.matrix.T
        kept = np.concatenate([np.arange(m), m + self.stuck, np.arange(m + n, len(columns))])
        reduced = columns.take(kept, axis=0).take(kept, axis=1)
        friction_nodes = np.flatnonzero(self.friction_slope)
        dragged = columns.take(m + friction_nodes, axis=0).take(kept, axis=1)
        reduced[self.condensed.friction_nodes[friction_nodes]] += (
            dragged * self.friction_slope[friction_nodes, None]
        )
        return reduced.T


class CoupledFrictionTangent:
    """Factorised tangent for any coupling."""

    def __init__(self, problem: FrictionEquations, x: FloatArray) -> None:
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

    def __init__(self, problem: FrictionEquations, base: DenseCoupling, x: FloatArray) -> None:
        self._problem, self._base = problem, base
        law, m = problem.law, problem.m
        p, h, _, _ = problem.split(x)
        self._stress = (p + law.eta) / law.pressure
        matrix = problem.reduced.copy(order="F")
        matrix[:m] *= self._stress[:, None]
        matrix[np.arange(m), np.arange(m)] += h / (law.pressure * law.gap)
        # Pivoting compares rows, which are dimensionless, not unknowns of different units.
        self._factor, self._pivots, info = dgetrf(matrix, overwrite_a=1)
        if info != 0:
            raise np.linalg.LinAlgError("singular tangent of the contact problem")

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
        solution, _ = dgetrs(self._factor, self._pivots, reduced, overwrite_b=1)
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
            self._factor.T,
            self._pivots.astype(np.int64),
            problem.reduced.T,
            problem.m,
            law.pressure * law.gap,
            law.gap,
            problem.stuck,
            problem.friction_slope,
            problem.condensed.friction_nodes,
        )
