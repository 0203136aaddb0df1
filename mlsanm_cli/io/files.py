"""Atomic files, and files with a digest of their content."""

from __future__ import annotations

import errno
import hashlib
import re
from collections.abc import Iterator
from contextlib import contextmanager
from functools import lru_cache
from pathlib import Path

from mlsanm_cli import system
from mlsanm_cli.errors import WriteError

TEMPORARY_SUFFIX = ".tmp"


@contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """Yields a temporary path in the same directory (a rename is atomic within one file system), and renames
    it to ``path`` when the block ends without an error. Raises WriteError if the file cannot be written;
    ``path`` is then unchanged."""
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
    inner = re.search(r"error message = '([^']*)'", str(error))
    if isinstance(error, OSError) and error.strerror:
        reason = error.strerror
    elif inner:
        # HDF5 wraps the reason in several lines about its own buffers.
        reason = inner[1]
    else:
        reason = (str(error).splitlines() or [type(error).__name__])[0]
    if isinstance(error, OSError) and error.errno in (errno.ELOOP, errno.EINVAL, errno.EMLINK):
        hint = "remove it, or choose another directory"
    else:
        hint = "check the free disk space and the permissions of the directory"
    return WriteError(f"cannot write {path}: {reason}", hint=hint)


SEAL = b"mlsanm blake2b "
"""What precedes the digest of the content at the end of a sealed file."""


def sealed(content: bytes) -> bytes:
    """The content of a file, followed by its digest."""
    return content + SEAL + hashlib.blake2b(content).digest()


def check_seal(path: Path) -> None:
    """Raises OSError if a sealed file is damaged; one that has not changed is read once."""
    found = path.stat()
    _read_once(path, found.st_mtime_ns, found.st_size)


@lru_cache(maxsize=8)
def _read_once(path: Path, changed: int, size: int) -> None:
    unsealed(path)


def unsealed(path: Path) -> bytes:
    """The content of a sealed file, or of a file without a seal. Raises OSError if it is damaged."""
    whole = path.read_bytes()
    place = len(whole) - len(SEAL) - hashlib.blake2b().digest_size
    content = whole[: max(place, 0)]
    if whole[max(place, 0) :].startswith(SEAL):
        if sealed(content) != whole:
            raise OSError("its content does not agree with its digest")
        return content
    return whole
