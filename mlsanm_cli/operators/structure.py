"""The structure of sparse matrices as the kernels take it, counted in 32 bits."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sparse

from mlsanm_cli.arrays import IndexArray
from mlsanm_cli.errors import NumericalError

MAX_ENTRIES = np.iinfo(np.int32).max
"""Largest number of entries that can be counted."""


def structure(matrix: sparse.csr_array | sparse.bsr_array) -> tuple[IndexArray, IndexArray]:
    """Where the rows of a matrix begin, (n + 1,), and the columns of its entries or blocks.

    Raises NumericalError where there are too many of them to be counted in 32 bits.
    """
    refuse_too_many(int(matrix.indptr[-1]))
    indptr, indices = (part.astype(np.int32, copy=False) for part in (matrix.indptr, matrix.indices))
    return indptr, indices


def compact(matrix: sparse.csr_array) -> sparse.csr_array:
    """The same matrix, its structure counted in 32 bits.

    Raises NumericalError where that is not enough.
    """
    indptr, indices = structure(matrix)
    return sparse.csr_array((matrix.data, indices, indptr), shape=matrix.shape)


def refuse_too_many(entries: int) -> None:
    """Raise NumericalError where so many entries cannot be counted in 32 bits, which would wrap around."""
    if entries > MAX_ENTRIES:
        raise NumericalError(
            f"the equations of a body have {entries:.3g} entries, more than the limit of {MAX_ENTRIES:.3g}",
            "increase its spacing, or reduce mls.degree",
        )
