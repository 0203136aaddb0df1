"""Writer of run.h5, committed at every step so that a killed run keeps all its finished steps.

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
    /checkpoint/<name>      (bytes,) what the run goes on from behind its last row

Equal runs give equal arrays, /path/seconds apart: nothing that varies from run to run (times, paths, machine)
is stored in an array. A run that is resumed makes bodies, contacts and maps anew, which are compared with
those stored bit for bit, and its next row goes behind the last.
"""

from __future__ import annotations

from contextlib import contextmanager, nullcontext
from typing import TYPE_CHECKING, Any, Self

import h5py
import numpy as np
from numpy.typing import NDArray

from mlsanm_cli import __version__
from mlsanm_cli.errors import RunError
from mlsanm_cli.io.atomic import cannot_write
from mlsanm_cli.io.history import History
from mlsanm_cli.io.journal import JournaledFile, check_whole, recover, shielded
from mlsanm_cli.io.kept import (
    check_shape,
    checked_name,
    differs,
    floats,
    keep,
    keep_names,
    ordered,
)
from mlsanm_cli.io.path_table import path_table
from mlsanm_cli.io.records import FORMAT, ContactRecord, StepRecord
from mlsanm_cli.io.saved_states import SavedStates
from mlsanm_cli.io.step_groups import CheckpointGroup, SeriesGroup

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence
    from pathlib import Path
    from types import TracebackType

# HDF5 1.8 to 1.10: compact groups, and readable by every program in use (ParaView, MATLAB, old h5py).
_LIBRARY_VERSIONS = ("v108", "v110")

METADATA_CACHE = 32768
"""Bytes that HDF5 keeps of groups and datasets. It looks through all of them at every flush: with the usual
2 MB a flush after 300 steps takes twice as long."""

FloatArray = NDArray[np.float64]
Attribute = str | int | float
__all__ = ["Attribute", "ContactRecord", "RunFile", "StepRecord", "checked_name"]


class RunFile:
    """run.h5 open for writing, made with `RunFile.create` or `RunFile.reopen`; a context manager.

    What is written is on disk with the next `commit`, all of it or nothing. An exception leaves ``status`` as
    the caller set it last. Every method raises RunError if the file cannot be written (full disk), a name
    cannot be stored, or, in a file reopened, if it brings another model than the one stored; and ValueError
    for arrays of the wrong shape.
    """

    def __init__(self, file: Any, store: JournaledFile, path: Path) -> None:
        small = file.id.get_mdc_config()
        small.set_initial_size = True
        small.initial_size = small.min_size = small.max_size = METADATA_CACHE
        file.id.set_mdc_config(small)
        self._file = file
        self._store = store
        self._path = path
        self._history = History(file)
        self._states = SavedStates(file)
        self._series = SeriesGroup(file)
        self._checkpoints = CheckpointGroup(file)
        self._shielded = False

    @classmethod
    def create(cls, path: Path, attributes: Mapping[str, Attribute]) -> RunFile:
        """Create ``path`` with status "running"; RunError if it exists or cannot be made."""
        try:
            store = JournaledFile(path, new=True)
        except OSError as error:
            if path.exists():
                raise RunError(f"{path} exists already", hint="use --force or another --out") from error
            raise cannot_write(path, error) from error
        with shielded():
            file = h5py.File(store, "w", libver=_LIBRARY_VERSIONS)
        run = cls(file, store, path)
        with run._storing():
            for name in ("bodies", "contacts"):
                # Creation order is the order of the case; without this readers see alphabetical order.
                run._file.create_group(name, track_order=True)
        run.set_attributes(
            {"format": FORMAT, "mlsanm_version": __version__, "status": "running", **attributes}
        )
        return run

    @classmethod
    def reopen(
        cls, path: Path, attributes: Mapping[str, Attribute], rows: int = 0, states: int = 0
    ) -> RunFile:
        """Go on with the file of a run that was stopped or killed, with status "running", behind so many rows
        and saved states; RunError."""
        try:
            check_whole(path)
            recover(path)
            store = JournaledFile(path, new=False)
            with shielded():
                file = h5py.File(store, "r+", libver=_LIBRARY_VERSIONS)
        except (OSError, RuntimeError) as error:
            raise cannot_write(path, error) from error
        run = cls(file, store, path)
        run._history, run._states = History(file, rows), SavedStates(file, states)
        run.set_attributes({"status": "running", **attributes})
        return run

    def write_case(self, raw: str, resolved: str) -> None:
        """Store the case file's text and the resolved case's TOML text."""
        with self._storing():
            group = self._file.require_group("case")
            keep(group, "raw", raw)
            keep(group, "resolved", resolved)

    def write_body(
        self,
        name: str,
        points: FloatArray,
        boundary_index: NDArray[np.integer[Any]],
        boundary_normal: FloatArray,
        boundary_name: Sequence[str],
    ) -> None:
        """Store one body: points (n, 2), and of its nb boundary nodes index, outward normal (nb, 2), name."""
        count = len(boundary_index)
        check_shape(f"points of body {name}", points, (len(points), 2))
        check_shape(f"boundary normals of body {name}", boundary_normal, (count, 2))
        if len(boundary_name) != count:
            raise ValueError(f"body {name}: {len(boundary_name)} boundary names for {count} boundary nodes")
        with self._storing():
            group = self._file["bodies"].require_group(checked_name(name))
            keep(group, "points", floats(points))
            boundary = group.require_group("boundary")
            keep(boundary, "index", np.ascontiguousarray(boundary_index, dtype=np.int64))
            keep(boundary, "normal", floats(boundary_normal))
            keep_names(boundary, "name", boundary_name)

    def write_contact(
        self, name: str, points: FloatArray, normal: FloatArray, arc_length: FloatArray, weight: FloatArray
    ) -> None:
        """Store one contact's slave nodes, (m, 2), (m, 2), (m,), (m,), and make its empty history (0, m).

        All contacts must be there before the first step.
        """
        if self._history.started:
            raise ValueError(f"contact {name} comes after the path was started")
        count = len(points)
        geometry = {"points": points, "normal": normal, "arc_length": arc_length, "weight": weight}
        for key, array in geometry.items():
            check_shape(f"{key} of contact {name}", array, (count, 2) if array.ndim == 2 else (count,))
        with self._storing():
            group = self._file["contacts"].require_group(checked_name(name))
            for key, array in geometry.items():
                keep(group, key, floats(array))
            self._history.add_contact(group, name, count)

    def start_path(
        self,
        loads: Sequence[str],
        resultants: Sequence[str],
        displacements: Sequence[str] = (),
        probes: Sequence[str] = (),
    ) -> None:
        """Make the empty /path: a factor per load, a resultant per load or support named, a displacement per
        load of a platen named; and the empty history of each probe."""
        if self._history.started:
            raise ValueError("the path was started already")
        with self._storing():
            self._history.start(loads, resultants, displacements, probes)

    def append_step(self, step: StepRecord) -> None:
        """Append one row to /path and to every contact history."""
        if not self._history.started:
            raise ValueError("start_path must be called before append_step")
        with self._storing():
            self._history.append(step)

    def write_maps(self, kind: str, maps: Mapping[str, FloatArray]) -> None:
        """Store matrices (r, 1 + u) as /maps/<kind>/<name>: they take 1 and the u unknowns of the path, load
        factors, motions, pressures and tractions, to what they are named after."""
        with self._storing():
            group = ordered(self._file.require_group("maps"), kind)
            for name, matrix in maps.items():
                keep(group, name, floats(matrix))

    def write_series(
        self, step: int, arrays: Mapping[str, NDArray[Any]], attributes: Mapping[str, float]
    ) -> None:
        """Store what reproduces ``step`` as /series/<step>/<name>; numbers are attributes of the group."""
        if step < 0:
            raise ValueError(f"step {step} is negative")
        with self._storing():
            self._series.add(step, arrays, attributes)

    def path_table(self) -> Mapping[str, NDArray[Any]]:
        """The path so far as columns of a table."""
        with self._storing():
            return path_table(self._file)

    def saved_positions(self) -> list[float]:
        """Positions of the states saved so far, an earlier process's included."""
        with self._storing():
            return self._states.positions

    def write_checkpoint(self, name: str, content: bytes) -> None:
        """Store what the run goes on from as /checkpoint/<name>, in place of what is there."""
        with self._storing():
            self._checkpoints.put(name, content)

    def write_fields(
        self,
        position: float,
        bodies: Mapping[str, Mapping[str, FloatArray]],
        attributes: Mapping[str, Attribute] | None = None,
    ) -> int:
        """Store one saved state as /fields/<k>/<body>/<field>, and return k; k counts from 0."""
        with self._storing():
            return self._states.add(position, bodies, attributes or {})

    def set_attributes(self, attributes: Mapping[str, Attribute]) -> None:
        """Set attributes of the root, replacing those of the same name, and commit."""
        with self._storing():
            for name, value in attributes.items():
                self._file.attrs[name] = value
            self._commit()

    def confirm_attribute(self, name: str, value: str) -> None:
        """Set an attribute of the root that is not there yet; RunError where it is there and another."""
        with self._storing():
            if self._file.attrs.setdefault(name, value) != value:
                raise differs(name)

    def set_status(self, status: str) -> None:
        """Set the status: running, done, failed or stopped."""
        self.set_attributes({"status": status})

    def close(self) -> None:
        """Close the file; twice is allowed. A step that was cut short is dropped from every dataset."""
        if not self._file.id.valid:
            return
        with self._storing():
            self._history.truncate()
            self._states.truncate()
            self._checkpoints.release()
            self._file.close()
            self._store.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def commit(self) -> None:
        """Put all that was written so far on disk."""
        with self._storing():
            self._commit()

    def _commit(self) -> None:
        self._file.flush()
        self._store.commit()

    @contextmanager
    def together(self) -> Iterator[None]:
        """Hold signals back once for all that is written within the block, a step's parts, say: for each of
        them that takes as long as to write a few numbers."""
        with self._storing():
            self._shielded = True
            try:
                yield
            finally:
                self._shielded = False

    @contextmanager
    def _storing(self) -> Iterator[None]:
        """Turn what HDF5 raises when the disk is full or gone into a RunError; signals have to wait."""
        try:
            with nullcontext() if self._shielded else shielded():
                yield
        except (OSError, RuntimeError) as error:
            raise cannot_write(self._path, error) from error
