"""Atomic files, and locks on run directories.

One process writes to a directory at a time; the system releases the lock of a process that has ended."""

from __future__ import annotations

import errno
import hashlib
import os
import re
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from functools import lru_cache
from pathlib import Path

from mlsanm_cli import system
from mlsanm_cli.errors import RunError, WriteError
from mlsanm_cli.system import host, open_regular, try_lock

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


LOCK_FILE = "run.lock"
UNLINKS_OPEN_FILES = os.name != "nt"
"""Windows cannot remove an open file; once it is closed, another process may have locked it."""


@contextmanager
def locked(directory: Path) -> Iterator[None]:
    """Keeps other processes from writing to ``directory``, which is created if it does not exist. Raises
    RunError, naming the process, if another one writes to it, and if the directory is not writable."""
    path = directory / LOCK_FILE
    try:
        directory.mkdir(parents=True, exist_ok=True)
        fd = _acquire(path)
    except OSError as error:
        raise cannot_write(path, error) from error
    if fd is None:
        refuse_held(directory)
        raise RunError(f"{directory} is being written by another process", hint="wait until it has ended")
    try:
        yield
    finally:
        if UNLINKS_OPEN_FILES:
            path.unlink(missing_ok=True)
        os.close(fd)
        if not UNLINKS_OPEN_FILES:
            # Fails if another process has opened it in the meantime.
            with suppress(OSError):
                path.unlink(missing_ok=True)


def refuse_held(directory: Path) -> None:
    """Raises RunError if another process writes to ``directory``."""
    found = holder(directory)
    if found:
        raise RunError(
            f"{directory} is being written by {found}", hint="wait until it has ended, or use another --out"
        )


def holder(directory: Path) -> str:
    """The process that writes to ``directory`` in words, "" if there is none; files left by an ended one do
    not count."""
    try:
        fd = open_regular(directory / LOCK_FILE, os.O_RDONLY)
    except OSError:
        return ""
    try:
        # A file without content is locked, but not written yet.
        if try_lock(fd, shared=True):
            return ""
        return os.read(fd, 4096).decode(errors="replace") or "another process"
    finally:
        os.close(fd)


def _acquire(path: Path) -> int | None:
    """The locked file, with this process written to it; None if another process holds it. Raises OSError."""
    while True:
        fd = open_regular(path, os.O_RDWR | os.O_CREAT)
        try:
            if not try_lock(fd):
                os.close(fd)
                return None
            # The previous holder may have removed the file in between; a lock on that has no effect.
            with suppress(FileNotFoundError):
                if os.path.samestat(os.fstat(fd), path.stat()):
                    os.ftruncate(fd, 0)
                    os.write(fd, f"process {os.getpid()} on {host()}".encode())
                    return fd
        except OSError:
            os.close(fd)
            raise
        os.close(fd)
