"""Functions that differ between operating systems: Linux, macOS and Windows. What a system may lack is looked
up where it is used."""

from __future__ import annotations

import errno
import os
import signal
import stat
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

STOPPING = tuple(
    signal.Signals[name]
    for name in ("SIGINT", "SIGTERM", "SIGUSR1", "SIGALRM", "SIGBREAK")
    if hasattr(signal, name)
)
"""Signals that stop a run in an orderly way, as far as the system has them."""

THREAD_VARIABLES = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS")
"""Environment variables of the number of threads, which numerical libraries read when they are imported."""

LOCKED_BYTE = 2**30
"""Windows does not let others read a locked byte: this one lies beyond the content of lock files."""

MAX_RENAMES, RENAME_INTERVAL = 50, 0.1
"""Attempts to rename a file that others are reading, and seconds between them."""


def open_regular(path: Path, flags: int) -> int:
    """Opens a regular file as ``os.open`` does. Raises OSError for a link, which would redirect the output, a
    pipe or a device, and, to write, for a hard link."""
    if not hasattr(os, "O_NOFOLLOW") and path.is_symlink():
        raise OSError(errno.ELOOP, "it is a symbolic link", str(path))
    # O_NONBLOCK: opening a pipe would block. Without O_BINARY Windows translates line ends.
    for name in ("O_NOFOLLOW", "O_NONBLOCK", "O_CLOEXEC", "O_BINARY"):
        flags |= getattr(os, name, 0)
    try:
        fd = os.open(path, flags, 0o666)
    except OSError as error:
        if error.errno == errno.ELOOP:
            raise OSError(errno.ELOOP, "it is a symbolic link", str(path)) from error
        raise
    status = os.fstat(fd)
    if not stat.S_ISREG(status.st_mode):
        os.close(fd)
        raise OSError(errno.EINVAL, "it is a device or a pipe, not a file", str(path))
    if status.st_nlink > 1 and flags & (os.O_WRONLY | os.O_RDWR):
        os.close(fd)
        raise OSError(errno.EMLINK, "it is a hard link, another file has the same content", str(path))
    return fd


@contextmanager
def replacing(path: Path, temporary: Path) -> Iterator[None]:
    """Renames ``temporary`` to ``path``, of the same directory, if the block ends without an error."""
    try:
        # An existing file is left from a killed process, or may be a link.
        temporary.unlink(missing_ok=True)
        yield
        # Windows refuses to replace a file that is being read.
        for _ in range(MAX_RENAMES if os.name == "nt" else 0):
            with suppress(PermissionError):
                os.replace(temporary, path)
                return
            time.sleep(RENAME_INTERVAL)
        os.replace(temporary, path)
    except BaseException:
        # A failure to remove it must not hide the original error.
        with suppress(OSError):
            temporary.unlink(missing_ok=True)
        raise


def who_else_may_write(path: Path) -> str:
    """Why others than this user and root may change a file; "" if they may not, and on Windows.

    As ssh checks its keys: the file and all directories above it, also those behind links, must belong to
    this user or root and be writable by nobody else, except further above directories with the sticky bit.
    """
    if not hasattr(os, "getuid"):
        return ""
    import grp
    import pwd

    ours, own_groups = (0, os.getuid()), set()
    with suppress(KeyError):
        # A group with this user as its only member, as many systems create for every user.
        user = pwd.getpwuid(os.getuid())
        group = grp.getgrgid(user.pw_gid)
        if group.gr_name == user.pw_name and set(group.gr_mem) <= {user.pw_name}:
            own_groups = {user.pw_gid}
    absolute, real = path.absolute(), path.resolve()
    nearest = (absolute, real, absolute.parent, real.parent)
    for place in dict.fromkeys((absolute, real, *absolute.parents, *real.parents)):
        found = place.stat()
        outside = place not in nearest and found.st_uid == _overflow_user()
        if found.st_uid not in ours and not outside:
            return f"{place} belongs to another user"
        shared = found.st_mode & stat.S_ISVTX and place not in nearest
        others = stat.S_IWOTH if found.st_gid in own_groups else stat.S_IWGRP | stat.S_IWOTH
        if found.st_mode & others and not shared:
            return f"others may write to {place}"
    return ""


def _overflow_user() -> int | None:
    """The user id of users unknown in a container, who may own its directories; None outside of one."""
    nobody = 65534
    try:
        lines = Path("/proc/self/uid_map").read_text().splitlines()
        ranges = [list(map(int, line.split())) for line in lines]
    except (OSError, ValueError):
        return None
    mapped = any(first <= nobody < first + count for first, _, count in ranges)
    return None if mapped or not ranges else nobody


def try_lock(fd: int, *, shared: bool = False) -> bool:
    """Locks an open file until it is closed; returns False if another process holds it."""
    try:
        import fcntl
    except ImportError:
        import msvcrt

        windows: Any = msvcrt
        try:
            os.lseek(fd, LOCKED_BYTE, os.SEEK_SET)
            windows.locking(fd, windows.LK_NBLCK, 1)
        except OSError:
            return False
        finally:
            os.lseek(fd, 0, os.SEEK_SET)
        return True
    try:
        fcntl.flock(fd, (fcntl.LOCK_SH if shared else fcntl.LOCK_EX) | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    return True


def peak_memory_mb() -> float:
    """Peak memory of the process so far; nan if the system does not report it."""
    try:
        import resource
    except ImportError:
        return float("nan")
    size = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    # In bytes on macOS, in KB elsewhere.
    return size / (2.0**20 if sys.platform == "darwin" else 1024.0)


def physical_memory_mb() -> float:
    """Memory of the machine; inf if the system does not report it."""
    if hasattr(os, "sysconf"):
        return os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") / 2.0**20
    return float("inf")
