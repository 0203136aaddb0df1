"""The stopper, which ends a run after a signal or a limit on its wall time. Imports no numerical library: the
console shows its message while those are being imported."""

from __future__ import annotations

import signal
import sys
import threading
import time
from types import FrameType, TracebackType
from typing import Any, ClassVar, Self

from mlsanm_cli.system import STOPPING

STOPPING_MESSAGE = "stopping after this step; Ctrl-C again stops at once"
GRACE = 2.0
"""Seconds that a step may still take after a signal."""


class Stopper:
    """Raises KeyboardInterrupt at a signal or after ``max_wall`` seconds; use as a context manager.

    While ``gentle``, the first signal only sets ``reason``, and :meth:`check`, called between steps, raises
    the exception; a second signal raises it at once, and so do ``grace`` seconds without a check, unless that
    is None. Otherwise the first one raises it at once and sets ``reason``, as an exception in a callback of a
    compiled library can be lost. Outside the main thread only :meth:`check` applies, to the wall time.
    """

    message: ClassVar[str] = ""
    """Shown on a terminal after a signal that stops the run after its step."""

    def __init__(self, max_wall: float | None = None) -> None:
        self.gentle, self.reason = False, ""
        self.grace: float | None = GRACE
        self._max_wall = max_wall
        self._end = time.monotonic() + max_wall if max_wall is not None else None
        self._before: dict[signal.Signals, Any] = {}

    def check(self) -> None:
        """Raises KeyboardInterrupt after a signal or when the wall time is over."""
        if self._end is not None and time.monotonic() >= self._end:
            self.reason = self.reason or self._over
        if self.reason:
            self._set_alarm(0.0)
            raise KeyboardInterrupt(self.reason)

    def finish(self) -> None:
        """From now on only a second signal raises the exception."""
        self.grace = None
        self._set_alarm(0.0)

    @property
    def _over(self) -> str:
        return f"the wall time of {self._max_wall:g} s is over"

    def _handle(self, number: int, frame: FrameType | None) -> None:
        again, name = bool(self.reason), signal.Signals(number).name
        timed = self._max_wall is not None and name == "SIGALRM"
        self.reason = self.reason or (self._over if timed else f"stopped by a signal ({name})")
        if again or not self.gentle:
            raise KeyboardInterrupt(self.reason)
        # Not written here: a handler may interrupt the writing of another line.
        Stopper.message = STOPPING_MESSAGE
        if self.grace is not None:
            self._set_alarm(self.grace)

    def __enter__(self) -> Self:
        if threading.current_thread() is threading.main_thread():
            # SIGTERM ends a process of a pool at once, as the pool waits for it.
            process = sys.modules.get("multiprocessing.process")
            pooled = process is not None and process.parent_process() is not None
            chosen = [number for number in STOPPING if number != signal.SIGTERM or not pooled]
            self._before = {number: signal.signal(number, self._handle) for number in chosen}
            if self._max_wall is not None:
                self._set_alarm(self._max_wall)
        return self

    def _set_alarm(self, seconds: float) -> None:
        """Schedules a signal, instead of one that is due; 0 for none. Without timers, as on Windows, a run
        stops between its steps only."""
        if self._before and hasattr(signal, "setitimer"):
            signal.setitimer(signal.ITIMER_REAL, seconds)

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        Stopper.message = ""
        self._set_alarm(0.0)
        for number, handler in self._before.items():
            signal.signal(number, handler)
