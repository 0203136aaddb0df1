"""What a step adds to run.h5 beside its row: /series/<step>, and /checkpoint in place of the last one."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import h5py
import numpy as np
from numpy.typing import NDArray

from mlsanm_cli.io.kept import keep, store_array, store_number

if TYPE_CHECKING:
    from collections.abc import Mapping

CHUNK = 16384
"""Bytes of a checkpoint that are written together."""


class SeriesGroup:
    """/series of an open run.h5."""

    def __init__(self, root: Any) -> None:
        self._root = root
        self._group: Any = None

    def add(self, step: int, arrays: Mapping[str, NDArray[Any]], attributes: Mapping[str, float]) -> None:
        """Store ``arrays`` as /series/<step>/<name>; numbers are attributes of the group."""
        if self._group is None:
            self._group = self._root.require_group("series")
        if str(step) in self._group:
            for name, array in arrays.items():
                keep(self._group[str(step)], name, np.ascontiguousarray(array))
            return
        group = h5py.h5g.create(self._group.id, str(step).encode())
        for name, array in arrays.items():
            store_array(group, name, np.ascontiguousarray(array))
        for name, value in attributes.items():
            store_number(group, name, value)


class CheckpointGroup:
    """/checkpoint of an open run.h5."""

    def __init__(self, root: Any) -> None:
        self._root = root
        self._datasets: dict[str, Any] = {}

    def put(self, name: str, content: bytes) -> None:
        """Store ``content`` as /checkpoint/<name>, in place of what is there."""
        if name not in self._datasets:
            group = self._root.require_group("checkpoint")
            if name not in group:
                group.create_dataset(name, (0,), np.uint8, maxshape=(None,), chunks=(CHUNK,))
            # The low-level one, as for columns: this is done at every step.
            self._datasets[name] = group[name].id
        dataset = self._datasets[name]
        if dataset.shape != (len(content),):
            dataset.set_extent((len(content),))
        dataset.write(h5py.h5s.ALL, h5py.h5s.ALL, np.frombuffer(content, np.uint8))

    def release(self) -> None:
        """Let go of the datasets."""
        self._datasets.clear()
