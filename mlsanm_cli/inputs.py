"""Reading of input files, with bounded size."""

from __future__ import annotations

import stat
import sys
from pathlib import Path

from mlsanm_cli.errors import RunError

MB = 2**20
MAX_TEXT_BYTES = 16 * MB
"""Largest case file or table."""
STDIN = Path("-")
"""The standard input."""


def results_of(case: Path) -> Path:
    """The default directory of the results of a case."""
    return Path("results") / ("stdin" if case == STDIN else case.stem)


def read_input(path: Path, most: int, *, what: str = "file", streams: bool = False) -> bytes:
    """The content of a regular file of at most ``most`` bytes; with ``streams`` also of a pipe or terminal,
    and the standard input. Other devices and pipes may be endless or block. Raises RunError."""
    if streams and path == STDIN:
        # Closed streams are None.
        return sys.stdin.buffer.read(most + 1)[:most] if sys.stdin else b""
    try:
        found = path.stat()
        if stat.S_ISDIR(found.st_mode):
            raise RunError(f"cannot read {path}: Is a directory")
        if not streams and not stat.S_ISREG(found.st_mode):
            raise RunError(f"cannot read {path}: it is a device or a pipe, not a file")
        if found.st_size > most:
            raise _too_large(path, f"{found.st_size / MB:.3g} MB", most)
        # Files with size 0, as in /proc, may have content, even without end.
        size = most + 1 if streams else found.st_size
        with path.open("rb") as file:
            content = file.read(size)
    except FileNotFoundError as error:
        raise RunError(f"there is no {what} {path}") from error
    except OSError as error:
        raise RunError(f"cannot read {path}: {error.strerror or error}") from error
    except ValueError as error:
        raise RunError(f"{str(path)!r} is not a file name") from error
    if len(content) > most:
        raise _too_large(path, f"more than {most / MB:.3g} MB", most)
    return content


def is_text(path: Path) -> bool:
    """Whether a path is UTF-8 text; others cannot be written in results."""
    try:
        str(path).encode()
    except UnicodeEncodeError:
        return False
    return True


def _too_large(path: Path, size: str, most: int) -> RunError:
    return RunError(f"cannot read {path}: it has {size}", f"at most {most / MB:.3g} MB")
