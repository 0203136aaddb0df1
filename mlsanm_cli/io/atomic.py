"""Atomic writing of files: readers see the old file or the complete new one."""

from __future__ import annotations

import errno
import re
from collections.abc import Iterator
from contextlib import contextmanager
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
