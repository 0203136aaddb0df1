"""The run directory: names of files, preparation without loss of others, lock for one process at a time."""

from __future__ import annotations

import os
import platform
import re
import shlex
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import h5py

from mlsanm_cli.errors import RunError
from mlsanm_cli.io.files import TEMPORARY_SUFFIX, cannot_write, check_seal
from mlsanm_cli.io.schema import INTERFACE_COLUMNS
from mlsanm_cli.io.self_contained import HDF5_SIGNATURE
from mlsanm_cli.system import open_regular, try_lock

RUN_FILE = "run.h5"
SUMMARY_FILE = "summary.json"
RESOLVED_FILE = "resolved.toml"
EVENTS_FILE = "events.jsonl"
PATH_FILE = "path.csv"
COLLECTION_FILE = "fields.pvd"
LINES_FILE = "contacts.pvd"
REPORT_FILE = "report.html"
FAILURE_FILE = "failure.vtu"
COMPARISON_FILE = "comparison.json"
LOCK_FILE = "run.lock"

_INTERFACE = re.compile(r"interface(_.+)?\.csv")
_FIXED = (RUN_FILE, SUMMARY_FILE, RESOLVED_FILE, EVENTS_FILE, PATH_FILE, COLLECTION_FILE, LINES_FILE)
_NUMBERED = r"(fields|contacts|obstacles)_\d{4,}\.vtu"
_RESERVED = re.compile(
    "|".join((*map(re.escape, (*_FIXED, FAILURE_FILE, LOCK_FILE)), _NUMBERED, _INTERFACE.pattern))
)
"""Names of the files that a run may write."""
_PICTURE = re.compile(r"plot_.+\.(png|svg|pdf|gif)")
# In the metadata of every picture, see figures.py.
SIGNATURE = b"mlsanm"
_COMPARISON = frozenset({COMPARISON_FILE, "plot_comparison.png"})


def resume_command(directory: Path) -> str:
    """What continues a run, as a shell takes it."""
    return f"mlsanm resume {shlex.quote(str(directory))}"


def vtu_name(kind: str, number: int) -> str:
    """Name of a VTU: number of a state and body for "fields", of a state for "contacts" and "obstacles"."""
    return f"{kind}_{number:04d}.vtu"


def interface_name(contact: str, contacts: int) -> str:
    """Name of a contact's CSV: interface.csv for the run's only contact, else interface_<contact>.csv."""
    return "interface.csv" if contacts == 1 else f"interface_{file_part(contact)}.csv"


def picture_name(kind: str, suffix: str, subject: str = "") -> str:
    """Name of a picture, plot_<kind>[_<subject>].<suffix>; ``suffix`` is png, svg, pdf or gif."""
    return f"plot_{kind}{'_' + file_part(subject) if subject else ''}.{suffix}"


def file_part(name: str) -> str:
    """``name`` as part of a file name: characters other than letters, digits and ``_-.`` are percent-encoded.

    >>> file_part("left/right 1")
    'left%2Fright%201'
    """
    return "".join(char if char.isalnum() or char in "_-." else f"%{ord(char):02X}" for char in name)


def check(directory: Path, force: bool) -> None:
    """Raises RunError if `prepare` would, or if a run is in progress in ``directory``; changes no file."""
    if process := holder(directory):
        raise _in_use(directory, process)
    _replaced(directory, force)


def prepare(directory: Path, force: bool) -> None:
    """Prepares ``directory``, which the caller has locked, for a new run: it is created, and with ``force``
    the files of an earlier run, and no others, are removed. Raises RunError if it holds a run or other files
    without ``force``, a file with a name that the run needs, or is not writable."""
    _remove(_replaced(directory, force), directory)


def reopen(directory: Path) -> None:
    """Removes files of completed runs from ``directory``, which the caller has locked. Raises RunError."""
    _remove([directory / name for name in (SUMMARY_FILE, FAILURE_FILE)], directory)


def check_comparison(directory: Path, force: bool) -> list[Path]:
    """The files of an earlier comparison to remove; those of a run may remain beside it. Raises RunError."""
    entries = _entries(directory)
    known = [path for path in entries if path.name in _COMPARISON]
    for path in known:
        mark = SIGNATURE if path.suffix == ".png" else b'"mlsanm"'
        if not (path.is_file() and mark in path.read_bytes()):
            hint = "no file was changed; use another --out, or move it"
            raise RunError(f"{path} was not written by mlsanm", hint)
    if not force and (known or (entries and not _is_run(directory / RUN_FILE))):
        raise _occupied(directory, "comparison", bool(known))
    return known


def prepare_comparison(directory: Path, force: bool) -> None:
    """Prepares ``directory`` for a comparison; with ``force`` an earlier one is removed. Raises RunError."""
    _remove(check_comparison(directory, force), directory)


def _remove(files: Iterable[Path], directory: Path) -> None:
    """Removes files of a directory, which is created if it does not exist. Raises RunError."""
    try:
        for path in files:
            path.unlink(missing_ok=True)
        directory.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise cannot_write(directory, error) from error


def _entries(directory: Path) -> list[Path]:
    """The entries of a directory that exists. Raises RunError for a file, or one that is not writable."""
    place = directory
    while not place.exists() and not place.is_symlink() and place != place.parent:
        place = place.parent
    if not place.is_dir():
        raise RunError(f"{place} is a file, not a directory", "use another --out")
    if not os.access(place, os.W_OK | os.X_OK):
        raise RunError(f"{place} cannot be written: no permission", "use another --out")
    try:
        return sorted(directory.iterdir()) if directory.exists() else []
    except OSError as error:
        raise RunError(f"{directory} cannot be read: {error.strerror}", "use another --out") from error


def _replaced(directory: Path, force: bool) -> list[Path]:
    """The files of an earlier run to remove. Raises RunError."""
    entries = [path for path in _entries(directory) if path.name not in {*_COMPARISON, LOCK_FILE}]
    holds_run = _is_run(directory / RUN_FILE)
    taken = [] if holds_run else [path.name for path in entries if _RESERVED.fullmatch(path.name)]
    if taken:
        hint = "no file was changed; use another --out, or move these files"
        raise RunError(f"{directory} holds {', '.join(taken)}, but no run of mlsanm", hint)
    if entries and not force:
        raise _occupied(directory, "run", holds_run)
    ours = [path for path in entries if holds_run and path.is_file() and _is_ours(path)]
    # run.h5 last: if the removal is interrupted, the directory still counts as a run.
    return sorted(ours, key=lambda path: path.name == RUN_FILE)


def _occupied(directory: Path, what: str, holds: bool) -> RunError:
    """The error of a directory that ``holds`` what is to be written, or other files."""
    if holds:
        return RunError(f"{directory} already holds a {what}", "use --force to replace it, or another --out")
    hint = f"use another --out, or --force to write the {what} next to the files in it"
    return RunError(f"{directory} is not empty and holds no run of mlsanm", hint)


def _is_run(file: Path) -> bool:
    """Whether ``file`` is a run.h5 of mlsanm; a damaged HDF5 file, as after a kill, counts as one."""
    if not file.is_file():
        return False
    try:
        check_seal(file)
        with h5py.File(file, "r", locking=False) as root:
            return "mlsanm_version" in root.attrs
    except PermissionError as error:
        raise RunError(f"{file} cannot be read: no permission", "use another --out") from error
    except (OSError, LookupError, ValueError, RuntimeError, TypeError, MemoryError):
        with file.open("rb") as stream:
            return stream.read(len(HDF5_SIGNATURE)) in (b"", HDF5_SIGNATURE)


def _is_ours(path: Path) -> bool:
    """Whether ``path``, a file in a directory that holds a run, was written by mlsanm."""
    name = path.name.removesuffix(TEMPORARY_SUFFIX)
    if _INTERFACE.fullmatch(name):
        # A table of the user may be called interface_notes.csv: the header decides.
        with path.open("rb") as stream:
            return stream.readline().strip() == ",".join(INTERFACE_COLUMNS).encode()
    if name == REPORT_FILE:
        # Imported only if there is a report.
        from mlsanm_cli.io.html import is_ours

        return is_ours(path)
    if _PICTURE.fullmatch(name):
        return SIGNATURE in path.read_bytes()
    return _RESERVED.fullmatch(name) is not None


UNLINKS_OPEN_FILES = os.name != "nt"
"""Windows cannot remove an open file; once it is closed, another process may have locked it."""


@contextmanager
def locked(directory: Path) -> Iterator[None]:
    """Keeps other processes from writing to ``directory``, which is created. Raises RunError if one does."""
    path = directory / LOCK_FILE
    try:
        directory.mkdir(parents=True, exist_ok=True)
        fd = _acquire(path)
    except OSError as error:
        raise cannot_write(path, error) from error
    if fd is None:
        raise _in_use(directory, holder(directory) or "another process")
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


def _in_use(directory: Path, process: str) -> RunError:
    hint = "wait until it has ended, or use another --out"
    return RunError(f"{directory} is being written by {process}", hint)


def holder(directory: Path) -> str:
    """The process that writes to ``directory`` in words, "" if there is none, even if it left its file."""
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
                    os.write(fd, f"process {os.getpid()} on {platform.node()}".encode())
                    return fd
        except OSError:
            os.close(fd)
            raise
        os.close(fd)
