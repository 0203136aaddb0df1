"""An HDF5 file that changes all at once or not at all, whenever the process is killed or the disk is full.

HDF5 updates a file in many small writes, and one that is killed between two of them, or finds the disk full,
leaves a file that nobody can read. Here these writes are collected in memory. A commit writes them to a
journal beside the file, with a checksum, then to the file, then empties the journal. So the file itself is
whole, or the journal is, which holds all that the file lacks: `recover` puts it there, `opened` reads
around it. This is the redo journal of databases, without a sync to the disk at every commit: the kernel keeps
what a killed process wrote, but a power cut may lose it.
"""

from __future__ import annotations

import io
import os
import signal
import struct
import threading
import zlib
from contextlib import contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import h5py

from mlsanm_cli.system import STOPPING, open_regular, read_at, reserve, write_at

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence
    from pathlib import Path
    from types import FrameType

Write = tuple[int, bytes]


@dataclass(frozen=True)
class Commit:
    """Writes to a file of ``before`` bytes, which has ``size`` afterwards."""

    writes: tuple[Write, ...]
    before: int
    size: int


JOURNAL_SUFFIX = ".journal"
_MAGIC = b"mlsanmj2"
_HEAD = struct.Struct("<8sIQQQ")  # magic, CRC of what follows the head, its length, sizes before and after
_WRITE = struct.Struct("<QQ")  # offset, length


def journal_of(path: Path) -> Path:
    """The journal beside a file."""
    return path.with_name(path.name + JOURNAL_SUFFIX)


class JournaledFile:
    """The file that HDF5 reads and writes through h5py's driver "fileobj".

    Its callbacks must not fail, for HDF5 does not survive that; only `commit` touches the disk.
    """

    def __init__(self, path: Path, *, new: bool) -> None:
        """Open ``path`` for reading and writing; OSError if that is not possible, or a new one exists."""
        self._path = path
        self._fd = open_regular(path, os.O_RDWR | (os.O_CREAT | os.O_EXCL if new else 0))
        self._size = os.fstat(self._fd).st_size
        self._at = 0
        self._pending: list[Write] = []
        self._broken = False

    def seek(self, offset: int, whence: int = os.SEEK_SET) -> int:
        """Move to an offset from the start, from here or from the end."""
        self._at = offset + {os.SEEK_SET: 0, os.SEEK_CUR: self._at, os.SEEK_END: self._size}[whence]
        return self._at

    def tell(self) -> int:
        """The offset from the start."""
        return self._at

    def read(self, count: int) -> bytes:
        """The next bytes, pending writes included; zeros where nothing was written."""
        content = bytearray(count)
        self.readinto(content)
        return bytes(content)

    def readinto(self, buffer: Any) -> int:
        """As `read`, into a buffer; returns its length."""
        view = memoryview(buffer).cast("B")
        try:
            found = read_at(self._fd, len(view), self._at)
        except (OSError, OverflowError):
            # A damaged file leads anywhere. HDF5 finds zeros there, and no signature.
            found = b""
        view[:] = found + bytes(len(view) - len(found))
        for offset, content in self._pending:
            low, high = max(offset, self._at), min(offset + len(content), self._at + len(view))
            if low < high:
                view[low - self._at : high - self._at] = content[low - offset : high - offset]
        self._at += len(view)
        return len(view)

    def write(self, content: Any) -> int:
        """Remember a write at the present offset."""
        kept = bytes(content)
        self._pending.append((self._at, kept))
        self._at += len(kept)
        self._size = max(self._size, self._at)
        return len(kept)

    def truncate(self, size: int | None = None) -> int:
        """Remember the size of the file."""
        self._size = self._at if size is None else size
        return self._size

    def flush(self) -> None:
        """HDF5 has given all it has; `commit` writes it."""

    def commit(self) -> None:
        """Write everything given so far. OSError if the disk refuses it: then the file is as it was before,
        or, should writing it have begun, its journal complete."""
        if self._broken or not (self._pending or self._size != os.fstat(self._fd).st_size):
            return
        before = os.fstat(self._fd).st_size
        # Set until all is done: after a failure HDF5's idea of the file and the file itself differ for good.
        self._broken = True
        journal = open_regular(journal_of(self._path), os.O_WRONLY | os.O_CREAT)
        try:
            try:
                if self._size > before:
                    # Now, so that a full disk is found before the file is touched.
                    reserve(self._fd, before, self._size - before)
                write_at(journal, _packed(self._pending, before, self._size), 0)
            except OSError:
                os.ftruncate(journal, 0)
                os.ftruncate(self._fd, before)
                raise
            _apply(self._fd, self._pending, self._size)
            os.ftruncate(journal, 0)
        finally:
            os.close(journal)
        self._pending.clear()
        self._broken = False

    def close(self) -> None:
        """Commit and close; after a commit that failed what came later is dropped. Twice is allowed."""
        if self._fd < 0:
            return
        try:
            self.commit()
            if not self._broken:
                os.fsync(self._fd)
                journal_of(self._path).unlink(missing_ok=True)
        finally:
            os.close(self._fd)
            self._fd = -1


def recover(path: Path) -> None:
    """Finish the commit in which a process was killed, if there is one. OSError if that cannot be written."""
    found = _journal(path)
    if found is not None:
        fd = open_regular(path, os.O_RDWR)
        try:
            _check_size(os.fstat(fd).st_size, found)
            _apply(fd, found.writes, found.size)
        finally:
            os.close(fd)
    journal_of(path).unlink(missing_ok=True)


@contextmanager
def opened(path: Path) -> Iterator[Any]:
    """The HDF5 file for reading, as the last complete commit left it; OSError if it cannot be read."""
    found = _journal(path)
    # Without locking a file can be read while it is being written.
    if found is None:
        with h5py.File(path, "r", locking=False) as file:
            yield file
        return
    image = io.BytesIO(path.read_bytes())
    if _journal(path) != found:
        raise OSError("it is being written")
    _check_size(len(image.getbuffer()), found)
    for offset, content in found.writes:
        image.seek(offset)
        image.write(content)
    image.truncate(found.size)
    # HDF5 reads the image itself: errors in a damaged one do not pass through callbacks to Python.
    try:
        whole = h5py.File(h5py.h5f.open_file_image(image.getvalue()))
    except ValueError as error:
        # No error comes from opening, but no file either.
        raise OSError("even its journal makes no HDF5 file of it") from error
    with whole as file:
        yield file


def check_whole(path: Path) -> None:
    """Look at everything that a file holds, before it is written to; OSError where it is damaged."""
    with opened(path) as file:
        file.visititems(lambda name, found: None)


@contextmanager
def shielded() -> Iterator[None]:
    """Hold signals back until the block is done: no exception of theirs may come out of HDF5's callbacks."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    caught: list[int] = []

    def hold(number: int, frame: FrameType | None) -> None:
        caught.append(number)

    before = {number: signal.signal(number, hold) for number in STOPPING}
    try:
        yield
    finally:
        for number, handler in before.items():
            # None: a handler that was not set from Python, which nobody can put back.
            signal.signal(number, signal.SIG_DFL if handler is None else handler)
        for one in caught:
            signal.raise_signal(one)


def _check_size(present: int, commit: Commit) -> None:
    """OSError if a file is not the one that a journal belongs to. Its room may have been reserved already."""
    if not commit.before <= present <= max(commit.before, commit.size):
        raise OSError(f"it has {present} bytes, but its journal belongs to one of {commit.before}")


def _packed(writes: Sequence[Write], before: int, size: int) -> bytes:
    body = b"".join(part for offset, data in writes for part in (_WRITE.pack(offset, len(data)), data))
    return _HEAD.pack(_MAGIC, zlib.crc32(body), len(body), before, size) + body


def _journal(path: Path) -> Commit | None:
    """The commit in the journal of a file; None if there is none or it was cut short."""
    try:
        content = journal_of(path).read_bytes()
    except FileNotFoundError:
        return None
    if len(content) < _HEAD.size:
        return None
    magic, checksum, length, before, size = _HEAD.unpack_from(content)
    body = content[_HEAD.size : _HEAD.size + length]
    if magic != _MAGIC or len(body) != length or zlib.crc32(body) != checksum:
        return None
    writes, at = [], 0
    while at < length:
        offset, count = _WRITE.unpack_from(body, at)
        at += _WRITE.size
        writes.append((offset, body[at : at + count]))
        at += count
    return Commit(tuple(writes), before, size)


def _apply(fd: int, writes: Sequence[Write], size: int) -> None:
    for offset, content in writes:
        write_at(fd, content, offset)
    os.ftruncate(fd, size)
