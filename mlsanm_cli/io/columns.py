"""One growing HDF5 dataset, appended to row by row through h5py's low-level calls.

The high-level ``dataset.resize`` and ``dataset[k] = row`` cost several times more, and a step appends to some
twenty datasets.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import h5py
import numpy as np

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

# A chunk is rewritten at every flush that touches it, and the last one is mostly empty: keep chunks small.
_CHUNK_BYTES = 8192
_MAX_CHUNK_ROWS = 128


class Column:
    """A dataset of shape (rows, \\*tail) without limit on its rows."""

    def __init__(self, group: Any, name: str, tail: tuple[int, ...], dtype: np.dtype[Any]) -> None:
        """Create the empty dataset ``name`` in the low-level ``group``, or go on with one that is there."""
        self._name = name
        self._tail = tail
        self._dtype = dtype
        key = name.encode()
        self._dataset = h5py.h5d.open(group, key) if key in group else self._created(group, key)
        self._type = h5py.h5t.py_create(dtype)
        self._row_shape = (1, *tail)
        self._row_space = h5py.h5s.create_simple(self._row_shape)
        self._rows_space = h5py.h5s.create_simple(self._row_shape)
        self._origin = (0,) * len(tail)
        self._empty = 0 in tail

    def _created(self, group: Any, key: bytes) -> Any:
        """A new dataset without rows."""
        row_bytes = self._dtype.itemsize * int(np.prod(self._tail, dtype=np.int64))
        chunk_rows = min(max(_CHUNK_BYTES // max(row_bytes, 1), 1), _MAX_CHUNK_ROWS)
        properties = h5py.h5p.create(h5py.h5p.DATASET_CREATE)
        properties.set_obj_track_times(False)
        # HDF5 wants chunks of one entry or more, no longer than a bounded axis: empty axes are unbounded.
        properties.set_chunk((chunk_rows, *(max(size, 1) for size in self._tail)))
        limits = (h5py.h5s.UNLIMITED, *(size or h5py.h5s.UNLIMITED for size in self._tail))
        space = h5py.h5s.create_simple((0, *self._tail), limits)
        file_type = h5py.h5t.py_create(self._dtype, logical=True)
        return h5py.h5d.create(group, key, file_type, space, dcpl=properties)

    @property
    def rows(self) -> int:
        """How many rows there are."""
        return int(self._dataset.shape[0])

    def solve_with_error(self, value: ArrayLike) -> NDArray[Any]:
        """``value`` as a row; ValueError if its shape is not ``tail`` or it does not fit the type exactly."""
        row = np.asarray(value)
        if row.shape != self._tail:
            raise ValueError(f"{self._name}: shape {row.shape}, expected {self._tail}")
        if row.dtype == self._dtype:
            return np.ascontiguousarray(row).reshape(self._row_shape)
        if not np.can_cast(row.dtype, self._dtype, "same_kind") and row.dtype.kind not in "iub":
            raise ValueError(f"{self._name}: type {row.dtype} does not fit {self._dtype}")
        return np.ascontiguousarray(row, dtype=self._dtype).reshape(self._row_shape)

    def write(self, index: int, row: NDArray[Any]) -> None:
        """Write ``row``, as `solve_with_error` gave it, at ``index``; the dataset then has ``index`` + 1
        rows."""
        extent = (index + 1, *self._tail)
        self._dataset.set_extent(extent)
        if self._empty:
            return
        # The same space again, and the type named: to ask the dataset for both takes longer than to write.
        self._rows_space.set_extent_simple(extent)
        self._rows_space.select_hyperslab((index, *self._origin), self._row_shape)
        self._dataset.write(self._row_space, self._rows_space, row, self._type)

    def truncate(self, rows: int) -> None:
        """Drop the rows beyond the first ``rows``."""
        if self._dataset.shape[0] > rows:
            self._dataset.set_extent((rows, *self._tail))
