"""A few linear constraints that solutions of a least-squares problem satisfy exactly.

Under the constraints C u = d the normal equations become N u + C^T z = f. The solution follows from the
unconstrained one and the response to C^T (Bjorck 1996, doi:10.1137/1.9781611971484, section 5.1)::

    Y = N^-1 C^T (C N^-1 C^T)^-1        u = N^-1 f + Y (d - C N^-1 f)

Strong rows satisfy the constraints nearly, so that this changes the last digits only and loses none. Since C
Y = 1 to round-off however accurate Y is, the constraints hold to round-off.
"""

from __future__ import annotations

import numpy as np
import scipy.sparse as sparse

from mlsanm_cli.arrays import FloatArray, IntArray
from mlsanm_cli.records import dataclass
from mlsanm_cli.roundoff import FINE_ROUND_OFF, ROUND_OFF


@dataclass(frozen=True)
class Conditions:
    """``rows`` C (s, n), ``lift`` Y (n, s), and ``stiffness`` (s, s), the inverse of C N^-1 C^T."""

    rows: sparse.csr_array
    lift: FloatArray
    stiffness: FloatArray

    @classmethod
    def none(cls, unknowns: int) -> Conditions:
        """No constraints."""
        return cls(sparse.csr_array((0, unknowns)), np.zeros((unknowns, 0)), np.zeros((0, 0)))

    def met(self, solution: FloatArray, wanted: FloatArray) -> FloatArray:
        """The ``solution`` (n, c) of the normal equations, corrected to C u = ``wanted`` (s, c)."""
        return np.asarray(solution + self.lift @ (wanted - self.rows @ solution))


def independent_sums(rows: sparse.csr_array, sums: sparse.csr_array) -> tuple[sparse.csr_array, IntArray]:
    """Constraints (t, n) that are ``sums`` (s, g) of strong ``rows`` (g, n), without those that cancel, and
    which sums they are (t,)."""
    taken = sparse.csr_array(sums @ rows)
    size = _largest(sparse.csr_array(abs(sums) @ abs(rows)))
    taken.data[np.abs(taken.data) <= FINE_ROUND_OFF * np.repeat(size, np.diff(taken.indptr))] = 0.0
    taken.eliminate_zeros()
    kept = np.flatnonzero(_largest(taken) > ROUND_OFF * size)
    return sparse.csr_array(taken[kept]), kept


def conditions_of(rows: sparse.csr_array, answer: FloatArray) -> Conditions:
    """Constraints with ``rows`` (s, n) and ``answer`` (n, s), the response of the normal equations to their
    transpose; rows from the first dependent one on are dropped."""
    soft = np.asarray(rows @ answer)
    unit = soft / np.sqrt(np.outer(np.diag(soft), np.diag(soft)))
    count = len(soft)
    while count and not np.linalg.eigvalsh(unit[:count, :count])[0] > ROUND_OFF:
        count -= 1
    # Not symmetrised, so that constraints hold to round-off for any accuracy of the response.
    stiffness = np.linalg.inv(soft[:count, :count])
    return Conditions(sparse.csr_array(rows[:count]), answer[:, :count] @ stiffness, stiffness)


def _largest(matrix: sparse.csr_array) -> FloatArray:
    """Largest modulus in every row (s,)."""
    return np.asarray(abs(matrix).max(axis=1).toarray()).ravel() if matrix.shape[0] else np.zeros(0)
