"""Text files of a run: summary.json, events.jsonl, CSV tables and resolved.toml."""

from __future__ import annotations

import csv
import errno
import io
import json
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import tomli_w
from numpy.typing import NDArray

from mlsanm_cli.errors import RunError
from mlsanm_cli.io.files import cannot_write, write_text
from mlsanm_cli.records import Closing
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
    header = io.StringIO()
    # Names with commas, as those of supports at points, are quoted.
    csv.writer(header, lineterminator="").writerow(columns)
    lines = [header.getvalue(), *(",".join(map(repr, row)) for row in rows)]
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
