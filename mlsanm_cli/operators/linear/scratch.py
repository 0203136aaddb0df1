"""Large arrays mapped to files, of which only the last used one occupies memory. Bodies are factorised,
condensed and solved one after the other. The system writes mapped pages to disk and releases them when memory
is needed, so that scenes of many bodies may be larger than memory."""

from __future__ import annotations

import contextlib
import mmap
import os
import tempfile
import weakref

import numpy as np

from mlsanm_cli.arrays import FloatArray

MAPPED_SIZE = 2**26
"""Bytes from which an array is mapped to a file: it then costs less than 1 % of the work on it."""
DEFAULT_DIRECTORY = "/var/tmp"
"""Directory of the files unless TMPDIR is set: /tmp is often in memory itself."""


class MappedArray:
    """An uninitialised array of ``size`` doubles, mapped to an anonymous file if it is large. In memory where
    the system cannot release mapped pages or the disk is full."""

    def __init__(self, size: int) -> None:
        mapped = _mapped(8 * size) if 8 * size >= MAPPED_SIZE else None
        self._mapped = mapped
        self._values: FloatArray = np.empty(size) if mapped is None else np.frombuffer(mapped, dtype=float)

    @property
    def values(self) -> FloatArray:
        """The array; the pages of other mapped arrays may be released."""
        if self._mapped is not None:
            last = _last[0]() if _last else None
            if last is not self:
                if last is not None:
                    last._release()
                _last[:] = [weakref.ref(self)]
        return self._values

    def _release(self) -> None:
        assert self._mapped is not None
        # Written pages are kept in the file, on disk or not.
        self._mapped.madvise(mmap.MADV_DONTNEED)


_last: list[weakref.ref[MappedArray]] = []
"""The array used last, if any."""


def _mapped(size: int) -> mmap.mmap | None:
    """A mapped file of ``size`` bytes; None if not available."""
    if not hasattr(mmap, "MADV_DONTNEED") or not hasattr(os, "posix_fallocate"):
        return None
    place = DEFAULT_DIRECTORY if "TMPDIR" not in os.environ and os.path.isdir(DEFAULT_DIRECTORY) else None
    with contextlib.suppress(OSError), tempfile.TemporaryFile(dir=place) as file:
        # Allocated in full: writing to a full disk would end the process by a signal.
        os.posix_fallocate(file.fileno(), 0, size)
        return mmap.mmap(file.fileno(), size)
    return None
