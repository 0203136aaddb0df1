"""Structure of sparse matrices with 32-bit indices, as the kernels need it."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sparse

from mlsanm_cli.arrays import IndexArray
from mlsanm_cli.errors import NumericalError

MAX_ENTRIES = np.iinfo(np.int32).max
"""Largest number of entries with 32-bit indices."""


def structure(matrix: sparse.csr_array | sparse.bsr_array) -> tuple[IndexArray, IndexArray]:
    """Row offsets (n + 1,) and column indices of a matrix's entries or blocks. Raises NumericalError for more
    entries than 32-bit indices can count."""
    refuse_too_many(int(matrix.indptr[-1]))
    indptr, indices = (part.astype(np.int32, copy=False) for part in (matrix.indptr, matrix.indices))
    return indptr, indices


def compact(matrix: sparse.csr_array) -> sparse.csr_array:
    """The same matrix with 32-bit indices. Raises NumericalError if it is too large."""
    indptr, indices = structure(matrix)
    return sparse.csr_array((matrix.data, indices, indptr), shape=matrix.shape)


def refuse_too_many(entries: int) -> None:
    """Raise NumericalError for more ``entries`` than 32-bit indices can count."""
    if entries > MAX_ENTRIES:
        raise NumericalError(
            f"the equations of a body have {entries:.3g} entries, more than the limit of {MAX_ENTRIES:.3g}",
            "make its spacing larger, or mls.degree lower",
        )
