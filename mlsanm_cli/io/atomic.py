"""Files that are either the old one or the whole new one, never half of it."""

from __future__ import annotations

import re
from contextlib import contextmanager
from typing import TYPE_CHECKING

from mlsanm_cli import system
from mlsanm_cli.errors import WriteError

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

TEMPORARY_SUFFIX = ".tmp"


@contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """Give a temporary path next to ``path`` to write to, and rename it to ``path`` when the block ends well.

    The temporary file lies in the same directory because a rename is atomic only inside one file system.

    Raises WriteError if the file cannot be written; then ``path`` is as it was.
    """
    temporary = path.with_name(path.name + TEMPORARY_SUFFIX)
    try:
        with system.replacing(path, temporary):
            yield temporary
    except OSError as error:
        raise cannot_write(path, error) from error


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
