"""Writer of run.h5: collected in memory, and written as a whole about every half minute.

Layout (S steps, row 0 is the state at the start; m slave nodes of a contact)::

    /                       attributes: format, mlsanm_version, status and those of the caller
    /case/{raw, resolved}   TOML text
    /bodies/<b>/points      (n, 2)   with boundary/{index, normal, name}
    /path/<column>          (S+1,)   with factors/<load> (S+1,), resultants/<load or support> (S+1, 2) and
                                     displacements/<load of a platen> (S+1, 2)
    /contacts/<c>/...       (m,) geometry, (S+1, m) and (S+1,) history
    /probes/<p>/...         (S+1, 2), (S+1, 3), (S+1,) history
    /maps/<kind>/<name>     (r, 1 + unknowns)
    /series/<step>/...      whatever reproduces the step
    /fields/<k>/<b>/...     saved states, /fields/position (K,)
    /checkpoint/...         the state from which the run continues after its last row

The file on disk is always complete, as of some finished step: HDF5 works in memory only, and its image
replaces the old file by a rename. A kill loses about half a minute of results at most. A digest of the image
follows it, by which a damaged file is recognised: the library may read one without end.
"""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from mlsanm_cli import __version__
from mlsanm_cli.errors import RunError, WriteError
from mlsanm_cli.io.columns import path_table
from mlsanm_cli.io.files import cannot_write, replacing, sealed, unsealed
from mlsanm_cli.records import Closing

FORMAT = 1
SAVE_INTERVAL = 30.0
"""Seconds between writing the file, at least."""
MIN_INTERVAL_RATIO = 20.0
"""Least interval between writing the file, over the time that writing takes."""
CHUNK_BYTES, CHUNK_ROWS = 8192, 128
"""Largest chunks of columns."""
REPRODUCTION_TOLERANCE = 1e-8
"""Largest relative difference of the arrays of the model when a run is resumed."""
# HDF5 1.8 to 1.10: compact groups, and readable by the programs in use (ParaView, MATLAB, old h5py).
_LIBRARY_VERSIONS = ("v108", "v110")

Attribute = str | int | float
Value = np.ndarray[Any, Any] | str | list[str]
"""The value of a dataset: an array, a text, or texts."""
Attributes = Mapping[str, Mapping[str, Attribute]]
Latest = Callable[[], Mapping[str, Value]]
Change = tuple[list[dict[str, NDArray[Any]]], dict[str, Value], Attributes, Latest | None]
"""The arguments of a call of `RunFile.add`: rows, datasets, attributes and the checkpoint."""


class RunFile(Closing):
    """run.h5 open for writing, made with `RunFile.create` or `RunFile.reopen`; a context manager.

    The next `save` writes everything added, or nothing. At an exception the additions are saved, and
    ``status`` remains as last set. Every method that writes raises WriteError if that is not possible (full
    disk): the file on disk then remains, and nothing more is written.
    """

    def __init__(self, path: Path, file: Any) -> None:
        self._path, self._file = path, file
        self._pending: list[Change] = []
        self._rows: dict[str, int] = {}
        self._saved, self._took = time.monotonic(), 0.0
        self._unsaved = self._broken = False

    @classmethod
    def create(cls, path: Path, attributes: Mapping[str, Attribute]) -> RunFile:
        """Creates ``path`` with status "running". Raises RunError if it exists or cannot be created."""
        if os.path.lexists(path):
            raise RunError(f"{path} exists already", hint="use --force or another --out")
        run = cls(path, h5py.File(path, "w", libver=_LIBRARY_VERSIONS, driver="core", backing_store=False))
        own: dict[str, Attribute] = {"format": FORMAT, "mlsanm_version": __version__, "status": "running"}
        run.add(attributes={"": {**own, **attributes}})
        return run

    @classmethod
    def reopen(cls, path: Path, attributes: Mapping[str, Attribute]) -> RunFile:
        """Opens the file of a stopped or killed run, with status "running". Raises RunError."""
        try:
            # From its content: an open file cannot be replaced on Windows.
            image = h5py.h5f.open_file_image(unsealed(path), flags=h5py.h5f.FILE_IMAGE_OPEN_RW)
            file = h5py.File(image)
            # Everything is read, as it will be written again: checksums are looked at.
            file.visititems(lambda name, item: None if hasattr(item, "keys") else item[()] is None)
        except (OSError, RuntimeError, ValueError, LookupError, TypeError, MemoryError) as error:
            raise RunError(f"{path} cannot be read: {error}", "run the case again with --force") from error
        run = cls(path, file)
        run.add(attributes={"": {"status": "running", **attributes}})
        return run

    def add(
        self,
        rows: Sequence[Mapping[str, Any]] = (),
        datasets: Mapping[str, Value] | None = None,
        attributes: Attributes | None = None,
        latest: Latest | None = None,
    ) -> None:
        """Adds rows (one value for every column they name), datasets (replacing those of the same name) and
        attributes of groups ("": the root). Arrays are copied. ``latest`` returns the datasets of a
        checkpoint; it is called only if the file is written before the next checkpoint is given."""
        kept = [{name: _array(value) for name, value in row.items()} for row in rows]
        arrays = {
            name: value.copy() if isinstance(value, np.ndarray) else value
            for name, value in (datasets or {}).items()
        }
        self._unsaved = True
        # One change of one list, which no signal can interrupt.
        self._pending.append((kept, arrays, attributes or {}, latest))

    def confirm(self, datasets: Mapping[str, Value]) -> None:
        """Stores datasets that do not exist yet. Raises RunError if an existing one differs."""
        new = {name: value for name, value in datasets.items() if name not in self._file}
        for name in datasets.keys() - new.keys():
            if not _agree(self._file[name], datasets[name]):
                raise RunError(
                    f"the run cannot be resumed: {self._file[name].name} is not reproduced",
                    "another version or machine made it; run the case again with --force",
                )
        self.add(datasets=new)

    def save_if_due(self) -> None:
        """Writes the file if the last time was long enough ago."""
        if time.monotonic() - self._saved >= max(SAVE_INTERVAL, MIN_INTERVAL_RATIO * self._took):
            self.save()

    def save(self) -> None:
        """Writes the file."""
        began = time.monotonic()
        try:
            self._take_in()
            self._file.flush()
            with replacing(self._path) as temporary, temporary.open("xb") as stream:
                stream.write(sealed(self._file.id.get_file_image()))
                stream.flush()
                os.fsync(stream.fileno())
        except (WriteError, MemoryError, RuntimeError) as error:
            self._broken = True
            raise error if isinstance(error, WriteError) else cannot_write(self._path, error) from error
        self._unsaved, self._saved = False, time.monotonic()
        self._took = self._saved - began

    def path_table(self) -> Mapping[str, NDArray[Any]]:
        """The path so far as columns of a table."""
        self._take_in()
        return path_table(self._file)

    def saved_positions(self) -> list[float]:
        """Positions of the states saved so far, also by earlier processes."""
        self._take_in()
        found: list[float] = self._file["fields/position"][...].tolist() if "fields" in self._file else []
        return found

    def set_status(self, status: str) -> None:
        """Sets the status (running, done, failed or stopped) and writes the file."""
        self.add(attributes={"": {"status": status}})
        self.save()

    def close(self) -> None:
        """Saves pending additions and closes the file; may be called twice."""
        if not self._file.id.valid:
            return
        try:
            if self._unsaved and not self._broken:
                self.save()
        finally:
            self._file.close()

    def _take_in(self) -> None:
        """Applies all additions to the file in memory; repeating it after a signal changes nothing."""
        taken = list(self._pending)
        columns: dict[str, list[Any]] = {}
        latest = None
        for rows_of, datasets, attributes, checkpoint in taken:
            for name, value in (item for row in rows_of for item in row.items()):
                columns.setdefault(name, []).append(value)
            for name, content in datasets.items():
                self._put(name, content)
            for name, numbers in attributes.items():
                self._group(name).attrs.update(numbers)
            latest = checkpoint or latest
        if latest is not None:
            # Not merged with the one before.
            if "checkpoint/path" in self._file:
                del self._file["checkpoint/path"]
            for name, content in latest().items():
                self._put(name, content)
        rows = dict(self._rows)
        for name, values in columns.items():
            rows[name] = self._append(name, np.stack(values))
        self._rows, self._pending = rows, self._pending[len(taken) :]

    def _put(self, name: str, value: Any) -> None:
        parent, _, own = name.rpartition("/")
        group = self._group(parent)
        if own in group:
            del group[own]
        if isinstance(value, list):
            group.create_dataset(own, data=np.array(value, dtype=object), dtype=h5py.string_dtype())
        elif isinstance(value, np.ndarray) and value.size and value.ndim:
            # In one piece: only pieces have checksums.
            group.create_dataset(own, data=value, chunks=value.shape, fletcher32=True)
        else:
            group.create_dataset(own, data=value)

    def _append(self, name: str, values: NDArray[Any]) -> int:
        """Appends values (k, ...) to a column; returns its number of rows."""
        tail = values.shape[1:]
        if name not in self._file:
            parent, _, own = name.rpartition("/")
            size = values.dtype.itemsize * int(np.prod(tail, dtype=np.int64))
            chunk = min(max(CHUNK_BYTES // max(size, 1), 1), CHUNK_ROWS)
            # Set first, so that a repetition starts with the first row.
            self._rows.setdefault(name, 0)
            self._group(parent).create_dataset(
                own,
                data=values,
                # HDF5 requires chunks of at least one entry, no longer than a bounded axis.
                chunks=(chunk, *(max(one, 1) for one in tail)),
                fletcher32=True,
                maxshape=(None, *(one or None for one in tail)),
            )
            return len(values)
        dataset = self._file[name]
        if dataset.shape[1:] != tail:
            raise ValueError(f"{name}: shape {tail}, expected {dataset.shape[1:]}")
        first = self._rows.setdefault(name, len(dataset))
        dataset.resize(first + len(values), axis=0)
        if values.size:
            dataset[first:] = values
        return first + len(values)

    def _group(self, name: str) -> Any:
        """A group, created with its parents if it does not exist; members keep the order of creation, which
        is that of the case."""
        if name and name not in self._file:
            above, _, own = name.rpartition("/")
            self._group(above).create_group(own, track_order=True)
        return self._file[name or "/"]


def _array(value: Any) -> NDArray[Any]:
    """A copy as an array; integers have 64 bits on all systems."""
    return np.array(value, dtype=np.int64 if isinstance(value, int) else None)


def _agree(stored: Any, value: Any) -> bool:
    """Whether a dataset equals a text or texts, or an array to the tolerance."""
    if isinstance(value, str):
        return bool(stored.asstr()[()] == value)
    if isinstance(value, list):
        return bool(stored.asstr()[...].tolist() == value)
    if stored.shape != value.shape:
        return False
    found, largest = stored[...], np.abs(value).max(initial=0.0)
    return bool((np.abs(found - value) <= REPRODUCTION_TOLERANCE * largest).all())
