"""Writer of run.h5: gathered in memory, and every half a minute written whole in place of the last one.

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
    /checkpoint/...         what the run continues from behind its last row

The file on disk is always a whole one, as of some finished step: HDF5 works in memory only, and its image is
renamed to the old file's name. A kill loses what came after, some half a minute at most.
"""

from __future__ import annotations

import os
import time
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import h5py
import numpy as np

from mlsanm_cli import __version__
from mlsanm_cli.closing import Closing
from mlsanm_cli.errors import RunError, WriteError
from mlsanm_cli.io.atomic import cannot_write, replacing
from mlsanm_cli.io.path_table import path_table

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence
    from pathlib import Path

    from numpy.typing import NDArray

FORMAT = 1
EVERY = 30.0
"""Seconds between two times at which the file is written."""
SHARE = 20.0
"""So many times as long as writing the file takes passes before it is written again."""
CHUNK_BYTES, CHUNK_ROWS = 8192, 128
"""Columns are stored by so many bytes and rows at most."""
AGREES = 1e-8
"""A resumed run has the same model if its arrays differ by no more than this part of their size."""
# HDF5 1.8 to 1.10: compact groups, and readable by every program in use (ParaView, MATLAB, old h5py).
_LIBRARY_VERSIONS = ("v108", "v110")

Attribute = str | int | float
Value = np.ndarray[Any, Any] | str | list[str]
"""Of a dataset: an array, a text, or texts."""


@dataclass(frozen=True, eq=False)
class Change:
    """What `RunFile.add` was given at a time."""

    rows: Sequence[Mapping[str, NDArray[Any]]]
    datasets: Mapping[str, Value]
    attributes: Mapping[str, Mapping[str, Attribute]]
    latest: Callable[[], Mapping[str, Value]] | None


class RunFile(Closing):
    """run.h5 open for writing, made with `RunFile.create` or `RunFile.reopen`; a context manager.

    What is added is on disk with the next `save`, all of it or nothing. An exception saves what was added and
    leaves ``status`` as it was set last. Every method that writes raises WriteError if the file cannot be
    written (full disk): then the one on disk stays, and nothing is written any more.
    """

    def __init__(self, path: Path, file: Any) -> None:
        self._path, self._file = path, file
        self._pending: list[Change] = []
        self._rows: dict[str, int] = {}
        self._groups: dict[str, Any] = {"": file}
        self._saved, self._took = time.monotonic(), 0.0
        self._unsaved = self._broken = False

    @classmethod
    def create(cls, path: Path, attributes: Mapping[str, Attribute]) -> RunFile:
        """Create ``path`` with status "running"; RunError if it exists or cannot be made."""
        if os.path.lexists(path):
            raise RunError(f"{path} exists already", hint="use --force or another --out")
        run = cls(path, h5py.File(path, "w", libver=_LIBRARY_VERSIONS, driver="core", backing_store=False))
        own: dict[str, Attribute] = {"format": FORMAT, "mlsanm_version": __version__, "status": "running"}
        run.add(attributes={"": {**own, **attributes}})
        return run

    @classmethod
    def reopen(cls, path: Path, attributes: Mapping[str, Attribute]) -> RunFile:
        """Go on with the file of a run that was stopped or killed, with status "running". RunError."""
        try:
            # By its content: a file that stays open cannot be replaced on Windows.
            image = h5py.h5f.open_file_image(path.read_bytes(), flags=h5py.h5f.FILE_IMAGE_OPEN_RW)
            file = h5py.File(image)
            # All that it holds is looked at, as it will be written again.
            file.visititems(lambda name, found: None)
        except (OSError, RuntimeError, ValueError, KeyError) as error:
            raise RunError(f"{path} cannot be read: {error}", "run the case again with --force") from error
        run = cls(path, file)
        run.add(attributes={"": {"status": "running", **attributes}})
        return run

    def add(
        self,
        rows: Sequence[Mapping[str, Any]] = (),
        datasets: Mapping[str, Value] | None = None,
        attributes: Mapping[str, Mapping[str, Attribute]] | None = None,
        latest: Callable[[], Mapping[str, Value]] | None = None,
    ) -> None:
        """Add rows, each one value to every column that it names, store datasets in place of those of the
        same name, and set attributes of groups ("": of the root). Arrays given may change afterwards.

        ``latest`` gives the datasets of a checkpoint, and is asked only if the file is written before another
        one is given.
        """
        kept = [{name: _array(value) for name, value in row.items()} for row in rows]
        arrays = {
            name: value.copy() if isinstance(value, np.ndarray) else value
            for name, value in (datasets or {}).items()
        }
        self._unsaved = True
        # One change of one list, so that no signal comes in between.
        self._pending.append(Change(kept, arrays, attributes or {}, latest))

    def confirm(self, datasets: Mapping[str, Value]) -> None:
        """Store what is not there yet; RunError where something else is there."""
        new = {name: value for name, value in datasets.items() if name not in self._file}
        for name in datasets.keys() - new.keys():
            if not _agree(self._file[name], datasets[name]):
                raise RunError(
                    f"the run cannot be resumed: {self._file[name].name} is not reproduced",
                    "another version or machine made it; run the case again with --force",
                )
        self.add(datasets=new)

    def save_if_due(self) -> None:
        """Write the file if that was some time ago."""
        if time.monotonic() - self._saved >= max(EVERY, SHARE * self._took):
            self.save()

    def save(self) -> None:
        """Write the file."""
        began = time.monotonic()
        try:
            self._take_in()
            self._file.flush()
            with replacing(self._path) as temporary, temporary.open("xb") as stream:
                stream.write(self._file.id.get_file_image())
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
        """Positions of the states saved so far, an earlier process's included."""
        self._take_in()
        found: list[float] = self._file["fields/position"][...].tolist() if "fields" in self._file else []
        return found

    def set_status(self, status: str) -> None:
        """Set the status, running, done, failed or stopped, and write the file."""
        self.add(attributes={"": {"status": status}})
        self.save()

    def close(self) -> None:
        """Save what was added since, and close; twice is allowed."""
        if not self._file.id.valid:
            return
        try:
            if self._unsaved and not self._broken:
                self.save()
        finally:
            self._file.close()

    def _take_in(self) -> None:
        """Bring all that was added into the file in memory; doing it again after a signal changes nothing."""
        taken = list(self._pending)
        columns: dict[str, list[Any]] = {}
        latest = None
        for change in taken:
            for row in change.rows:
                for name, value in row.items():
                    columns.setdefault(name, []).append(value)
            for name, content in change.datasets.items():
                self._put(name, content)
            for name, numbers in change.attributes.items():
                self._group(name).attrs.update(numbers)
            latest = change.latest or latest
        if latest is not None:
            self._put_checkpoint(latest())
        rows = dict(self._rows)
        for name, values in columns.items():
            rows[name] = self._append(name, np.stack(values))
        self._rows, self._pending = rows, self._pending[len(taken) :]

    def _put_checkpoint(self, datasets: Mapping[str, Value]) -> None:
        """Store what the path continues from, and nothing of what it continued from before."""
        if "checkpoint/path" in self._file:
            del self._file["checkpoint/path"]
            self._groups = {"": self._file}
        for name, value in datasets.items():
            self._put(name, value)

    def _put(self, name: str, value: Any) -> None:
        parent, _, own = name.rpartition("/")
        group = self._group(parent)
        if own in group:
            del group[own]
        if isinstance(value, list):
            group.create_dataset(own, data=np.array(value, dtype=object), dtype=h5py.string_dtype())
        else:
            group.create_dataset(own, data=value)

    def _append(self, name: str, values: NDArray[Any]) -> int:
        """Put values (k, ...) behind the rows of a column that were stored before; how many it has then."""
        tail = values.shape[1:]
        if name not in self._file:
            parent, _, own = name.rpartition("/")
            size = values.dtype.itemsize * int(np.prod(tail, dtype=np.int64))
            chunk = min(max(CHUNK_BYTES // max(size, 1), 1), CHUNK_ROWS)
            # First, so that doing it again begins with the first row.
            self._rows.setdefault(name, 0)
            self._group(parent).create_dataset(
                own,
                data=values,
                # HDF5 wants chunks of one entry or more, no longer than a bounded axis.
                chunks=(chunk, *(max(one, 1) for one in tail)),
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
        """A group, made with those above it where it is not there; members stay in the order of their
        making, which is that of the case."""
        if name not in self._groups:
            above, _, own = name.rpartition("/")
            group = self._group(above)
            self._groups[name] = group[own] if own in group else group.create_group(own, track_order=True)
        return self._groups[name]


def _array(value: Any) -> NDArray[Any]:
    """A copy; integers have 64 bits on all systems."""
    return np.array(value, dtype=np.int64 if isinstance(value, int) else None)


def _agree(stored: Any, value: Any) -> bool:
    """Whether a dataset holds a text, texts, or an array, nearly."""
    if isinstance(value, str):
        return bool(stored.asstr()[()] == value)
    if isinstance(value, list):
        return bool(stored.asstr()[...].tolist() == value)
    if stored.shape != value.shape:
        return False
    found, largest = stored[...], np.abs(value).max(initial=0.0)
    return bool((np.abs(found - value) <= AGREES * largest).all())
