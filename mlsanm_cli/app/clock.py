"""CPU seconds of the phases of a run."""

from __future__ import annotations

import resource
import time
from collections.abc import Iterator
from contextlib import contextmanager

PHASES = (
    *("start", "jit", "cloud", "operators", "factorization", "condensation"),
    *("estimate", "continuation", "output"),
)


class Clock:
    """Adds up CPU time (user and system, all threads of the process) by phase; nested phases stay apart."""

    def __init__(self) -> None:
        self._seconds = dict.fromkeys(PHASES, 0.0)
        # What was spent before the first phase: the interpreter, imports, reading the case.
        self._seconds["start"] = time.process_time()
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
    def seconds(self) -> dict[str, float]:
        """All phases so far, and ``total`` of the whole process, interpreter and imports included."""
        return {"total": time.process_time(), **self._seconds}


def peak_memory_mb() -> float:
    """Largest memory the process has held so far."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0
