"""Progress of a factorisation: compiled code counts finished fronts, the console reads the count."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np

from mlsanm_cli.arrays import FloatArray, IntArray

MIN_PROGRESS = 0.02
"""No remaining time is shown before this fraction of the work is done."""


_now: list[tuple[IntArray, FloatArray, float]] = []
"""Of the running factorisation: number (1,) of finished fronts, cumulative relative work (f + 1,) of all, and
start time."""


@contextmanager
def watched(pivots: IntArray, height: IntArray) -> Iterator[IntArray]:
    """Context with an array (1,) to count finished fronts of ``pivots`` (f,) columns and ``height`` (f,)
    rows."""
    # Work of eliminating p columns of height h, up to a factor.
    work = np.concatenate([[0.0], np.cumsum(pivots * height.astype(float) ** 2)])
    done = np.zeros(1, dtype=np.int64)
    _now.append((done, work / (work[-1] or 1.0), time.monotonic()))
    try:
        yield done
    finally:
        _now.pop()


def progress_text() -> str:
    """Progress of the running factorisation, "" for none."""
    if not _now:
        return ""
    done, work, begun = _now[-1]
    count = int(done[0])
    part = float(work[count])
    text = f"fronts {count} of {len(work) - 1}, {100.0 * part:.0f} %"
    if not MIN_PROGRESS < part < 1.0:
        return text
    left = (time.monotonic() - begun) * (1.0 - part) / part
    return f"{text}, {left:.0f} s left"
