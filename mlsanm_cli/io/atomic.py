"""Files that are either the old one or the whole new one, never half of it."""

from __future__ import annotations

import os
import re
import time
from contextlib import contextmanager, suppress
from typing import TYPE_CHECKING

from mlsanm_cli.errors import WriteError

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

TEMPORARY_SUFFIX = ".tmp"
RENAMES, PAUSE = 50, 0.1
"""So often, and after so many seconds each time, a file is renamed again that others are reading."""


@contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """Give a temporary path beside ``path`` to write to, and rename it to ``path`` when the block ends well.

    The temporary file lies in the same directory because a rename is atomic only inside one file system.

    Raises WriteError if the file cannot be written; then ``path`` is as it was.
    """
    temporary = path.with_name(path.name + TEMPORARY_SUFFIX)
    try:
        # What lies there is left by a process that was killed, or leads somewhere else.
        temporary.unlink(missing_ok=True)
        yield temporary
        _rename(temporary, path)
    except OSError as error:
        _discard(temporary)
        raise cannot_write(path, error) from error
    except BaseException:
        _discard(temporary)
        raise


def write_text(path: Path, text: str) -> None:
    """Write ``text`` as UTF-8 with Unix line ends, atomically; WriteError if that fails."""
    with replacing(path) as temporary:
        temporary.write_text(text, encoding="utf-8", newline="\n")


def cannot_write(path: Path, error: Exception) -> WriteError:
    """The WriteError for a file that cannot be written, with the reason the system gave."""
    inner = re.search(r"error message = '([^']*)'", str(error))
    if isinstance(error, OSError) and error.strerror:
        reason = error.strerror
    elif inner:
        # HDF5 wraps the system's reason in several lines about its own buffers.
        reason = inner[1]
    else:
        reason = (str(error).splitlines() or [type(error).__name__])[0]
    hint = "check the free disk space and the permissions of the directory"
    return WriteError(f"cannot write {path}: {reason}", hint=hint)


def _rename(temporary: Path, path: Path) -> None:
    """Rename a file to one that somebody may be reading, which Windows refuses for as long as that takes."""
    for _ in range(RENAMES if os.name == "nt" else 0):
        with suppress(PermissionError):
            os.replace(temporary, path)
            return
        time.sleep(PAUSE)
    os.replace(temporary, path)


def _discard(temporary: Path) -> None:
    """Remove a temporary file; failing to do so must not hide the error that brought us here."""
    try:
        temporary.unlink(missing_ok=True)
    except OSError:
        return
