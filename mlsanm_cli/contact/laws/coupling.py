"""The linear part of a contact problem, which the bodies answer for, in the form that all smooth laws use.

Gaps, slips and balances, each divided by its scale, are linear in the load factors f and in y = (p, t, q):
pressures, tractions, motions. Condensed, that is a dense matrix. :mod:`mlsanm_cli.contact.monolithic.system`
counts the bodies' displacements among the motions and their equations among the balances, and stays sparse. A
law adds what it has node by node, :class:`Local`, and gets a factorised tangent of it all.

Equation (12) of docs/method.md.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np
import scipy.sparse as sparse

from mlsanm_cli.arrays import FloatArray, IntArray
from mlsanm_cli.contact.laws.regularization import Regularization
from mlsanm_cli.contact.response.condensed import Condensed
from mlsanm_cli.startup import dgetrf, dgetrs

Rows = FloatArray | sparse.csr_array


@dataclass(frozen=True)
class Local:
    """A law's own part of a tangent.

    Rows of gaps are multiplied by ``gap`` (m,) and get ``pressure`` (m,) on their own node's pressure; rows
    of slips are multiplied by ``slip`` (n,) and get ``traction`` (n,) and ``friction_slope`` (n,) on their
    own node's traction and pressure.
    """

    gap: FloatArray
    pressure: FloatArray
    slip: FloatArray
    traction: FloatArray
    friction_slope: FloatArray


class CoupledTangent(Protocol):
    """A factorised tangent over y = (p, t, q)."""

    def solve(self, rhs: FloatArray) -> FloatArray:
        """Solution (r,)."""


class Coupling(Protocol):
    """``condensed`` knows the nodes, ``law`` the scales; ``motion`` (k,) are those of all motions.

    ``constant`` (r,) and ``load`` (r, L) belong to the rows of gaps, slips and balances, r = m + n + k;
    ``gaps`` (m, r) and ``slips`` (n, r) are what y does to the first two.
    """

    @property
    def condensed(self) -> Condensed: ...
    @property
    def law(self) -> Regularization: ...
    @property
    def motion(self) -> FloatArray: ...
    @property
    def constant(self) -> FloatArray: ...
    @property
    def load(self) -> FloatArray: ...
    @property
    def gaps(self) -> Rows: ...
    @property
    def slips(self) -> Rows: ...

    def __call__(self, f: FloatArray, y: FloatArray) -> FloatArray:
        """All rows (r,) in one state."""

    def with_thresholds(self, threshold: FloatArray) -> Coupling:
        """With a law whose friction begins at other pressures (n,)."""

    def split_motions(self, motion: FloatArray) -> tuple[FloatArray, FloatArray]:
        """The platens' motions and, if they are unknowns too, the bodies' displacements among all motions."""

    def tangent(self, local: Local) -> CoupledTangent:
        """Factorise; numpy's LinAlgError where that is singular."""


@dataclass(frozen=True, eq=False)
class DenseCoupling:
    """The condensed one: ``matrix`` (r, r), ordered by columns, is what y does to all rows."""

    condensed: Condensed
    law: Regularization
    constant: FloatArray
    load: FloatArray
    matrix: FloatArray

    @classmethod
    def of(cls, condensed: Condensed, law: Regularization) -> DenseCoupling:
        """The compliance of one scene with the scales of a law."""
        maps = (condensed.gap, condensed.slip, condensed.balance)
        scale = row_scales(condensed, law)
        matrix = np.vstack([np.hstack([one.pressure, one.traction, one.motion]) for one in maps])
        return cls(
            condensed,
            law,
            np.concatenate([one.constant for one in maps]) / scale,
            np.vstack([one.load for one in maps]) / scale[:, None],
            np.asfortranarray(matrix / scale[:, None]),
        )

    def with_thresholds(self, threshold: FloatArray) -> DenseCoupling:
        """With a law whose friction begins at other pressures (n,)."""
        return replace(self, law=replace(self.law, threshold=threshold))

    def with_stick_compliance(self) -> DenseCoupling:
        """With what the law's asperities give way counted among the slips."""
        own = slip_places(self.condensed)
        matrix = self.matrix.copy(order="F")
        matrix[own, own] += self.law.stick_compliance / self.law.slip
        return replace(self, matrix=matrix)

    @property
    def motion(self) -> FloatArray:
        """Scales (k,) of the motions."""
        return self.law.motion

    @property
    def gaps(self) -> FloatArray:
        """Rows (m, r) of the gaps."""
        return self.matrix[: len(self.condensed.weight)]

    @property
    def slips(self) -> FloatArray:
        """Rows (n, r) of the slips."""
        m, n = len(self.condensed.weight), len(self.condensed.friction_nodes)
        return self.matrix[m : m + n]

    def __call__(self, f: FloatArray, y: FloatArray) -> FloatArray:
        """All rows (r,) in one state."""
        return np.asarray(self.constant + self.load @ f + self.matrix @ y)

    def split_motions(self, motion: FloatArray) -> tuple[FloatArray, FloatArray]:
        """The platens' motions (..., k), which are all."""
        return motion, np.zeros(0)

    def tangent(self, local: Local) -> DenseTangent:
        """Factorise; numpy's LinAlgError where that is singular."""
        m, matrix = len(local.gap), self.matrix.copy(order="F")
        pressures, tractions = np.arange(m), slip_places(self.condensed)
        matrix[:m] *= local.gap[:, None]
        matrix[pressures, pressures] += local.pressure
        matrix[tractions] *= local.slip[:, None]
        matrix[tractions, tractions] += local.traction
        matrix[tractions, self.condensed.friction_nodes] += local.friction_slope
        return DenseTangent(matrix)


class DenseTangent:
    """LU ``factor`` and ``pivots`` of a matrix (r, r) ordered by columns, which is overwritten."""

    def __init__(self, matrix: FloatArray) -> None:
        self.factor, self.pivots, info = dgetrf(matrix, overwrite_a=1)
        if info != 0:
            raise np.linalg.LinAlgError("singular tangent of the contact problem")

    def solve(self, rhs: FloatArray) -> FloatArray:
        """Solution (r,); ``rhs`` may be overwritten."""
        solution, _ = dgetrs(self.factor, self.pivots, rhs, overwrite_b=1)
        return np.asarray(solution)


class GapTangent:
    """A tangent whose gaps are eliminated: rows of the law, of gaps, of balances, of friction."""

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


def row_scales(condensed: Condensed, law: Regularization) -> FloatArray:
    """What rows of gaps, slips and balances are divided by (m + n + k,)."""
    m, n = len(condensed.weight), len(condensed.friction_nodes)
    return np.concatenate([np.full(m, law.gap), np.full(n, law.slip), law.force])


def slip_places(condensed: Condensed) -> IntArray:
    """Where slips (n,) stand among the rows, and tractions among the unknowns y."""
    m = len(condensed.weight)
    return np.arange(m, m + len(condensed.friction_nodes))
