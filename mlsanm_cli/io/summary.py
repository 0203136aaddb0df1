"""Small text files of a run: summary.json, events.jsonl, the CSV per contact, resolved.toml."""

from __future__ import annotations

import errno
import json
import math
import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import tomli_w

from mlsanm_cli.closing import Closing
from mlsanm_cli.errors import RunError
from mlsanm_cli.io.atomic import cannot_write, write_text
from mlsanm_cli.system import open_regular

if TYPE_CHECKING:
    from numpy.typing import NDArray

INTERFACE_COLUMNS = ("x", "y", "arc_length", "gap", "pressure", "traction", "slip", "status")


def to_plain(value: Any) -> Any:
    """``value`` as JSON can hold it: numpy scalars and arrays converted, nan and inf as None, paths as text.

    Raises TypeError for what has no plain form, so that nothing odd is written silently.
    """
    if value is None or isinstance(value, str | bool):
        return value
    if isinstance(value, np.ndarray | np.generic):
        return to_plain(value.tolist())
    if isinstance(value, int):
        return int(value)
    if isinstance(value, float):
        return float(value) if math.isfinite(value) else None
    if isinstance(value, Path):
        return str(value)
    if isinstance(value, Mapping):
        return {str(key): to_plain(item) for key, item in value.items()}
    if isinstance(value, Sequence | set | frozenset) and not isinstance(value, bytes | bytearray):
        return [to_plain(item) for item in (sorted(value) if isinstance(value, set | frozenset) else value)]
    raise TypeError(f"no JSON form for a value of type {type(value).__name__}")


def write_json_atomic(path: Path, mapping: Mapping[str, Any]) -> None:
    """Write ``mapping`` as indented JSON; nan and inf become null. RunError if the file cannot be written."""
    text = json.dumps(to_plain(mapping), indent=2, ensure_ascii=False, allow_nan=False)
    write_text(path, text + "\n")


def read_json(path: Path) -> dict[str, Any]:
    """The mapping that `write_json_atomic` wrote to ``path``. RunError if it cannot be read."""
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise RunError(f"{path} cannot be read: {error}", hint="remove it; run.h5 holds the run") from error
    if not isinstance(content, dict):
        raise RunError(f"{path} is not the summary of a run", hint="remove it; run.h5 holds the run")
    return content


def toml_text(mapping: Mapping[str, Any]) -> str:
    """``mapping`` as TOML text; reading it back gives equal values, bit for bit."""
    return tomli_w.dumps(mapping)


def write_csv(path: Path, columns: Mapping[str, NDArray[Any]]) -> None:
    """Write columns (n,) by name; floats read back equal. RunError if the file cannot be written."""
    rows = zip(*(column.tolist() for column in columns.values()), strict=True)
    lines = [",".join(columns), *(",".join(map(repr, row)) for row in rows)]
    write_text(path, "\n".join(lines) + "\n")


class EventLog(Closing):
    """events.jsonl: one JSON object per line, each on disk as soon as it is written.

    Opened for appending, so that a run that is resumed later keeps its history.
    """

    def __init__(self, path: Path, rows: int | None = None) -> None:
        """Open ``path``, less a last line that was cut short, and less the steps behind so many ``rows`` of
        run.h5, which come again; RunError if that is not possible."""
        self._path = path
        try:
            flags = os.O_RDWR | os.O_APPEND | os.O_CREAT
            self._stream = os.fdopen(open_regular(path, flags), "a+b", buffering=0)
            self._stream.seek(0)
            lines = self._stream.read().split(b"\n")[:-1]
            kept = [line for line in lines if rows is None or not _is_step_behind(line, rows)]
            self._stream.truncate(0)
            self._stream.write(b"".join(line + b"\n" for line in kept))
        except OSError as error:
            raise cannot_write(path, error) from error
        self._earlier = set(kept)

    def write(self, event: str, **values: Any) -> None:
        """Append ``{"event": event, ...values}``; RunError if the disk refuses it."""
        self._append(_line(event, values))

    def write_once(self, event: str, **values: Any) -> None:
        """The same, unless the line was there when the log was opened."""
        line = _line(event, values)
        if line not in self._earlier:
            self._append(line)

    def _append(self, line: bytes) -> None:
        try:
            # One write call per line: a run killed here leaves whole lines only.
            done = self._stream.write(line + b"\n")
        except OSError as error:
            raise cannot_write(self._path, error) from error
        if done != len(line) + 1:
            raise cannot_write(self._path, OSError(errno.ENOSPC, os.strerror(errno.ENOSPC)))

    def close(self) -> None:
        """Close the file; closing twice is allowed."""
        self._stream.close()


def _is_step_behind(line: bytes, rows: int) -> bool:
    try:
        event = json.loads(line)
        return bool(event["event"] == "step" and event["index"] >= rows)
    except (ValueError, KeyError, TypeError):
        # Somebody else's line stays.
        return False


def _line(event: str, values: Mapping[str, Any]) -> bytes:
    return json.dumps(to_plain({"event": event, **values}), ensure_ascii=False, allow_nan=False).encode()
