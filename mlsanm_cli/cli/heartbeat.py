"""A periodic callback during long operations."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable

INTERVAL = 0.5
"""Seconds between two calls."""


class Heartbeat:
    """Calls ``beat`` from a separate thread about once per ``interval``, with the seconds since the last
    :meth:`touch`."""

    def __init__(self, beat: Callable[[float], None], interval: float = INTERVAL) -> None:
        self._beat = beat
        self._interval = interval
        self._since = time.monotonic()
        self._over = threading.Event()
        self._thread: threading.Thread | None = None

    def touch(self) -> None:
        """Restarts the time; the first call starts the thread."""
        self._since = time.monotonic()
        if self._thread is None and not self._over.is_set():
            # An interrupted process does not wait for a daemon thread.
            self._thread = threading.Thread(target=self._run, daemon=True)
            self._thread.start()

    def stop(self) -> None:
        """Ends the calls."""
        self._over.set()

    def _run(self) -> None:
        while not self._over.wait(self._interval):
            elapsed = time.monotonic() - self._since
            if elapsed >= self._interval:
                self._beat(elapsed)
