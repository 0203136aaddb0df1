"""How far a factorisation is: compiled code counts its fronts, and whoever shows progress looks at that."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass

import numpy as np

from mlsanm_cli.arrays import FloatArray, IntArray

MIN_PROGRESS = 0.02
"""Part of the work before which no remaining time is shown."""


@dataclass(frozen=True, eq=False)
class _Watched:
    """Fronts ``done`` (1,), the ``work`` (f + 1,) behind that many of them in parts of all, and the start."""

    done: IntArray
    work: FloatArray
    begun: float


_now: list[_Watched] = []


@contextmanager
def watched(pivots: IntArray, height: IntArray) -> Iterator[IntArray]:
    """A block that counts finished fronts, of so many ``pivots`` (f,) and such ``height`` (f,), in the array
    (1,) it is given."""
    # What an elimination of p columns of height h takes, but for a factor.
    work = np.concatenate([[0.0], np.cumsum(pivots * height.astype(float) ** 2)])
    one = _Watched(np.zeros(1, dtype=np.int64), work / (work[-1] or 1.0), time.monotonic())
    _now.append(one)
    try:
        yield one.done
    finally:
        _now.remove(one)


def progress_text() -> str:
    """How far the factorisation at work is, "" where there is none."""
    if not _now:
        return ""
    one = _now[-1]
    count, part = int(one.done[0]), float(one.work[int(one.done[0])])
    text = f"fronts {count} of {len(one.work) - 1}, {100.0 * part:.0f} %"
    if not MIN_PROGRESS < part < 1.0:
        return text
    left = (time.monotonic() - one.begun) * (1.0 - part) / part
    return f"{text}, {left:.0f} s left"
