"""Progress messages on stderr: in place on a terminal, line by line elsewhere."""

from __future__ import annotations

import os
import shutil
import sys
import threading
import time
from collections.abc import Callable, Sequence
from typing import Any, TextIO

from mlsanm_cli.cli.settings import Settings, is_terminal, of_app
from mlsanm_cli.cli.text import BOLD, DIM, RED, YELLOW, paint, printable
from mlsanm_cli.records import Closing
from mlsanm_cli.stopping import Stopper

INTERVAL = 0.5
"""Seconds between two updates of the elapsed time."""


_COLUMNS = 80
_SOLVING = "solving ..."
_CLEAR = "\r\x1b[K"
_LOG_INTERVAL = 1.0
_TERMINAL_INTERVAL = 0.05
"""Seconds between two rows of the step table in a log, and on a terminal."""


class TerminalConsole(Closing):
    """Progress, notes and warnings.

    With ``quiet`` only warnings are shown. On a terminal, phases and steps rewrite one line, which shows the
    elapsed time while it does not change. Elsewhere a phase is a line, and steps are shown at most once a
    second, and always the first and the last.
    """

    def __init__(
        self,
        stream: TextIO,
        settings: Settings,
        *,
        clock: Callable[[], float] = time.monotonic,
        width: int | None = None,
        interval: float = INTERVAL,
    ) -> None:
        self._stream = stream
        self._quiet = settings.quiet
        self._color = settings.paints(stream)
        self._live = is_terminal(stream) and not settings.quiet
        self._clock = clock
        self._width = width
        self._closed = False  # the reader has closed the stream
        self._style = DIM
        self._shown = ""  # the line on the terminal that the next one replaces
        self._row: list[str] = []  # its columns, if it is a step
        self._doing = ""  # the phase, shown again after a message
        self._waiting: list[str] = []  # the latest step if it has not been shown
        self._last: float | None = None
        # Two threads write: this one, and the one that shows the elapsed time.
        self._lock = threading.RLock()
        self._interval = interval
        self._since = time.monotonic()
        self._over = threading.Event()
        self._thread: threading.Thread | None = None

    def phase(self, text: str) -> None:
        """Starts a phase."""
        with self._lock:
            self._finish_steps()
            if self._quiet:
                return
            if self._live:
                self._doing = f"{text} ..."
                self._rewrite(self._doing)
            else:
                self._line(f"{text} ...")

    def step(self, index: int, position: float, residual: float, text: str = "") -> None:
        """A row of the step table: path position, scaled residual, remarks."""
        if self._quiet:
            return
        remarks = text.split("  ") if text else []
        row = [f"step {index:4d} ", f"position {position:<9.6g}", f"residual {residual:8.2e} ", *remarks]
        with self._lock:
            now = self._clock()
            pause = _TERMINAL_INTERVAL if self._live else _LOG_INTERVAL
            if self._last is not None and now - self._last < pause:
                self._waiting = row
                return
            self._doing = _SOLVING
            self._show_step(row)
            self._last = now

    def note(self, text: str) -> None:
        """A note."""
        with self._lock:
            self._finish_steps()
            if not self._quiet:
                self._line(printable(text))

    def warning(self, text: str) -> None:
        """A warning; shown with ``quiet`` too."""
        with self._lock:
            self._finish_steps()
            self._line(f"{paint('warning:', YELLOW, self._color)} {printable(text)}")

    def error(self, message: str, hint: str) -> None:
        """Why a run failed, and what to do; shown with ``quiet`` too."""
        with self._lock:
            self._finish_steps()
            for kind, text, color in (("error:", message, RED), ("hint:", hint, YELLOW)):
                if text:
                    self._line(f"{paint(kind, color, self._color)} {printable(text)}")

    def close(self) -> None:
        """Cleans up the terminal: the last step remains, the phase is erased."""
        self._over.set()
        with self._lock:
            self._doing = ""
            self._finish_steps()
            self._erase()

    def _show_elapsed(self, seconds: float) -> None:
        """Adds elapsed time to the line on the terminal, omitting what does not fit."""
        with self._lock:
            if not self._shown:
                return
            sign, room = f"  {seconds:.0f} s", self._columns() - 1
            parts = [Stopper.message] if Stopper.message else self._row or [self._shown]
            shown = fitting(parts, room - len(sign))
            shown = f"{shown[: max(room - len(sign), 0)].rstrip()}{sign}"[:room]
            self._put(_CLEAR + paint(shown, self._style, self._color))

    def _show_step(self, row: list[str]) -> None:
        self._waiting = []
        if self._live:
            self._rewrite(fitting(row, self._columns() - 1), row)
        else:
            self._line("  ".join(row).rstrip())

    def _finish_steps(self) -> None:
        """Ends a sequence of steps: the last one remains."""
        if self._last is None:
            return
        if self._waiting:
            self._show_step(self._waiting)
        if self._live:
            # Removes the elapsed time.
            self._put(f"{_CLEAR}{paint(self._shown, self._style, self._color)}\n")
            self._shown = ""
        self._last = None

    def _rewrite(self, text: str, row: Sequence[str] = ()) -> None:
        # One column remains free: terminals wrap after the last one.
        width = max(self._columns() - 1, 1)
        if len(text) > width:
            text = f"{text[: max(width - 4, 0)].rstrip(' .')} ..."[:width]
        self._style = BOLD if text.endswith("...") else DIM
        self._put(_CLEAR + paint(text, self._style, self._color))
        self._shown, self._row = text, list(row)
        self._since = time.monotonic()
        if self._thread is None and not self._over.is_set():
            # An interrupted process does not wait for a daemon thread.
            self._thread = threading.Thread(target=self._beat, daemon=True)
            self._thread.start()

    def _beat(self) -> None:
        """Shows the elapsed time about once per interval while the line does not change."""
        while not self._over.wait(self._interval):
            elapsed = time.monotonic() - self._since
            if elapsed >= self._interval:
                self._show_elapsed(elapsed)

    def _columns(self) -> int:
        """Width of the terminal of the stream."""
        if self._width:
            return self._width
        try:
            return os.get_terminal_size(self._stream.fileno()).columns or _COLUMNS
        except (OSError, ValueError):
            return shutil.get_terminal_size((_COLUMNS, 24)).columns

    def _erase(self) -> None:
        if self._shown:
            self._put(_CLEAR)
            self._shown = ""

    def _line(self, text: str) -> None:
        self._erase()
        self._put(f"{text}\n")
        if self._live and self._doing:
            self._rewrite(self._doing)

    def _put(self, text: str) -> None:
        """Writes; after the reader has closed the stream, as in `| head`, output is discarded."""
        if self._closed:
            return
        try:
            self._stream.write(text)
            self._stream.flush()
        except OSError:
            self._closed = True


def console_for(settings: Settings, doing: str = "starting") -> TerminalConsole:
    """The console for progress messages on stderr; a terminal shows ``doing`` until the first of them.

    Opened before the numerical modules are imported, which takes a second or more.
    """
    console = TerminalConsole(sys.stderr, settings)
    if is_terminal(sys.stderr):
        console.phase(doing)
    return console


def called(settings: Settings, function: str, threads: int, /, *given: Any, **options: Any) -> Any:
    """The result of a function of ``mlsanm_cli.app`` that reports its progress on stderr, imported with this
    number of threads."""
    with console_for(settings) as console:
        return of_app(function, threads)(*given, console=console, **options)


def fitting(columns: Sequence[str], width: int) -> str:
    """The columns of a step as a line of at most ``width`` characters.

    Columns that do not fit are omitted, first the residual, then from the end; the first one always remains.

    >>> fitting(["step    3 ", "position 0.5", "residual 1e-09 ", "closed 7", "peak pressure 25.1"], 60)
    'step    3   position 0.5  closed 7  peak pressure 25.1'
    """
    kept = list(columns)
    while len("  ".join(kept).rstrip()) > width and len(kept) > 1:
        del kept[2 if len(kept) == len(columns) > 2 else -1]
    return "  ".join(kept).rstrip()
