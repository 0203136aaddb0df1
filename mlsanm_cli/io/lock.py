"""One process at a time writes a run directory; the kernel lets go of a dead one's lock by itself."""

from __future__ import annotations

import json
import os
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from typing import TYPE_CHECKING

from mlsanm_cli.errors import RunError
from mlsanm_cli.io.atomic import cannot_write
from mlsanm_cli.system import host, open_regular, try_lock

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

LOCK_FILE = "run.lock"
UNLINKS_OPEN_FILES = os.name != "nt"
"""Windows removes no file that is open, and would remove the lock of another process otherwise."""


@dataclass(frozen=True)
class Holder:
    """The process that writes a run directory."""

    pid: int
    host: str

    def __str__(self) -> str:
        return f"process {self.pid} on {self.host}"


@contextmanager
def locked(directory: Path) -> Iterator[None]:
    """Keep other processes from writing in ``directory``, which is made where it is not there.

    Raises RunError, with the holder named, if another process does, and if the directory cannot be written.
    """
    path = directory / LOCK_FILE
    try:
        directory.mkdir(parents=True, exist_ok=True)
        fd = _taken(path)
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
            # Another process may have opened it by now: then it is that one's.
            with suppress(OSError):
                path.unlink(missing_ok=True)


def refuse_held(directory: Path) -> None:
    """RunError if another process writes in ``directory``."""
    found = holder(directory)
    if found is not None:
        raise RunError(
            f"{directory} is being written by {found}", hint="wait until it has ended, or use another --out"
        )


def holder(directory: Path) -> Holder | None:
    """Who writes in ``directory`` now; None where nobody does, whatever a dead process left."""
    try:
        fd = open_regular(directory / LOCK_FILE, os.O_RDONLY)
    except OSError:
        return None
    try:
        return None if try_lock(fd, shared=True) else _written(os.read(fd, 4096))
    finally:
        os.close(fd)


def _taken(path: Path) -> int | None:
    """The locked file, with this process written in it; None if another process has it. OSError."""
    while True:
        fd = open_regular(path, os.O_RDWR | os.O_CREAT)
        try:
            if not try_lock(fd):
                os.close(fd)
                return None
            # The one who held it may have removed the file in between: a lock on that is worth nothing.
            if _is_same(fd, path):
                os.ftruncate(fd, 0)
                os.write(fd, json.dumps({"pid": os.getpid(), "host": host()}).encode())
                return fd
        except OSError:
            os.close(fd)
            raise
        os.close(fd)


def _is_same(fd: int, path: Path) -> bool:
    try:
        return os.path.samestat(os.fstat(fd), path.stat())
    except FileNotFoundError:
        return False


def _written(content: bytes) -> Holder:
    try:
        values = json.loads(content)
        return Holder(int(values["pid"]), str(values["host"]))
    except (ValueError, KeyError, TypeError):
        # Locked a moment ago and not written yet.
        return Holder(0, "this host")
