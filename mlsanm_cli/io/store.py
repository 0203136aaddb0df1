"""A directory of arrays that outlives a run: whole files or none, checked when read, kept below a size.

A file is a line that names the format, the SHA-256 of what follows, and an uncompressed .npz archive that
also holds its own key. It is written under a name of its own and renamed, so many processes may write the
same entry at once: they write the same content, and the last one stays. A file that does not check is removed
and counts as missing. Nothing here can end a run: a directory that cannot be used is told of once.
"""

from __future__ import annotations

import hashlib
import io
import os
import tempfile
import time
import zipfile
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

MAGIC = b"mlsanm operators 1\n"
SUFFIX = ".mlsanm"
KEY = "key"
ABANDONED = 3600.0
"""Temporary files older than this, in seconds, belong to no living writer."""

Arrays = Mapping[str, np.ndarray[Any, Any]]


@dataclass(frozen=True)
class Usage:
    """What lies in a store."""

    entries: int
    bytes: int


class Store:
    """Arrays by name below ``directory``, of which at most ``limit`` bytes are kept; ``say`` hears of
    trouble, of each kind once."""

    def __init__(self, directory: Path, limit: int, say: Callable[[str], None]) -> None:
        self._directory = directory
        self._limit = limit
        self._say = say
        self._said: set[str] = set()
        self._writable = True

    def read(self, name: str) -> Arrays | None:
        """The arrays kept under ``name``, None where there are none or they are damaged."""
        path = self._path(name)
        try:
            content = path.read_bytes()
        except FileNotFoundError:
            return None
        except OSError as error:
            self._tell("read", f"the cache of operators cannot be read ({error}); they are computed")
            return None
        arrays = unpacked(content, name)
        if arrays is None:
            self._tell("damaged", f"a damaged file in the cache of operators is computed anew: {path}")
            _remove(path)
            return None
        try:
            os.utime(path)
        except OSError:
            # Somebody else's cache, or one that may only be read: its owner decides what goes first.
            return arrays
        return arrays

    def write(self, name: str, arrays: Arrays) -> None:
        """Keep ``arrays`` under ``name``, and remove what was not used for longest if there is too much."""
        if not self._writable:
            return
        path = self._path(name)
        content = packed(arrays, name)
        if len(content) > self._limit:
            return
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            self._make_room(len(content))
            _write(path, content)
        except OSError as error:
            self._writable = False
            self._tell(
                "write",
                f"operators cannot be kept for later runs ({error}); "
                f"set MLSANM_CACHE_DIR to a directory that can be written, or use --no-cache",
            )

    def usage(self) -> Usage:
        """How many entries there are, and their bytes."""
        sizes = [size for _, size, _ in self._entries()]
        return Usage(len(sizes), sum(sizes))

    def clear(self) -> Usage:
        """Remove all entries; what was removed."""
        gone = [size for _, size, path in self._entries() if _remove(path)]
        for path in self._temporary():
            _remove(path)
        return Usage(len(gone), sum(gone))

    def _path(self, name: str) -> Path:
        return self._directory / f"{name}{SUFFIX}"

    def _entries(self) -> Iterator[tuple[float, int, Path]]:
        """Time of last use, size and path of every entry."""
        for path in self._directory.rglob(f"*{SUFFIX}"):
            try:
                status = path.stat()
            except OSError:  # another process was quicker
                continue
            yield status.st_mtime, status.st_size, path

    def _temporary(self) -> Iterator[Path]:
        yield from self._directory.rglob(f"*{SUFFIX}.*.tmp")

    def _make_room(self, wanted: int) -> None:
        entries = sorted(self._entries())
        residual_vector = sum(size for _, size, _ in entries) + wanted - self._limit
        for _, size, path in entries:
            if residual_vector <= 0:
                break
            residual_vector -= size
            _remove(path)
        for path in self._temporary():
            try:
                abandoned = time.time() - path.stat().st_mtime > ABANDONED
            except OSError:
                continue
            if abandoned:
                _remove(path)

    def _tell(self, kind: str, message: str) -> None:
        if kind not in self._said:
            self._said.add(kind)
            self._say(message)


def packed(arrays: Arrays, name: str) -> bytes:
    """The content of the file that keeps ``arrays`` under ``name``."""
    archive = io.BytesIO()
    named: dict[str, Any] = {KEY: np.array(name), **{f"_{part}": a for part, a in arrays.items()}}
    np.savez(archive, **named)
    payload = archive.getvalue()
    return MAGIC + hashlib.sha256(payload).digest() + payload


def unpacked(content: bytes, name: str) -> Arrays | None:
    """The arrays in a file's ``content``, None where a bit of it is not as it was written under ``name``."""
    start = len(MAGIC) + hashlib.sha256().digest_size
    payload = content[start:]
    if not content.startswith(MAGIC) or hashlib.sha256(payload).digest() != content[len(MAGIC) : start]:
        return None
    try:
        with np.load(io.BytesIO(payload), allow_pickle=False) as archive:
            arrays = {part: archive[part] for part in archive.files}
    except (ValueError, OSError, zipfile.BadZipFile):
        return None
    if str(arrays.pop(KEY, "")) != name:
        return None
    return {part.removeprefix("_"): values for part, values in arrays.items()}


def _write(path: Path, content: bytes) -> None:
    handle, temporary = tempfile.mkstemp(prefix=f"{path.name}.", suffix=".tmp", dir=path.parent)
    try:
        with os.fdopen(handle, "wb") as stream:
            stream.write(content)
        os.replace(temporary, path)
    except BaseException:
        _remove(Path(temporary))
        raise


def _remove(path: Path) -> bool:
    try:
        path.unlink()
    except OSError:
        return False
    return True
