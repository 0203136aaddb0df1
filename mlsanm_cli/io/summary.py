"""Text files of a run: summary.json, events.jsonl, CSV tables, resolved.toml, and path.csv, the load path as
a table with one row per finished step, for spreadsheets and pandas."""

from __future__ import annotations

import errno
import json
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import tomli_w
from numpy.typing import NDArray

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.closing import Closing
from mlsanm_cli.errors import RunError
from mlsanm_cli.io.files import cannot_write, write_text
from mlsanm_cli.system import open_regular
from mlsanm_cli.toml import plain


def write_json_atomic(path: Path, mapping: Mapping[str, Any]) -> None:
    """Writes ``mapping`` as indented JSON, nan and inf as null. Raises RunError if that fails."""
    text = json.dumps(plain(mapping), indent=2, ensure_ascii=False, allow_nan=False)
    write_text(path, text + "\n")


DEPTHS = {
    **dict.fromkeys(("contacts", "probes", "peak_stress"), 2),
    **dict.fromkeys(("forces", "error_estimate", "quality", "limits", "seconds"), 1),
}
"""Entries of a summary that are mappings, 1, and mappings of mappings, 2."""


def read_summary(path: Path) -> dict[str, Any]:
    """Reads the summary of a run. Raises RunError if that fails, or if it is damaged."""
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise RunError(f"{path} cannot be read: {error}", hint="remove it; run.h5 holds the run") from error
    if not _is_summary(content):
        raise RunError(f"{path} is not the summary of a run", hint="remove it; run.h5 holds the run")
    return dict(content)


def _is_summary(content: Any) -> bool:
    """Whether a mapping has mappings where those of runs have them."""
    if not isinstance(content, dict):
        return False
    for name, depth in DEPTHS.items():
        values = [content.get(name) or {}]
        for _ in range(depth):
            if not all(isinstance(value, dict) for value in values):
                return False
            values = [inner for value in values for inner in value.values()]
    return all(isinstance(content.get(name) or [], list) for name in ("warnings", "checks"))


def toml_text(mapping: Mapping[str, Any]) -> str:
    """``mapping`` as TOML text, which reads back as equal values to the last bit."""
    return tomli_w.dumps(mapping)


def write_csv(path: Path, columns: Mapping[str, NDArray[Any]]) -> None:
    """Writes columns (n,) by name; floats read back equal. Raises RunError if that fails."""
    rows = zip(*(column.tolist() for column in columns.values()), strict=True)
    lines = [",".join(columns), *(",".join(map(repr, row)) for row in rows)]
    write_text(path, "\n".join(lines) + "\n")


class EventLog(Closing):
    """events.jsonl: one JSON object per line, written immediately; a resumed run appends to it."""

    def __init__(self, path: Path, rows: int | None = None) -> None:
        """Opens ``path``, and removes an incomplete last line and the steps from number ``rows`` on, which a
        resumed run repeats. Raises RunError."""
        self._path = path
        try:
            flags = os.O_RDWR | os.O_APPEND | os.O_CREAT
            self._stream = os.fdopen(open_regular(path, flags), "a+b", buffering=0)
            self._stream.seek(0)
            lines = self._stream.read().split(b"\n")[:-1]
            kept = [line for line in lines if rows is None or not _is_repeated_step(line, rows)]
            self._stream.truncate(0)
            self._stream.write(b"".join(line + b"\n" for line in kept))
        except OSError as error:
            raise cannot_write(path, error) from error
        self._earlier = set(kept)

    def write(self, event: str, **values: Any) -> None:
        """Appends ``{"event": event, ...values}``. Raises RunError if that fails."""
        self._append(_line(event, values))

    def write_once(self, event: str, **values: Any) -> None:
        """The same, unless the line existed when the log was opened."""
        line = _line(event, values)
        if line not in self._earlier:
            self._append(line)

    def _append(self, line: bytes) -> None:
        try:
            # One write call per line: a kill leaves complete lines only.
            done = self._stream.write(line + b"\n")
        except OSError as error:
            raise cannot_write(self._path, error) from error
        if done != len(line) + 1:
            raise cannot_write(self._path, OSError(errno.ENOSPC, os.strerror(errno.ENOSPC)))

    def close(self) -> None:
        """Closes the file; may be called twice."""
        self._stream.close()


def _is_repeated_step(line: bytes, rows: int) -> bool:
    try:
        event = json.loads(line)
        return bool(event["event"] == "step" and event["index"] >= rows)
    except (ValueError, KeyError, TypeError):
        # Lines of other programs are kept.
        return False


def _line(event: str, values: Mapping[str, Any]) -> bytes:
    return json.dumps(plain({"event": event, **values}), ensure_ascii=False, allow_nan=False).encode()


def path_table(root: Any) -> Mapping[str, NDArray[Any]]:
    """Columns (S+1,) of the path in an open run.h5 ``root``; empty if it has no path. Position and stage,
    load factors, displacements of platens and the work of their forces, forces of loads and supports; for
    every contact the force on the slave, the largest pressure, the closed length and the dissipated work."""
    if "path" not in root:
        return {}
    position = root["path/position"][...]
    columns: dict[str, NDArray[Any]] = {
        "position": position,
        # The end of a stage belongs to it, and the start of the path to the first one.
        "stage": np.maximum(np.ceil(position), 1.0).astype(np.int64),
    }
    columns |= {f"factor.{name}": data[...] for name, data in items_of(root, "path/factors")}
    forces = {name: data[...] for name, data in items_of(root, "path/resultants")}
    for name, data in items_of(root, "path/displacements"):
        moved = data[...]
        columns |= _vector(f"displacement.{name}", moved)
        if name in forces:
            columns[f"work.{name}"] = _work(forces[name], moved)
    for name, force in forces.items():
        columns |= _vector(f"force.{name}", force)
    for name, group in items_of(root, "contacts"):
        columns |= _contact(name, group, forces.get(f"contact {name}"))
    return columns


def _contact(name: str, group: Any, force: FloatArray | None) -> dict[str, NDArray[Any]]:
    weight, pressure = group["weight"][...], group["pressure"][...]
    if force is None:
        # At finite strain the force is stored, as directions and lengths change.
        force = force_on_slave(weight, group["normal"][...], pressure, group["traction"][...])
    columns = _vector(f"contact.{name}.force", force)
    columns[f"contact.{name}.peak_pressure"] = pressure.max(axis=1, initial=0.0)
    columns[f"contact.{name}.closed_length"] = (group["status"][...] != 0) @ weight
    columns[f"contact.{name}.dissipated_work"] = group["dissipated_work"][...]
    return columns


def force_on_slave(
    weight: FloatArray, normal: FloatArray, pressure: FloatArray, traction: FloatArray | None = None
) -> FloatArray:
    """Force (..., 2) of pressures and tractions (..., m) on a slave with surface lengths (m,) and normals of
    the master (m, 2), at small strain."""
    force = (pressure * weight) @ normal
    if traction is not None:
        force = force + (traction * weight) @ np.stack([normal[:, 1], -normal[:, 0]], axis=1)
    return np.asarray(force, dtype=np.float64)


def _work(force: FloatArray, moved: FloatArray) -> FloatArray:
    """Work (S+1,) of a force (S+1, 2) along displacements (S+1, 2), by the trapezoidal rule."""
    steps = (0.5 * (force[1:] + force[:-1]) * np.diff(moved, axis=0)).sum(axis=1)
    return np.concatenate([[0.0], np.cumsum(steps)])


def _vector(name: str, values: FloatArray) -> dict[str, NDArray[Any]]:
    return {f"{name}_x": values[:, 0], f"{name}_y": values[:, 1]}


def items_of(root: Any, place: str) -> list[tuple[str, Any]]:
    """The members of a group of an open file, empty if it does not exist."""
    return list(root[place].items()) if place in root else []
