"""The context shared by the phases of a command: clock, console, memo, and the stopper, which ends a run
after a signal or a limit on its wall time."""

from __future__ import annotations

import _thread
import signal
import sys
import threading
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from types import FrameType, TracebackType
from typing import Any, ClassVar, Protocol, Self

from mlsanm_cli.memo import NO_CACHE, Memo
from mlsanm_cli.records import dataclass
from mlsanm_cli.system import STOPPING

STOPPING_MESSAGE = "stopping after this step; Ctrl-C again stops at once"


class Stopper:
    """Raises KeyboardInterrupt at a signal or after ``max_wall`` seconds; use as a context manager.

    While ``gentle``, the first signal only sets ``reason``, and :meth:`check`, called between steps, raises
    the exception; a second signal raises it at once. Otherwise the first one raises it at once and sets
    ``reason``, as an exception in a callback of a compiled library can be lost. Outside the main thread only
    :meth:`check` applies, to the wall time. SIGTERM ends a process of a pool at once, as the pool waits for
    it.
    """

    message: ClassVar[str] = ""
    """Shown on a terminal after a signal that stops the run after its step."""

    def __init__(self, max_wall: float | None = None) -> None:
        self.gentle = False
        self.reason = ""
        self._max_wall = max_wall
        self._end = time.monotonic() + max_wall if max_wall is not None else None
        self._before: dict[signal.Signals, Any] = {}
        self._alarm = getattr(signal, "SIGALRM", signal.SIGINT)
        self._timer: threading.Timer | None = None

    def check(self) -> None:
        """Raises KeyboardInterrupt after a signal or when the wall time is over."""
        if self._end is not None and time.monotonic() >= self._end:
            self.reason = self.reason or self._reason_of(None)
        if self.reason:
            raise KeyboardInterrupt(self.reason)

    def _reason_of(self, number: int | None) -> str:
        # Without SIGALRM, SIGINT has this meaning once the time is over.
        timed = number == self._alarm and (self._timer is None or time.monotonic() >= (self._end or 0.0))
        if self._max_wall is not None and (number is None or timed):
            return f"the wall time of {self._max_wall:g} s is over"
        assert number is not None
        return f"stopped by a signal ({signal.Signals(number).name})"

    def _handle(self, number: int, frame: FrameType | None) -> None:
        again, self.reason = bool(self.reason), self.reason or self._reason_of(number)
        if again or not self.gentle:
            raise KeyboardInterrupt(self.reason)
        # Not written here: a handler may interrupt the writing of another line.
        Stopper.message = STOPPING_MESSAGE

    def __enter__(self) -> Self:
        if threading.current_thread() is threading.main_thread():
            chosen = [number for number in STOPPING if number != signal.SIGTERM or not _in_a_pool()]
            self._before = {number: signal.signal(number, self._handle) for number in chosen}
            if self._max_wall is not None:
                self._set_alarm(self._max_wall)
        return self

    def _set_alarm(self, seconds: float) -> None:
        """Schedules a signal; on Windows by a thread."""
        if hasattr(signal, "setitimer"):
            signal.setitimer(signal.ITIMER_REAL, seconds)
            return
        self._timer = threading.Timer(seconds, _thread.interrupt_main, (self._alarm,))
        self._timer.daemon = True
        self._timer.start()

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        Stopper.message = ""
        if self._before and self._max_wall is not None:
            if hasattr(signal, "setitimer"):
                signal.setitimer(signal.ITIMER_REAL, 0.0)
            if self._timer is not None:
                self._timer.cancel()
        for number, handler in self._before.items():
            signal.signal(number, handler)


def _in_a_pool() -> bool:
    """Whether another Python process has spawned this one, by multiprocessing."""
    process = sys.modules.get("multiprocessing.process")
    return process is not None and process.parent_process() is not None


class Console(Protocol):
    """Messages of a run, all on stderr."""

    def phase(self, text: str) -> None:
        """Starts a phase."""

    def step(self, index: int, position: float, residual: float, text: str) -> None:
        """A finished step of the path."""

    def note(self, text: str) -> None:
        """A note."""

    def warning(self, text: str) -> None:
        """A warning about the accuracy or validity of the result."""

    def table(self, title: str, rows: Sequence[tuple[str, str]]) -> None:
        """A small table of names and values."""


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
        """Wall-clock seconds since this clock, or the process, started."""
        return time.monotonic() - self._wall_begin

    @property
    def seconds(self) -> dict[str, float]:
        """The phases so far and their ``total``."""
        return {"total": time.process_time() - self._begin, **self._seconds}


@dataclass(frozen=True)
class RunContext:
    """``memo`` keeps results for other runs of the process; ``stopper`` handles signals and the wall time."""

    clock: Clock
    console: Console
    memo: Memo = NO_CACHE
    stopper: Stopper | None = None

    @contextmanager
    def phase(self, name: str, announced: str = "") -> Iterator[None]:
        """Counts the CPU time of the block under ``name``, and announces it on the console."""
        with self.clock.phase(name):
            if announced:
                self.console.phase(announced)
            yield

    def stop_gently(self) -> None:
        """From now on the command stops between steps only, where no results are lost."""
        if self.stopper is not None:
            self.stopper.gentle = True
        self.check_stop()

    def check_stop(self) -> None:
        """Raises KeyboardInterrupt if the command is to stop."""
        if self.stopper is not None:
            self.stopper.check()
