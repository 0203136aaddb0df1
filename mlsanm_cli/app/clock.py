"""CPU seconds of the phases of a run, and its wall time."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import ClassVar

PHASES = (
    *("start", "jit", "cloud", "operators", "factorization", "condensation"),
    *("estimate", "continuation", "output"),
)


class Clock:
    """Sums CPU time (user and system, all threads) by phase; the time of a nested phase counts only for it.

    The time before the first clock of a process, of the interpreter and imports, counts as ``start``.
    """

    _begun: ClassVar[bool] = False

    def __init__(self) -> None:
        now = time.process_time()
        self._begin = now if Clock._begun else 0.0
        # Before the first clock, mostly imports, the wall time is about the CPU time.
        self._wall_begin = time.monotonic() - (now - self._begin)
        Clock._begun = True
        self._seconds = dict.fromkeys(PHASES, 0.0)
        self._seconds["start"] = now - self._begin
        self._nested = [0.0]

    @contextmanager
    def phase(self, name: str) -> Iterator[None]:
        """Counts the time of the block under ``name``, without phases inside it."""
        start = time.process_time()
        self._nested.append(0.0)
        try:
            yield
        finally:
            spent = time.process_time() - start
            self._seconds[name] += spent - self._nested.pop()
            self._nested[-1] += spent

    @property
    def wall_seconds(self) -> float:
        """Wall-clock seconds since this clock, or the process, started."""
        return time.monotonic() - self._wall_begin

    @property
    def seconds(self) -> dict[str, float]:
        """The phases so far and their ``total``."""
        return {"total": time.process_time() - self._begin, **self._seconds}
