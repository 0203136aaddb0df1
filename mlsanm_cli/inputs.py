"""Files that users name: what is read of them is bounded, and only what can be read to an end."""

from __future__ import annotations

import stat
from pathlib import Path

from mlsanm_cli.errors import RunError

MB = 2**20


def read_input(path: Path, most: int, *, what: str = "file", streams: bool = False) -> bytes:
    """The content of a file of ``most`` bytes at most; with ``streams`` also that of a pipe or terminal.

    Devices and pipes may never end, or wait for ever. Raises RunError.
    """
    try:
        found = path.stat()
        if stat.S_ISDIR(found.st_mode):
            raise RunError(f"cannot read {path}: Is a directory")
        if not streams and not stat.S_ISREG(found.st_mode):
            raise RunError(f"cannot read {path}: it is a device or a pipe, not a file")
        if found.st_size > most:
            raise _too_large(path, f"{found.st_size / MB:.3g} MB", most)
        # Files of the system that have no size, as in /proc, may have no end either.
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
    """Whether a path is UTF-8 text: others cannot be named in a result."""
    try:
        str(path).encode()
    except UnicodeEncodeError:
        return False
    return True


def _too_large(path: Path, size: str, most: int) -> RunError:
    return RunError(f"cannot read {path}: it has {size}", f"{most / MB:.3g} MB at most")
