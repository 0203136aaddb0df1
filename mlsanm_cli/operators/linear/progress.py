"""Progress of a factorisation: compiled code counts finished fronts, the console reads the count."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass

import numpy as np

from mlsanm_cli.arrays import FloatArray, IntArray

MIN_PROGRESS = 0.02
"""No remaining time is shown before this fraction of the work is done."""


@dataclass(frozen=True, eq=False)
class _Watched:
    """Number of fronts ``done`` (1,), cumulative relative ``work`` (f + 1,), and the start time."""

    done: IntArray
    work: FloatArray
    begun: float


_now: list[_Watched] = []


@contextmanager
def watched(pivots: IntArray, height: IntArray) -> Iterator[IntArray]:
    """Context with an array (1,) to count finished fronts of ``pivots`` (f,) columns and ``height`` (f,)
    rows."""
    # Work of eliminating p columns of height h, up to a factor.
    work = np.concatenate([[0.0], np.cumsum(pivots * height.astype(float) ** 2)])
    one = _Watched(np.zeros(1, dtype=np.int64), work / (work[-1] or 1.0), time.monotonic())
    _now.append(one)
    try:
        yield one.done
    finally:
        _now.remove(one)


def progress_text() -> str:
    """Progress of the running factorisation, "" for none."""
    if not _now:
        return ""
    one = _now[-1]
    count, part = int(one.done[0]), float(one.work[int(one.done[0])])
    text = f"fronts {count} of {len(one.work) - 1}, {100.0 * part:.0f} %"
    if not MIN_PROGRESS < part < 1.0:
        return text
    left = (time.monotonic() - one.begun) * (1.0 - part) / part
    return f"{text}, {left:.0f} s left"
