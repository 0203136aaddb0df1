"""Conditions that solutions of a least-squares problem meet exactly, a few for each problem.

Under the conditions C u = d the normal equations N u = f have multipliers, N u + C^T z = f. All follows from
their solution without conditions and what they answer to C^T (Bjorck 1996, doi:10.1137/1.9781611971484,
section 5.1)::

    Y = N^-1 C^T (C N^-1 C^T)^-1        u = N^-1 f + Y (d - C N^-1 f)

Where strong rows have met the conditions nearly, this is the last bit only, so that it loses no digits; and
as C Y = 1 to round-off, whatever Y is worth, so are the conditions met.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sparse

from mlsanm_cli.arrays import FloatArray, IntArray

CANCELLATION = 1e-9
"""Conditions whose terms cancel to this part are void, as are those that follow from others."""
ROUND_OFF = 1e-13
"""Single terms that cancel to this part are nothing."""


@dataclass(frozen=True)
class Conditions:
    """``rows`` C (s, n), ``lift`` Y (n, s), and ``stiffness`` (s, s), the inverse of C N^-1 C^T."""

    rows: sparse.csr_array
    lift: FloatArray
    stiffness: FloatArray

    @classmethod
    def none(cls, unknowns: int) -> Conditions:
        """No conditions."""
        return cls(sparse.csr_array((0, unknowns)), np.zeros((unknowns, 0)), np.zeros((0, 0)))

    def met(self, solution: FloatArray, wanted: FloatArray) -> FloatArray:
        """The ``solution`` (n, c) of the normal equations, moved to where C u is ``wanted`` (s, c)."""
        return np.asarray(solution + self.lift @ (wanted - self.rows @ solution))


def independent_sums(rows: sparse.csr_array, sums: sparse.csr_array) -> tuple[sparse.csr_array, IntArray]:
    """What ``sums`` (s, g) of strong ``rows`` (g, n) say (t, n), and which of them do (t,): not those that
    cancel, as the forces on a body that nothing holds."""
    taken = sparse.csr_array(sums @ rows)
    size = _largest(sparse.csr_array(abs(sums) @ abs(rows)))
    taken.data[np.abs(taken.data) <= ROUND_OFF * np.repeat(size, np.diff(taken.indptr))] = 0.0
    taken.eliminate_zeros()
    kept = np.flatnonzero(_largest(taken) > CANCELLATION * size)
    return sparse.csr_array(taken[kept]), kept


def conditions_of(rows: sparse.csr_array, answer: FloatArray) -> Conditions:
    """The conditions ``rows`` (s, n), by the ``answer`` (n, s) of the normal equations to their transpose; of
    rows that depend on each other only the first."""
    soft = np.asarray(rows @ answer)
    unit = soft / np.sqrt(np.outer(np.diag(soft), np.diag(soft)))
    count = len(soft)
    while count and not np.linalg.eigvalsh(unit[:count, :count])[0] > CANCELLATION:
        count -= 1
    # Not made symmetric: so conditions hold to round-off, whatever the answer is worth.
    stiffness = np.linalg.inv(soft[:count, :count])
    return Conditions(sparse.csr_array(rows[:count]), answer[:, :count] @ stiffness, stiffness)


def _largest(matrix: sparse.csr_array) -> FloatArray:
    """The largest entry of every row (s,)."""
    return np.asarray(abs(matrix).max(axis=1).toarray()).ravel() if matrix.shape[0] else np.zeros(0)
