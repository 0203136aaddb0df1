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

The file on disk is always complete, as of some finished step: each time the whole file is made in memory, and
its image replaces the old one by a rename. A kill loses about half a minute of results at most. A digest of
the image follows it, by which a damaged file is recognised: the library may read one without end.
"""

from __future__ import annotations

import copy
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
from mlsanm_cli.io.files import cannot_write, replacing, sealed, unsealed
from mlsanm_cli.io.run_reader import FORMAT, flat, read_value
from mlsanm_cli.io.schema import path_table
from mlsanm_cli.records import Closing

SAVE_INTERVAL = 30.0
"""Seconds between writing the file, at least."""
MIN_INTERVAL_RATIO = 20.0
"""Least interval between writing the file, over the time that writing takes."""
REPRODUCTION_TOLERANCE = 1e-8
"""Largest relative difference of the arrays of the model when a run is resumed."""
# HDF5 1.8 to 1.10: compact groups, and readable by the programs in use (ParaView, MATLAB, old h5py).
_LIBRARY_VERSIONS = ("v108", "v110")

Attribute = str | int | float
Value = np.ndarray[Any, Any] | str | list[str]
"""The value of a dataset: an array, a text, or texts."""
Attributes = Mapping[str, Mapping[str, Attribute]]
Latest = Callable[[], Mapping[str, Value]]
Change = tuple[Sequence[Mapping[str, NDArray[Any]]], Mapping[str, Value], Attributes, Latest | None]
"""The arguments of a call of `RunFile.add`: rows, datasets, attributes and the checkpoint."""


class RunFile(Closing):
    """run.h5 open for writing. The next `save` writes everything added, or nothing; at an exception the
    additions are saved, and ``status`` remains as last set. After a WriteError (full disk) the file on disk
    remains, and nothing more is written."""

    def __init__(self, path: Path, datasets: Mapping[str, Value], attributes: Attributes) -> None:
        self._path = path
        # What the file holds, then what was added since.
        self._changes: list[Change] = [((), datasets, attributes, None)]
        self._saved, self._took = time.monotonic(), 0.0
        self._unsaved, self._broken = True, False

    @classmethod
    def create(cls, path: Path, attributes: Mapping[str, Attribute]) -> RunFile:
        """A new file with status "running". Raises RunError if ``path`` exists."""
        if os.path.lexists(path):
            raise RunError(f"{path} exists already", hint="use --force or another --out")
        first: dict[str, Attribute] = {"format": FORMAT, "mlsanm_version": __version__, "status": "running"}
        return cls(path, {}, {"": {**first, **attributes}})

    @classmethod
    def reopen(cls, path: Path, attributes: Mapping[str, Attribute]) -> RunFile:
        """Opens the file of a stopped or killed run, with status "running". Raises RunError."""
        try:
            # From its content: an open file cannot be replaced on Windows.
            with h5py.File(h5py.h5f.open_file_image(unsealed(path))) as file:
                groups = {"": dict(file.attrs)}
                file.visititems(lambda name, item: groups.update({name: dict(item.attrs)}))
                datasets = {name: read_value(item) for name, item in flat(file)}
        except (OSError, RuntimeError, ValueError, LookupError, TypeError, MemoryError) as error:
            raise RunError(f"{path} cannot be read: {error}", "run the case again with --force") from error
        numbers = {name: values for name, values in groups.items() if values}
        return cls(path, datasets, {**numbers, "": {**groups[""], "status": "running", **attributes}})

    def add(
        self,
        rows: Sequence[Mapping[str, Any]] = (),
        datasets: Mapping[str, Value] | None = None,
        attributes: Attributes | None = None,
        latest: Latest | None = None,
    ) -> None:
        """Adds rows (a value for every column), datasets, attributes of groups ("": the root), all copied,
        and the function ``latest`` of the datasets of a checkpoint, called only if it is written."""
        # Integers have 64 bits on all systems.
        kept = [
            {name: np.array(one, np.int64 if isinstance(one, int) else None) for name, one in row.items()}
            for row in rows
        ]
        self._unsaved = True
        # One change of one list, which no signal can interrupt.
        self._changes.append((kept, copy.deepcopy(dict(datasets or {})), attributes or {}, latest))

    def confirm(self, datasets: Mapping[str, Value]) -> None:
        """Stores new datasets. Raises RunError if existing ones differ, arrays beyond the tolerance."""
        stored, _ = self._content()
        for name, value in datasets.items():
            before = stored.get(name, value)
            if isinstance(value, np.ndarray) and isinstance(before, np.ndarray):
                limit = REPRODUCTION_TOLERANCE * np.abs(value).max(initial=0.0)
                same = before.shape == value.shape and bool((np.abs(before - value) <= limit).all())
            else:
                same = type(before) is type(value) and bool(before == value)
            if not same:
                hint = "another version or machine made it; run the case again with --force"
                raise RunError(f"the run cannot be resumed: /{name} is not reproduced", hint)
        self.add(datasets={name: value for name, value in datasets.items() if name not in stored})

    def save_if_due(self) -> None:
        """Writes the file if the last time was long enough ago."""
        if time.monotonic() - self._saved >= max(SAVE_INTERVAL, MIN_INTERVAL_RATIO * self._took):
            self.save()

    def save(self) -> None:
        began = time.monotonic()
        try:
            datasets, attributes = self._content()
            made: Any = {"libver": _LIBRARY_VERSIONS, "driver": "core", "backing_store": False}
            with h5py.File(self._path, "w", **made) as file:
                for name, value in datasets.items():
                    _put(file, name, value)
                for name, numbers in attributes.items():
                    _group(file, name).attrs.update(numbers)
                file.flush()
                image = file.id.get_file_image()
            with replacing(self._path) as temporary, temporary.open("xb") as stream:
                stream.write(sealed(image))
                stream.flush()
                os.fsync(stream.fileno())
        except (WriteError, MemoryError, RuntimeError) as error:
            self._broken = True
            raise error if isinstance(error, WriteError) else cannot_write(self._path, error) from error
        self._unsaved, self._saved = False, time.monotonic()
        self._took = self._saved - began

    def path_table(self) -> Mapping[str, NDArray[Any]]:
        """The path so far as columns of a table."""
        return path_table(self._content()[0])

    def saved_positions(self) -> list[float]:
        """Positions of the states saved so far, also by earlier processes."""
        return list(np.asarray(self._content()[0].get("fields/position", ()), dtype=np.float64).tolist())

    def set_status(self, status: str) -> None:
        """Sets the status (running, done, failed or stopped) and writes the file."""
        self.add(attributes={"": {"status": status}})
        self.save()

    def close(self) -> None:
        """Saves pending additions; may be called twice."""
        if self._unsaved and not self._broken:
            self.save()

    def _content(self) -> tuple[Mapping[str, Value], Attributes]:
        """All datasets and attributes, of which the list of changes is made one, also after a signal."""
        columns: dict[str, list[NDArray[Any]]] = {}
        datasets: dict[str, Value] = {}
        attributes: dict[str, Mapping[str, Attribute]] = {}
        latest = None
        for rows, added, numbers, checkpoint in self._changes:
            for name, value in (item for row in rows for item in row.items()):
                columns.setdefault(name, []).append(value)
            datasets |= added
            attributes |= {name: {**attributes.get(name, {}), **more} for name, more in numbers.items()}
            latest = checkpoint or latest
        if latest is not None:
            # Not merged with the one before.
            kept = [name for name in datasets if not name.startswith("checkpoint/path/")]
            datasets = {**{name: datasets[name] for name in kept}, **latest()}
        for name, values in columns.items():
            stored = datasets.get(name)
            new = np.stack(values)
            datasets[name] = np.concatenate([stored, new]) if isinstance(stored, np.ndarray) else new
        self._changes = [((), datasets, attributes, None)]
        return datasets, attributes


def _put(file: Any, path: str, value: Value) -> None:
    parent, _, name = path.rpartition("/")
    group = _group(file, parent)
    if isinstance(value, list):
        group.create_dataset(name, data=np.array(value, dtype=object), dtype=h5py.string_dtype())
    elif isinstance(value, np.ndarray) and value.size and value.ndim:
        # In one piece: only pieces have checksums.
        group.create_dataset(name, data=value, chunks=value.shape, fletcher32=True)
    else:
        group.create_dataset(name, data=value)


def _group(file: Any, name: str) -> Any:
    """A group, created with its parents; members keep the order of creation, that of the case."""
    if name and name not in file:
        above, _, last = name.rpartition("/")
        _group(file, above).create_group(last, track_order=True)
    return file[name or "/"]
