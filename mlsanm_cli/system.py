"""What operating systems do differently: Linux, macOS and Windows behind the same functions.

Whatever a system may lack is looked for where it is used, so that importing this module works everywhere, and
tests can take the functions away.
"""

from __future__ import annotations

import errno
import os
import platform
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
"""Signals that end a run in order, as far as there are any."""

LOCKED_BYTE = 2**30
"""Windows keeps others from reading a locked byte: this one lies behind all that is written."""

RENAMES, PAUSE = 50, 0.1
"""So often, and after so many seconds each time, a file is renamed again that others are reading."""

MB = 2.0**20


def host() -> str:
    """The machine's name."""
    return platform.node()


def open_regular(path: Path, flags: int) -> int:
    """Open a regular file, as ``os.open`` does; OSError where it is a link, a pipe or a device.

    Files in a run directory are ours: a link in one of their places would have us write to another file.
    """
    if not hasattr(os, "O_NOFOLLOW") and path.is_symlink():
        raise OSError(errno.ELOOP, "it is a symbolic link", str(path))
    # O_NONBLOCK: a pipe would be waited for. Windows would translate the ends of lines without O_BINARY.
    for name in ("O_NOFOLLOW", "O_NONBLOCK", "O_CLOEXEC", "O_BINARY"):
        flags |= getattr(os, name, 0)
    try:
        fd = os.open(path, flags, 0o666)
    except OSError as error:
        if error.errno == errno.ELOOP:
            raise OSError(errno.ELOOP, "it is a symbolic link", str(path)) from error
        raise
    if not stat.S_ISREG(os.fstat(fd).st_mode):
        os.close(fd)
        raise OSError(errno.EINVAL, "it is a device or a pipe, not a file", str(path))
    return fd


@contextmanager
def replacing(path: Path, temporary: Path) -> Iterator[None]:
    """Rename ``temporary``, of the same directory, to ``path`` when the block that writes it ends well.

    Others see all of the old file or all of the new one. Raises OSError; ``path`` is then as it was.
    """
    try:
        # What lies there is left by a process that was killed, or leads somewhere else.
        temporary.unlink(missing_ok=True)
        yield
        _rename(temporary, path)
    except BaseException:
        # Failing to remove it must not hide the error that brought us here.
        with suppress(OSError):
            temporary.unlink(missing_ok=True)
        raise


def _rename(temporary: Path, path: Path) -> None:
    """Rename a file to one that somebody may be reading, which Windows refuses for as long as that takes."""
    for _ in range(RENAMES if os.name == "nt" else 0):
        with suppress(PermissionError):
            os.replace(temporary, path)
            return
        time.sleep(PAUSE)
    os.replace(temporary, path)


def who_else_may_write(path: Path) -> str:
    """Why a file is not only this user's, and the system's; "" where it is.

    As ssh judges its keys: the file and every directory above it, those that links lead to too, must belong
    to this user or to root, and nobody else may write to them. A group of this user alone does not count. A
    directory like /tmp, where everybody may write but only owners may rename, does for one further above.
    Windows has other permissions, and nothing is judged there.
    """
    if not hasattr(os, "getuid"):
        return ""
    ours = (0, os.getuid())
    absolute, real = path.absolute(), path.resolve()
    nearest = (absolute, real, absolute.parent, real.parent)
    for place in dict.fromkeys((absolute, real, *absolute.parents, *real.parents)):
        found = place.stat()
        outside = place not in nearest and found.st_uid == _outsider()
        if found.st_uid not in ours and not outside:
            return f"{place} belongs to another user"
        shared = found.st_mode & stat.S_ISVTX and place not in nearest
        others = stat.S_IWOTH if _is_own_group(found.st_gid) else stat.S_IWGRP | stat.S_IWOTH
        if found.st_mode & others and not shared:
            return f"others may write to {place}"
    return ""


def _outsider() -> int | None:
    """The user as whom all owners outside of a container appear, who may own the directories that it is made
    of; None where every user is known, as outside of containers."""
    nobody = 65534
    try:
        ranges = [
            list(map(int, line.split())) for line in Path("/proc/self/uid_map").read_text().splitlines()
        ]
    except (OSError, ValueError):
        return None
    mapped = any(first <= nobody < first + count for first, _, count in ranges)
    return None if mapped or not ranges else nobody


def _is_own_group(gid: int) -> bool:
    """Whether a group has no member but this user, as many systems make one for everybody."""
    import grp
    import pwd

    try:
        user, group = pwd.getpwuid(os.getuid()), grp.getgrgid(gid)
    except KeyError:
        return False
    return gid == user.pw_gid and group.gr_name == user.pw_name and set(group.gr_mem) <= {user.pw_name}


def try_lock(fd: int, *, shared: bool = False) -> bool:
    """Lock an open file until it is closed; False where another process has it."""
    try:
        import fcntl
    except ImportError:
        return _lock_on_windows(fd)
    try:
        fcntl.flock(fd, (fcntl.LOCK_SH if shared else fcntl.LOCK_EX) | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    return True


def _lock_on_windows(fd: int) -> bool:
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


def peak_memory_mb() -> float:
    """Largest memory the process has held so far; nan where the system does not report it."""
    try:
        import resource
    except ImportError:
        return _windows_peak() / MB
    size = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    # In bytes on macOS, in KB elsewhere.
    return size / (MB if sys.platform == "darwin" else 1024.0)


def physical_memory_mb() -> float:
    """Memory of the machine; inf where the system does not report it."""
    if hasattr(os, "sysconf"):
        return os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") / MB
    return _windows_memory() / MB


def _windows_peak() -> float:
    """Largest working set in bytes."""
    import ctypes

    class Counters(ctypes.Structure):
        _fields_ = (
            ("size", ctypes.c_uint32),
            ("faults", ctypes.c_uint32),
            ("peak", ctypes.c_size_t),
            ("rest", 7 * ctypes.c_size_t),
        )

    found = Counters(size=ctypes.sizeof(Counters))
    windows: Any = getattr(ctypes, "windll", None)
    if windows is None:
        return float("nan")
    current = windows.kernel32.GetCurrentProcess
    current.restype = ctypes.c_void_p
    query = windows.kernel32.K32GetProcessMemoryInfo
    query.argtypes = (ctypes.c_void_p, ctypes.c_void_p, ctypes.c_uint32)
    return float(found.peak) if query(current(), ctypes.byref(found), found.size) else float("nan")


def _windows_memory() -> float:
    """Physical memory in bytes."""
    import ctypes

    class Status(ctypes.Structure):
        _fields_ = (
            ("length", ctypes.c_uint32),
            ("load", ctypes.c_uint32),
            ("physical", ctypes.c_uint64),
            ("rest", 6 * ctypes.c_uint64),
        )

    found = Status(length=ctypes.sizeof(Status))
    windows: Any = getattr(ctypes, "windll", None)
    if windows is None or not windows.kernel32.GlobalMemoryStatusEx(ctypes.byref(found)):
        return float("inf")
    return float(found.physical)
