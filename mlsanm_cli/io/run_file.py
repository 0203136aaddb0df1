"""Writer of run.h5, flushed at every step so that a killed run keeps all its finished steps.

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

Equal runs give equal arrays, /path/seconds apart: nothing that varies from run to run (times, paths, machine)
is stored in an array.
"""

from __future__ import annotations

import re
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any, Self

import h5py
import numpy as np
from numpy.typing import ArrayLike, NDArray

from mlsanm_cli import __version__
from mlsanm_cli.errors import RunError
from mlsanm_cli.io.atomic import cannot_write
from mlsanm_cli.io.columns import Column
from mlsanm_cli.io.records import (
    CONTACT_COLUMNS,
    CONTACT_TOTALS,
    FORMAT,
    PATH_COLUMNS,
    PROBE_COLUMNS,
    ContactRecord,
    StepRecord,
)

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence
    from pathlib import Path
    from types import TracebackType

# HDF5 1.8 to 1.10: compact groups, and readable by every program in use (ParaView, MATLAB, old h5py).
_LIBRARY_VERSIONS = ("v108", "v110")

FloatArray = NDArray[np.float64]
Attribute = str | int | float
__all__ = ["Attribute", "ContactRecord", "RunFile", "StepRecord", "checked_name"]


class RunFile:
    """run.h5 open for writing. Made with `RunFile.create`; a context manager that closes the file.

    An exception leaves ``status`` as the caller set it last. Every method raises RunError if the file cannot
    be written (full disk) or a name cannot be stored, and ValueError for arrays of the wrong shape.
    """

    def __init__(self, file: Any, path: Path) -> None:
        self._file = file
        self._path = path
        self._columns: dict[str, Column] = {}
        self._rows = 0
        self._contacts: list[str] = []
        self._loads: list[str] | None = None
        self._resultants: list[str] = []
        self._displacements: list[str] = []
        self._probes: list[str] = []
        self._states = 0

    @classmethod
    def create(cls, path: Path, attributes: Mapping[str, Attribute]) -> RunFile:
        """Create ``path`` with status "running"; RunError if it exists or cannot be made."""
        try:
            # Without locking other programs can read the file while the run goes on.
            file = h5py.File(path, "x", libver=_LIBRARY_VERSIONS, locking=False)
        except OSError as error:
            if path.exists():
                raise RunError(f"{path} exists already", hint="use --force or another --out") from error
            raise cannot_write(path, error) from error
        run = cls(file, path)
        run.set_attributes(
            {"format": FORMAT, "mlsanm_version": __version__, "status": "running", **attributes}
        )
        with run._storing():
            for name in ("bodies", "contacts"):
                # Creation order is the order of the case; without this readers see alphabetical order.
                file.create_group(name, track_order=True)
            file.flush()
        return run

    def write_case(self, raw: str, resolved: str) -> None:
        """Store the case file's text and the resolved case's TOML text."""
        with self._storing():
            group = self._file.create_group("case")
            group["raw"] = raw
            group["resolved"] = resolved

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
        _check_shape(f"points of body {name}", points, (len(points), 2))
        _check_shape(f"boundary normals of body {name}", boundary_normal, (count, 2))
        if len(boundary_name) != count:
            raise ValueError(f"body {name}: {len(boundary_name)} boundary names for {count} boundary nodes")
        with self._storing():
            group = self._file["bodies"].create_group(checked_name(name))
            group["points"] = _floats(points)
            boundary = group.create_group("boundary")
            boundary["index"] = np.ascontiguousarray(boundary_index, dtype=np.int64)
            boundary["normal"] = _floats(boundary_normal)
            names = np.array(list(boundary_name), dtype=object)
            boundary.create_dataset("name", data=names, dtype=h5py.string_dtype())

    def write_contact(
        self, name: str, points: FloatArray, normal: FloatArray, arc_length: FloatArray, weight: FloatArray
    ) -> None:
        """Store one contact's slave nodes, (m, 2), (m, 2), (m,), (m,), and make its empty history (0, m).

        All contacts must be there before the first step.
        """
        if self._rows:
            raise ValueError(f"contact {name} comes after the first step")
        count = len(points)
        geometry = {"points": points, "normal": normal, "arc_length": arc_length, "weight": weight}
        for key, array in geometry.items():
            _check_shape(f"{key} of contact {name}", array, (count, 2) if array.ndim == 2 else (count,))
        with self._storing():
            group = self._file["contacts"].create_group(checked_name(name))
            for key, array in geometry.items():
                group[key] = _floats(array)
            for key, dtype in CONTACT_COLUMNS.items():
                self._add_column(group, f"contacts/{name}/{key}", key, (count,), dtype)
            for key, dtype in CONTACT_TOTALS.items():
                self._add_column(group, f"contacts/{name}/{key}", key, (), dtype)
        self._contacts.append(name)

    def start_path(
        self,
        loads: Sequence[str],
        resultants: Sequence[str],
        displacements: Sequence[str] = (),
        probes: Sequence[str] = (),
    ) -> None:
        """Make the empty /path: a factor per load, a resultant per load or support named, a displacement per
        load of a platen named; and the empty history of each probe."""
        if self._loads is not None:
            raise ValueError("the path was started already")
        with self._storing():
            group = self._file.create_group("path")
            for key, dtype in PATH_COLUMNS.items():
                self._add_column(group, key, key, (), dtype)
            factors = group.create_group("factors", track_order=True)
            for name in loads:
                self._add_column(factors, f"factors/{name}", checked_name(name), (), np.float64)
            forces = group.create_group("resultants", track_order=True)
            for name in resultants:
                self._add_column(forces, f"resultants/{name}", checked_name(name), (2,), np.float64)
            moves = group.create_group("displacements", track_order=True)
            for name in displacements:
                self._add_column(moves, f"displacements/{name}", checked_name(name), (2,), np.float64)
            if probes:
                observed = self._file.create_group("probes", track_order=True)
            for name in probes:
                point = observed.create_group(checked_name(name))
                for key, tail in PROBE_COLUMNS.items():
                    self._add_column(point, f"probes/{name}/{key}", key, tail, np.float64)
            self._file.flush()
        self._loads = list(loads)
        self._resultants = list(resultants)
        self._displacements = list(displacements)
        self._probes = list(probes)

    def append_step(self, step: StepRecord) -> None:
        """Append one row to /path and to every contact history, and flush.

        Write the step's series first: then a run killed at any moment has a series for every row.
        """
        if self._loads is None:
            raise ValueError("start_path must be called before append_step")
        _check_keys("load factors", step.factors, self._loads)
        _check_keys("resultants", step.resultants, self._resultants)
        _check_keys("displacements", step.displacements, self._displacements)
        _check_keys("contacts", step.contacts, self._contacts)
        _check_keys("probes", step.probes, self._probes)
        values: dict[str, ArrayLike] = {key: getattr(step, key) for key in PATH_COLUMNS}
        values |= {f"factors/{name}": value for name, value in step.factors.items()}
        values |= {f"resultants/{name}": value for name, value in step.resultants.items()}
        values |= {f"displacements/{name}": value for name, value in step.displacements.items()}
        for name, record in step.contacts.items():
            values |= {
                f"contacts/{name}/{key}": getattr(record, key) for key in (*CONTACT_COLUMNS, *CONTACT_TOTALS)
            }
        for name, probe in step.probes.items():
            values |= {f"probes/{name}/{key}": getattr(probe, key) for key in PROBE_COLUMNS}
        rows = {key: self._columns[key].checked(value) for key, value in values.items()}
        with self._storing():
            for key, row in rows.items():
                self._columns[key].write(self._rows, row)
            self._file.flush()
        self._rows += 1

    def write_maps(self, kind: str, maps: Mapping[str, FloatArray]) -> None:
        """Store matrices (r, 1 + u) as /maps/<kind>/<name>: they take 1 and the u unknowns of the path, load
        factors, motions, pressures and tractions, to what they are named after."""
        with self._storing():
            group = self._file.require_group("maps").create_group(kind, track_order=True)
            for name, matrix in maps.items():
                group[checked_name(name)] = _floats(matrix)

    def write_series(
        self, step: int, arrays: Mapping[str, NDArray[Any]], attributes: Mapping[str, Attribute]
    ) -> None:
        """Store what reproduces ``step`` as /series/<step>/<name>; scalars are attributes of the group."""
        if step < 0:
            raise ValueError(f"step {step} is negative")
        with self._storing():
            group = self._file.require_group("series").create_group(str(step))
            for name, array in arrays.items():
                group.create_dataset(checked_name(name), data=np.ascontiguousarray(array))
            for name, value in attributes.items():
                group.attrs[name] = value

    def write_fields(self, position: float, bodies: Mapping[str, Mapping[str, FloatArray]]) -> int:
        """Store one saved state as /fields/<k>/<body>/<field>, flush, and return k; k counts from 0."""
        index = self._states
        with self._storing():
            fields = self._file.require_group("fields")
            if "fields/position" not in self._columns:
                self._add_column(fields, "fields/position", "position", (), np.float64)
            state = fields.create_group(str(index), track_order=True)
            for body, arrays in bodies.items():
                group = state.create_group(checked_name(body))
                for name, array in arrays.items():
                    group[checked_name(name)] = _floats(array)
            # The position comes last: a state cut short by a kill is one that readers do not count.
            column = self._columns["fields/position"]
            column.write(index, column.checked(position))
            self._file.flush()
        self._states += 1
        return index

    def set_attributes(self, attributes: Mapping[str, Attribute]) -> None:
        """Set attributes of the root, replacing those of the same name, and flush."""
        with self._storing():
            for name, value in attributes.items():
                self._file.attrs[name] = value
            self._file.flush()

    def set_status(self, status: str) -> None:
        """Set the status: running, done, failed or stopped."""
        self.set_attributes({"status": status})

    def close(self) -> None:
        """Close the file; twice is allowed. A step that was cut short is dropped from every dataset."""
        if not self._file.id.valid:
            return
        with self._storing():
            for key, column in self._columns.items():
                column.truncate(self._states if key == "fields/position" else self._rows)
            self._file.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def _add_column(
        self, group: Any, key: str, name: str, tail: tuple[int, ...], dtype: type[np.generic]
    ) -> None:
        self._columns[key] = Column(group.id, name, tail, np.dtype(dtype))

    @contextmanager
    def _storing(self) -> Iterator[None]:
        """Turn what HDF5 raises when the disk is full or gone into a RunError."""
        try:
            yield
        except (OSError, RuntimeError) as error:
            raise cannot_write(self._path, error) from error


def checked_name(name: str) -> str:
    """``name`` if HDF5 can hold it as one path component; RunError otherwise."""
    if not name or name in {".", ".."} or re.search(r"[/\0]", name):
        raise RunError(f"the name {name!r} cannot be stored", hint='names must not be empty or hold "/"')
    return name


def _floats(array: ArrayLike) -> FloatArray:
    return np.ascontiguousarray(array, dtype=np.float64)


def _check_shape(what: str, array: NDArray[Any], shape: tuple[int, ...]) -> None:
    if array.shape != shape:
        raise ValueError(f"{what}: shape {array.shape}, expected {shape}")


def _check_keys(what: str, given: Mapping[str, Any], expected: Sequence[str]) -> None:
    if given.keys() != set(expected):
        raise ValueError(f"{what} of the step are {sorted(given)}, expected {sorted(expected)}")
