"""Array types of signatures, and runs in masks."""

from __future__ import annotations

from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

AnyArray: TypeAlias = NDArray[Any]
FloatArray: TypeAlias = NDArray[np.float64]
IntArray: TypeAlias = NDArray[np.int64]
IndexArray: TypeAlias = NDArray[np.int32]
"""Structure of sparse matrices, and stored indices."""
BoolArray: TypeAlias = NDArray[np.bool_]


def runs_of(mask: BoolArray) -> IntArray:
    """First numbers, and numbers after the last, of the runs of True in a mask (m,): (r, 2).

    >>> runs_of(np.array([True, False, True, True])).tolist()
    [[0, 1], [2, 4]]
    """
    return np.flatnonzero(np.diff(np.concatenate([[False], mask, [False]]))).reshape(-1, 2)
