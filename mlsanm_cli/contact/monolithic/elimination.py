"""Scaling, ordering and factorisation of the sparse monolithic tangent."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
import scipy.sparse as sparse

from mlsanm_cli.arrays import FloatArray, IntArray
from mlsanm_cli.errors import NumericalError
from mlsanm_cli.mechanics.scene import Scene
from mlsanm_cli.operators.linear.interface import Factor
from mlsanm_cli.operators.linear.superlu import THRESHOLD, elimination_order, factor_in_order
from mlsanm_cli.operators.system import Equations

DENSE_ROW_SCALE = 2.0**-40
"""Factor on rows eliminated last: partial pivoting must not choose one of these dense rows early."""


@dataclass(frozen=True, eq=False)
class Elimination:
    """A sparse matrix (R, R) that is factorised repeatedly with different factors on its first r rows.

    ``matrix`` is in elimination ``order`` (R,), in which the ``last`` rows and columns are dense; its columns
    are multiplied by ``scale`` (R,), typical values of the unknowns. ``definite``: no pivoting is needed in
    the bodies.
    """

    matrix: sparse.csc_array
    scale: FloatArray
    order: IntArray
    last: int
    definite: bool

    def with_added(self, added: sparse.csr_array) -> Elimination:
        """The same with further entries (r, r)."""
        return replace(self, matrix=self.matrix + self._placed(added))

    def factor(self, rows: FloatArray, added: sparse.csr_array) -> Factor:
        """Factor of the matrix with its first rows multiplied by ``rows`` (r,) and entries ``added`` (r, r);
        raises numpy's LinAlgError if singular."""
        factors = np.ones(len(self.order))
        factors[: len(rows)] = rows
        values = self.matrix.data * factors[self.order][self.matrix.indices]
        whole = sparse.csc_array((values, self.matrix.indices, self.matrix.indptr), shape=self.matrix.shape)
        whole = sparse.csc_array(whole + self._placed(added))
        try:
            return factor_in_order(whole, np.arange(len(self.order)), 0.0 if self.definite else THRESHOLD)
        except NumericalError as error:
            raise np.linalg.LinAlgError("singular tangent of the contact problem") from error

    def solve(self, factor: Factor, rhs: FloatArray) -> FloatArray:
        """Scaled unknowns (r,) for right-hand sides ``rhs`` (r,), without refinement."""
        whole = np.zeros(len(self.order))
        whole[: len(rhs)] = rhs
        whole = whole[self.order]
        whole[len(whole) - self.last :] *= DENSE_ROW_SCALE
        solution = np.empty_like(whole)
        solution[self.order] = factor.solve(whole)
        return solution[: len(rhs)]

    def _placed(self, added: sparse.csr_array) -> sparse.csc_array:
        """Entries (r, r), all in dense rows and columns, permuted and scaled like the matrix."""
        whole = added.tocoo()
        rows, columns = whole.coords
        place = np.empty_like(self.order)
        place[self.order] = np.arange(len(self.order))
        values = DENSE_ROW_SCALE * whole.data * self.scale[columns]
        return sparse.csc_array((values, (place[rows], place[columns])), shape=self.matrix.shape)


def plan_elimination(
    scene: Scene,
    contact: sparse.csr_array,
    equations: Mapping[str, Equations],
    scale: FloatArray,
    unknowns: FloatArray,
) -> Elimination:
    """Plan for the matrix of ``contact`` rows (c, r) above the bodies' ``equations``, divided by ``scale``
    (2N,), with typical values ``unknowns`` (r,): c of the contact, then the bodies' displacements.

    The equations' right-hand sides are those of the contact unknowns. The unknowns of a body are eliminated
    as in its own system; the contact comes last, so that its Schur complement is a condensed problem with
    sound pivots.
    """
    count, total = contact.shape
    matrix = sparse.block_diag([one.matrix for one in equations.values()], format="csr")
    caused = sparse.vstack([one.sources for one in equations.values()], format="csr")
    own = sparse.diags_array(1.0 / scale)
    bodies = sparse.hstack([-(own @ caused), own @ matrix])
    whole = sparse.vstack([contact, bodies], format="csr")
    parts, first = [], count
    for name, one in equations.items():
        pattern = sparse.csc_array(abs(one.matrix) + abs(one.matrix).T)
        parts.append(first + elimination_order(pattern, scene.bodies[name].model.nodes))
        first += one.matrix.shape[0]
    order = np.concatenate([*parts, np.arange(count)])
    factors = np.ones(total)
    factors[order[len(order) - count :]] = DENSE_ROW_SCALE
    scaled = sparse.csr_array(sparse.diags_array(factors) @ whole @ sparse.diags_array(unknowns))
    return Elimination(
        matrix=sparse.csc_array(scaled[order][:, order]),
        scale=unknowns,
        order=order,
        last=count,
        definite=all(one.definite for one in equations.values()),
    )
