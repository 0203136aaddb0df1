"""The context shared by the phases of a command: clock, console, memo and stopper."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import field
from typing import Any, ClassVar, Protocol

from mlsanm_cli.memo import NO_CACHE, Memo
from mlsanm_cli.records import dataclass
from mlsanm_cli.stopping import Stopper


class Console(Protocol):
    """Messages of a run, all on stderr: the start of a phase, a finished step of the path, a note, a warning
    about the accuracy or validity of the result, and why a run failed, and what to do."""

    def phase(self, text: str) -> None: ...
    def step(self, index: int, position: float, residual: float, text: str) -> None: ...
    def note(self, text: str) -> None: ...
    def warning(self, text: str) -> None: ...
    def error(self, message: str, hint: str) -> None: ...


class Silent:
    """Console without output: warnings are counted and stored in summaries."""

    def phase(self, *given: Any, **named: Any) -> None:
        """No output."""

    step = note = warning = error = phase


PHASES = (
    *("start", "jit", "cloud", "operators", "factorization", "condensation"),
    *("estimate", "continuation", "output"),
)


class Clock:
    """Sums CPU time (user and system, all threads) by phase; the time of a nested phase counts only for it.
    The time before the first clock of a process, of the interpreter and imports, counts as ``start``."""

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
        return time.monotonic() - self._wall_begin

    @property
    def seconds(self) -> dict[str, float]:
        return {"total": time.process_time() - self._begin, **self._seconds}


@dataclass(frozen=True)
class RunContext:
    """``memo`` keeps results for other runs of the process; ``stopper`` handles signals and the wall time."""

    clock: Clock
    console: Console
    memo: Memo = NO_CACHE
    stopper: Stopper = field(default_factory=Stopper)

    @contextmanager
    def phase(self, name: str, announced: str = "") -> Iterator[None]:
        """Counts the CPU time of the block under ``name``, and announces it on the console."""
        with self.clock.phase(name):
            if announced:
                self.console.phase(announced)
            yield
