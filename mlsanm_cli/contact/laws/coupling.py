"""Linear part of a contact problem, in the form shared by all regularised laws.

Gaps, slips and balances, each divided by its scale, are linear in the load factors f and in y = (p, t, q):
pressures, tractions, motions. Condensed, this is a dense matrix. :mod:`mlsanm_cli.contact.monolithic.system`
includes the bodies' displacements in the motions and their equations in the balances, and stays sparse. A law
adds its nodal terms, :class:`Local`, and obtains a factorised tangent.

Equation (13) of docs/method.md.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Protocol, Self, cast

import numpy as np
import scipy.sparse as sparse
from scipy.linalg.lapack import dgetrf, dgetrs

from mlsanm_cli.arrays import FloatArray, IntArray
from mlsanm_cli.contact.laws.scales import Regularization
from mlsanm_cli.contact.response.condensed import Condensed

Rows = FloatArray | sparse.csr_array


@dataclass(frozen=True)
class Local:
    """Nodal terms of a law in a tangent. Rows of gaps are multiplied by ``gap`` (m,) and get ``pressure``
    (m,) on the pressure of their node; rows of slips are multiplied by ``slip`` (n,) and get ``traction``
    (n,) and ``friction_slope`` (n,) on the traction and pressure of their node."""

    gap: FloatArray
    pressure: FloatArray
    slip: FloatArray
    traction: FloatArray
    friction_slope: FloatArray


class CoupledTangent(Protocol):
    """A factorised tangent for y = (p, t, q)."""

    def solve(self, rhs: FloatArray) -> FloatArray:
        """Solution (r,)."""


@dataclass(frozen=True, eq=False)
class Coupling(ABC):
    """Linear part of a contact problem: r = m + n + k rows of gaps, slips and balances. ``condensed``
    describes the nodes, ``law`` the scales; ``motion`` (k,) are scales of all motions. ``constant`` (r,) and
    ``load`` (r, L) are the terms independent of y, which ``matrix`` multiplies."""

    condensed: Condensed
    law: Regularization
    motion: FloatArray
    constant: FloatArray
    load: FloatArray
    matrix: Any

    @abstractmethod
    def __call__(self, f: FloatArray, y: FloatArray) -> FloatArray:
        """All rows (r,) in one state."""

    @abstractmethod
    def tangent(self, local: Local) -> CoupledTangent:
        """Factorise; raises numpy's LinAlgError if singular."""

    @cached_property
    def gaps(self) -> Rows:
        """Rows (m, r) of the gaps."""
        return cast(Rows, self.matrix[: len(self.condensed.weight)])

    @cached_property
    def slips(self) -> Rows:
        """Rows (n, r) of the slips."""
        m = len(self.condensed.weight)
        return cast(Rows, self.matrix[m : m + len(self.condensed.friction_nodes)])

    def with_thresholds(self, threshold: FloatArray) -> Self:
        """The same with friction thresholds (n,) of the law replaced."""
        return replace(self, law=replace(self.law, threshold=threshold))

    def split_motions(self, motion: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Split all motions (..., k) into rigid motions and, if they are unknowns, the bodies'
        displacements."""
        count = len(self.law.motion)
        return motion[..., :count], motion[..., count:]


@dataclass(frozen=True, eq=False)
class DenseCoupling(Coupling):
    """Coupling by condensed compliances: ``matrix`` (r, r) is dense and column-major."""

    matrix: FloatArray

    @classmethod
    def of(cls, condensed: Condensed, law: Regularization) -> DenseCoupling:
        """The condensed system of a scene with the scales of a law."""
        maps, scale = (condensed.gap, condensed.slip, condensed.balance), row_scales(condensed, law)
        return cls(
            condensed,
            law,
            law.motion,
            np.concatenate([one.constant for one in maps]) / scale,
            np.vstack([one.load for one in maps]) / scale[:, None],
            np.asfortranarray(condensed.whole / scale[:, None]),
        )

    def with_stick_compliance(self) -> DenseCoupling:
        """The same with the asperities' compliance added to the slips."""
        own = slip_places(self.condensed)
        matrix = self.matrix.copy(order="F")
        matrix[own, own] += self.law.stick_compliance / self.law.slip
        return replace(self, matrix=matrix)

    def __call__(self, f: FloatArray, y: FloatArray) -> FloatArray:
        """All rows (r,) in one state."""
        return np.asarray(self.constant + self.load @ f + self.matrix @ y)

    def tangent(self, local: Local) -> DenseTangent:
        """Factorise; raises numpy's LinAlgError if singular."""
        m, matrix = len(local.gap), self.matrix.copy(order="F")
        pressures, tractions = np.arange(m), slip_places(self.condensed)
        matrix[:m] *= local.gap[:, None]
        matrix[pressures, pressures] += local.pressure
        matrix[tractions] *= local.slip[:, None]
        matrix[tractions, tractions] += local.traction
        matrix[tractions, self.condensed.friction_nodes] += local.friction_slope
        return DenseTangent(matrix)


class DenseTangent:
    """LU ``factor`` and ``pivots`` of a column-major matrix (r, r), which is overwritten."""

    def __init__(self, matrix: FloatArray) -> None:
        self.factor, self.pivots, info = dgetrf(matrix, overwrite_a=1)
        if info != 0:
            raise np.linalg.LinAlgError("singular tangent of the contact problem")

    def solve(self, rhs: FloatArray) -> FloatArray:
        """Solution (r,); ``rhs`` may be overwritten."""
        solution, _ = dgetrs(self.factor, self.pivots, rhs, overwrite_b=1)
        return np.asarray(solution)


class GapTangent:
    """A tangent with eliminated gaps: rows of the normal law, gaps, balances, friction."""

    def __init__(self, coupling: Coupling, factor: CoupledTangent, local: Local) -> None:
        self._coupling, self._factor, self._local = coupling, factor, local

    def solve(
        self, one: FloatArray, two: FloatArray, three: FloatArray, four: FloatArray
    ) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        """Pressures (m,), gaps (m,), motions (k,) and tractions (n,)."""
        m, n = len(one), len(four)
        y = self._factor.solve(np.concatenate([one - self._local.gap * two, four, three]))
        gap = (two + self._coupling.gaps @ y) * self._coupling.law.gap
        return y[:m], gap, y[m + n :], y[m : m + n]


class RegularizedContact:
    """What the regularised laws share: the problem between two load factors (L,), for the continuation
    driver."""

    def __init__(self, coupling: Coupling, start: FloatArray, end: FloatArray) -> None:
        self.coupling, self.condensed, self.law = coupling, coupling.condensed, coupling.law
        self.start, self.end, self.change = start, end, end - start
        self.m, self.k, self.n = (
            len(v) for v in (self.condensed.weight, coupling.motion, self.condensed.friction_nodes)
        )
        self.limit = self.condensed.friction * self.law.pressure
        self.scale = np.concatenate(
            [np.full(self.m, self.law.pressure), np.full(self.m, self.law.gap), coupling.motion, self.limit]
        )

    def factors(self, lam: float) -> FloatArray:
        """Load factors (L,) at path parameter ``lam``."""
        return self.start + lam * self.change

    def split(self, x: FloatArray) -> tuple[FloatArray, ...]:
        """Pressures (m,), gaps (m,), motions (k,), tractions (n,)."""
        m, k, n = self.m, self.k, self.n
        first = 2 * m + k
        return x[..., :m], x[..., m : 2 * m], x[..., 2 * m : first], x[..., first : first + n]

    def slips_of(self, known: FloatArray, x: FloatArray) -> FloatArray:
        """Slips (n,), or their rates, for the terms ``known`` (r,) of loads and the unknowns."""
        p, _, q, t, *_ = self.split(x)
        moved = self.coupling.slips @ np.concatenate([p, t, q])
        return np.asarray((known[self.m : self.m + self.n] + moved) * self.law.slip)

    def slip(self, x: FloatArray, lam: float) -> FloatArray:
        """Slips (n,) in one state."""
        return self.slips_of(self.coupling.constant + self.coupling.load @ self.factors(lam), x)


def row_scales(condensed: Condensed, law: Regularization) -> FloatArray:
    """Divisors (m + n + k,) of the rows of gaps, slips and balances."""
    m, n = len(condensed.weight), len(condensed.friction_nodes)
    return np.concatenate([np.full(m, law.gap), np.full(n, law.slip), law.force])


def slip_places(condensed: Condensed) -> IntArray:
    """Positions (n,) of slips among the rows, and of tractions in y."""
    m = len(condensed.weight)
    return np.arange(m, m + len(condensed.friction_nodes))
