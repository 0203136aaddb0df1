"""Text files of a run, atomic files, and files with a digest of their content."""

from __future__ import annotations

import csv
import errno
import hashlib
import io
import json
import os
import re
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from functools import lru_cache
from pathlib import Path
from typing import Any

import tomli_w
from numpy.typing import NDArray

from mlsanm_cli import system
from mlsanm_cli.errors import RunError, WriteError
from mlsanm_cli.records import Closing
from mlsanm_cli.toml import plain

TEMPORARY_SUFFIX = ".tmp"
toml_text = tomli_w.dumps
"""A mapping as TOML text, which reads back as equal values to the last bit."""


@contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """Yields a temporary path in the same directory, renamed to ``path`` at the end of a block without an
    error. Raises WriteError if the file cannot be written."""
    temporary = path.with_name(path.name + TEMPORARY_SUFFIX)
    try:
        with system.replacing(path, temporary):
            yield temporary
    except OSError as error:
        raise cannot_write(path, error) from error


def write_text(path: Path, text: str) -> None:
    """Writes ``text`` as UTF-8 with Unix line ends, atomically. Raises WriteError."""
    with replacing(path) as temporary:
        temporary.write_text(text, encoding="utf-8", newline="\n")


def cannot_write(path: Path, error: Exception) -> WriteError:
    """The WriteError for a file that cannot be written, with the reason given by the system."""
    # HDF5 wraps the reason in several lines about its own buffers.
    inner = re.search(r"error message = '([^']*)'", str(error))
    reason = inner[1] if inner else (str(error).splitlines() or [type(error).__name__])[0]
    hint = "check the free disk space and the permissions of the directory"
    if isinstance(error, OSError):
        reason = error.strerror or reason
        if error.errno in (errno.ELOOP, errno.EINVAL, errno.EMLINK):
            hint = "remove it, or choose another directory"
    return WriteError(f"cannot write {path}: {reason}", hint=hint)


SEAL = b"mlsanm blake2b "
"""What precedes the digest of the content at the end of a sealed file."""


def sealed(content: bytes) -> bytes:
    return content + SEAL + hashlib.blake2b(content).digest()


def check_seal(path: Path) -> None:
    """Raises OSError if a sealed file is damaged; one that has not changed is read once."""
    found = path.stat()
    _unsealed(path, found.st_mtime_ns, found.st_size)


@lru_cache(maxsize=8)
def _unsealed(path: Path, changed: int, size: int) -> None:
    unsealed(path)


def unsealed(path: Path) -> bytes:
    """The content of a sealed file, or of a file without a seal. Raises OSError if it is damaged."""
    whole = path.read_bytes()
    content, seal, _ = whole.rpartition(SEAL)
    if not seal or len(whole) - len(content) != len(SEAL) + hashlib.blake2b().digest_size:
        return whole
    if sealed(content) != whole:
        raise OSError("its content does not agree with its digest")
    return content


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
    known = isinstance(content, dict)
    for name, depth in DEPTHS.items() if known else ():
        values = [content.get(name) or {}]
        for _ in range(depth):
            known = known and all(isinstance(value, dict) for value in values)
            values = [inner for value in values if known for inner in value.values()]
    if not known or not all(isinstance(content.get(name) or [], list) for name in ("warnings", "checks")):
        raise RunError(f"{path} is not the summary of a run", hint="remove it; run.h5 holds the run")
    return dict(content)


def write_csv(path: Path, columns: Mapping[str, NDArray[Any]]) -> None:
    """Writes columns (n,) by name; floats read back equal. Raises RunError if that fails."""
    text = io.StringIO()
    # Names with commas, as those of supports at points, are quoted.
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(columns)
    writer.writerows(zip(*(map(repr, column.tolist()) for column in columns.values()), strict=True))
    write_text(path, text.getvalue())


class EventLog(Closing):
    """events.jsonl: one JSON object per line, written immediately; a resumed run appends to it."""

    def __init__(self, path: Path, rows: int | None = None) -> None:
        """Opens ``path`` without an incomplete last line and steps from ``rows`` on. Raises RunError."""
        self._path = path
        try:
            flags = os.O_RDWR | os.O_APPEND | os.O_CREAT
            self._stream = os.fdopen(system.open_regular(path, flags), "a+b", buffering=0)
            self._stream.seek(0)
            kept = [one for one in self._stream.read().split(b"\n")[:-1] if not _is_step_from(one, rows)]
            self._stream.truncate(0)
            self._stream.write(b"".join(line + b"\n" for line in kept))
        except OSError as error:
            raise cannot_write(path, error) from error
        self._earlier = set(kept)

    def write(self, event: str, **values: Any) -> None:
        """Appends ``{"event": event, ...values}``. Raises RunError if that fails."""
        line = _line(event, values)
        try:
            # One write call per line: a kill leaves complete lines only.
            done = self._stream.write(line + b"\n")
        except OSError as error:
            raise cannot_write(self._path, error) from error
        if done != len(line) + 1:
            raise cannot_write(self._path, OSError(errno.ENOSPC, os.strerror(errno.ENOSPC)))

    def write_once(self, event: str, **values: Any) -> None:
        """The same, unless the line existed when the log was opened."""
        if _line(event, values) not in self._earlier:
            self.write(event, **values)

    def close(self) -> None:
        self._stream.close()


def _is_step_from(line: bytes, rows: int | None) -> bool:
    try:
        event = json.loads(line)
        return rows is not None and bool(event["event"] == "step" and event["index"] >= rows)
    except (ValueError, KeyError, TypeError):
        # Lines of other programs are kept.
        return False


def _line(event: str, values: Mapping[str, Any]) -> bytes:
    return json.dumps(plain({"event": event, **values}), ensure_ascii=False, allow_nan=False).encode()
