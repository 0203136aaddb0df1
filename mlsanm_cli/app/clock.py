"""CPU seconds of the phases of a run, and the wall time of all of it."""

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
    """Adds up CPU time (user and system, all threads of the process) by phase; nested phases stay apart.

    What was spent before the first clock of a process, on the interpreter and imports, counts as ``start``.
    """

    _begun: ClassVar[bool] = False

    def __init__(self) -> None:
        now = time.process_time()
        self._begin = now if Clock._begun else 0.0
        # Imports hardly wait: before the first clock the wall time is about the CPU time.
        self._wall_begin = time.monotonic() - (now - self._begin)
        Clock._begun = True
        self._seconds = dict.fromkeys(PHASES, 0.0)
        self._seconds["start"] = now - self._begin
        self._nested = [0.0]

    @contextmanager
    def phase(self, name: str) -> Iterator[None]:
        """Count the time of the block under ``name``, less the phases inside it."""
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
        """Seconds on the wall since this clock, or the process, began."""
        return time.monotonic() - self._wall_begin

    @property
    def seconds(self) -> dict[str, float]:
        """All phases so far, and ``total``: all that this clock counts."""
        return {"total": time.process_time() - self._begin, **self._seconds}
