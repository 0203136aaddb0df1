"""Stopping a run by a signal without tearing it apart."""

from __future__ import annotations

import signal
import threading
from types import FrameType, TracebackType
from typing import Any, Self

STOPPING = (signal.SIGINT, signal.SIGTERM)


class Stopper:
    """Turns SIGINT and SIGTERM into an orderly end; use as a context manager.

    While ``gentle``, the first signal only sets ``requested``, and :meth:`check` raises KeyboardInterrupt
    where it does no harm; a second one raises it at once. Otherwise the first raises it at once and is
    remembered, for an exception in a callback of a compiled library can be lost. Nothing changes outside
    the main thread.
    """

    def __init__(self) -> None:
        self.gentle = False
        self.requested = False
        self._before: dict[signal.Signals, Any] = {}

    def check(self) -> None:
        """Raise KeyboardInterrupt if a signal has come."""
        if self.requested:
            raise KeyboardInterrupt

    def _handle(self, number: int, frame: FrameType | None) -> None:
        again, self.requested = self.requested, True
        if again or not self.gentle:
            raise KeyboardInterrupt

    def __enter__(self) -> Self:
        if threading.current_thread() is threading.main_thread():
            self._before = {number: signal.signal(number, self._handle) for number in STOPPING}
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        for number, handler in self._before.items():
            signal.signal(number, handler)
