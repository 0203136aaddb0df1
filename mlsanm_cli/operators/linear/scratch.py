"""Large arrays that lie in files, of which only the one used last takes part of the process's memory.

Bodies are factorised, condensed and solved one after the other. What the system keeps of files in memory it
writes to disk and gives away when others need the room, so that scenes of many bodies may be larger than
memory.
"""

from __future__ import annotations

import contextlib
import mmap
import os
import tempfile
import weakref

import numpy as np

from mlsanm_cli.arrays import FloatArray

FILE_BYTES = 2**26
"""Size from which an array is in a file, at less than 1 % of the cost of its use."""
DEFAULT_DIRECTORY = "/var/tmp"
"""Directory of the files unless TMPDIR is set: /tmp is often in memory."""


class MappedArray:
    """An array of ``size`` numbers, at first anything, in a file without a name if it is large.

    It is in memory where the system cannot give files' memory away or the disk has no room for it.
    """

    def __init__(self, size: int) -> None:
        mapped = _mapped(8 * size) if 8 * size >= FILE_BYTES else None
        self._mapped = mapped
        self._values: FloatArray = np.empty(size) if mapped is None else np.frombuffer(mapped, dtype=float)

    @property
    def values(self) -> FloatArray:
        """The array. What others have of theirs in memory is left to the system."""
        if self._mapped is not None:
            last = _last[0]() if _last else None
            if last is not self:
                if last is not None:
                    last._release()
                _last[:] = [weakref.ref(self)]
        return self._values

    def _release(self) -> None:
        assert self._mapped is not None
        # The file has all that was written, on disk or not; reading finds it again.
        self._mapped.madvise(mmap.MADV_DONTNEED)


_last: list[weakref.ref[MappedArray]] = []
"""The one used last, if any."""


def _mapped(size: int) -> mmap.mmap | None:
    """A file of ``size`` bytes in memory, None where there can be none."""
    if not hasattr(mmap, "MADV_DONTNEED") or not hasattr(os, "posix_fallocate"):
        return None
    place = DEFAULT_DIRECTORY if "TMPDIR" not in os.environ and os.path.isdir(DEFAULT_DIRECTORY) else None
    with contextlib.suppress(OSError), tempfile.TemporaryFile(dir=place) as file:
        # With all its room, since a full disk would be noticed by a signal that ends the process.
        os.posix_fallocate(file.fileno(), 0, size)
        return mmap.mmap(file.fileno(), size)
    return None
