"""Settings from the common options, functions imported on call, results on stdout, which may be closed, and
progress on stderr: in place on a terminal, line by line elsewhere."""

from __future__ import annotations

import contextlib
import importlib
import os
import shutil
import sys
import threading
import time
from collections.abc import Callable, Mapping, Sequence
from typing import Any, TextIO

import click

from mlsanm_cli.cli.text import BOLD, DIM, RED, YELLOW, as_json, paint, pretty, printable
from mlsanm_cli.records import Closing, dataclass
from mlsanm_cli.stopping import Stopper
from mlsanm_cli.system import THREAD_VARIABLES


@dataclass
class Settings:
    """Set while the command line is parsed; used by the error handler too."""

    quiet: bool = False
    json: bool = False
    debug: bool = False
    color: str = "auto"
    stdout_error: OSError | None = None
    """The error of writing the result to stdout, if any."""

    def paints(self, stream: TextIO) -> bool:
        """Whether output to the stream is coloured: by the option, NO_COLOR, or the terminal."""
        if self.color != "auto":
            return self.color == "always"
        return not os.environ.get("NO_COLOR") and is_terminal(stream)


def is_terminal(stream: TextIO) -> bool:
    """Whether the stream is a terminal that understands escape sequences."""
    return stream.isatty() and os.environ.get("TERM") != "dumb"


def of_app(function: str, threads: int = 1) -> Callable[..., Any]:
    """A function of ``mlsanm_cli.app``, imported with this number of threads of the numerical libraries."""
    from mlsanm_cli.startup import lean_imports

    os.environ.update(dict.fromkeys(THREAD_VARIABLES, str(threads)))
    module, _, name = function.rpartition(".")
    with lean_imports():
        loaded: Callable[..., Any] = getattr(importlib.import_module(f"mlsanm_cli.app.{module}"), name)
    return loaded


def print_result(settings: Settings, result: Mapping[str, Any], text: str) -> None:
    """Prints the result on stdout: as JSON, as text, or not at all with ``quiet``."""
    if settings.json:
        say(settings, as_json(result))
    elif not settings.quiet:
        say(settings, text)


def print_tables(
    settings: Settings, result: Mapping[str, Any], shown: Mapping[str, Any] | None = None
) -> None:
    """Prints the result, or as text only what is ``shown`` of it, as tables as wide as the terminal."""
    width = shutil.get_terminal_size((100, 24)).columns
    shown = result if shown is None else shown
    print_result(settings, result, pretty(shown, color=settings.paints(sys.stdout), width=width))


def open_closed_streams() -> None:
    """Opens the null device for closed standard streams: else the next file opened gets their output."""
    for number in range(3):
        try:
            os.fstat(number)
        except OSError:
            os.open(os.devnull, os.O_RDWR)
    # Python sets streams that are closed at start to None.
    sys.stdout = sys.stdout or open(os.devnull, "w", encoding="utf-8")  # noqa: SIM115
    sys.stderr = sys.stderr or open(os.devnull, "w", encoding="utf-8")  # noqa: SIM115


def say(settings: Settings, text: str, *, newline: bool = True) -> None:
    """Writes to stdout; errors are stored in the settings, as results do not depend on the reader."""
    if settings.stdout_error is not None:
        return
    try:
        # Colours are set already; click must not change them.
        click.echo(text, nl=newline, color=True)
    except OSError as error:
        settings.stdout_error = error
        silence(sys.stdout)


def silence(stream: TextIO) -> None:
    """Discards buffered and future output of a stream, which Python would flush again at exit."""
    # A stream that is not a file, as in tests, has no file descriptor.
    with contextlib.suppress(OSError, ValueError, AttributeError):
        os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())


_CLEAR = "\r\x1b[K"


class TerminalConsole(Closing):
    """Progress, notes and warnings; with ``quiet`` only warnings. On a terminal, phases and steps rewrite one
    line, which shows the elapsed time while it does not change, every ``interval`` seconds. Elsewhere a phase
    is a line, and steps are shown at most once a second, and always the first and the last."""

    def __init__(
        self,
        stream: TextIO,
        settings: Settings,
        *,
        clock: Callable[[], float] = time.monotonic,
        width: int | None = None,
        interval: float = 0.5,
    ) -> None:
        self._stream: TextIO | None = stream  # None after the reader has closed it
        self._quiet = settings.quiet
        self._color = settings.paints(stream)
        self._live = is_terminal(stream) and not settings.quiet
        self._clock, self._width, self._interval = clock, width, interval
        self._row: list[str] = []  # the columns of the line on the terminal that the next one replaces
        self._doing = ""  # the phase, shown again after a message
        self._waiting: list[str] = []  # the latest step if it has not been shown
        self._last: float | None = None
        # Two threads write: this one, and the one that shows the elapsed time.
        self._lock = threading.RLock()
        self._since = time.monotonic()
        self._over = threading.Event()
        self._thread: threading.Thread | None = None

    def phase(self, text: str) -> None:
        with self._lock:
            self._finish_steps()
            if self._live:
                self._doing = f"{text} ..."
                self._rewrite([self._doing])
            elif not self._quiet:
                self._line(f"{text} ...")

    def step(self, index: int, position: float, residual: float, text: str = "") -> None:
        """A row of the step table: path position, scaled residual, remarks."""
        if self._quiet:
            return
        remarks = text.split("  ") if text else []
        row = [f"step {index:4d} ", f"position {position:<9.6g}", f"residual {residual:8.2e} ", *remarks]
        with self._lock:
            now, pause = self._clock(), 0.05 if self._live else 1.0
            if self._last is not None and now - self._last < pause:
                self._waiting = row
                return
            self._doing, self._last = "solving ...", now
            self._show_step(row)

    def note(self, text: str) -> None:
        self.message("" if self._quiet else text)

    def warning(self, text: str) -> None:
        """A warning; shown with ``quiet`` too."""
        self.message(text, "warning:", YELLOW)

    def error(self, message: str, hint: str) -> None:
        """Why a run failed, and what to do; shown with ``quiet`` too."""
        self.message(message, "error:", RED)
        self.message(hint, "hint:", YELLOW)

    def close(self) -> None:
        self._over.set()
        with self._lock:
            self._doing = ""
            self._finish_steps()
            self._erase()

    def message(self, text: str, kind: str = "", color: str = "") -> None:
        with self._lock:
            self._finish_steps()
            if text:
                prefix = f"{paint(kind, color, self._color)} " if kind else ""
                self._line(f"{prefix}{printable(text)}")

    def _show_step(self, row: list[str]) -> None:
        self._waiting = []
        if self._live:
            self._rewrite(row)
        else:
            self._line("  ".join(row).rstrip())

    def _finish_steps(self) -> None:
        if self._last is not None and self._waiting:
            self._show_step(self._waiting)
        if self._last is not None and self._live:
            # Removes the elapsed time.
            self._draw(self._row)
            self._put("\n")
            self._row = []
        self._last = None

    def _rewrite(self, row: Sequence[str]) -> None:
        self._row, self._since = list(row), time.monotonic()
        self._draw(row)
        if self._thread is None and not self._over.is_set():
            # An interrupted process does not wait for a daemon thread.
            self._thread = threading.Thread(target=self._beat, daemon=True)
            self._thread.start()

    def _draw(self, row: Sequence[str], elapsed: str = "") -> None:
        """Draws a line, omitting what does not fit beside the elapsed time."""
        # One column remains free: terminals wrap after the last one.
        width = max(self._columns() - 1, 1)
        room = max(width - len(elapsed), 0)
        text = fitting(row, room)
        if len(text) > room:
            text = text[:room].rstrip() if elapsed else f"{text[: max(room - 4, 0)].rstrip(' .')} ..."
        style = BOLD if self._row[-1:] == [self._doing] else DIM
        self._put(_CLEAR + paint(f"{text}{elapsed}"[:width], style, self._color))

    def _beat(self) -> None:
        while not self._over.wait(self._interval):
            elapsed = time.monotonic() - self._since
            if elapsed >= self._interval:
                self._show_elapsed(elapsed)

    def _show_elapsed(self, seconds: float) -> None:
        with self._lock:
            if self._row:
                self._draw([Stopper.message] if Stopper.message else self._row, f"  {seconds:.0f} s")

    def _columns(self) -> int:
        try:
            stream = self._stream or sys.stderr
            return self._width or os.get_terminal_size(stream.fileno()).columns or 80
        except (OSError, ValueError):
            return shutil.get_terminal_size((80, 24)).columns

    def _erase(self) -> None:
        self._put(_CLEAR if self._row else "")
        self._row = []

    def _line(self, text: str) -> None:
        self._erase()
        self._put(f"{text}\n")
        if self._live and self._doing:
            self._rewrite([self._doing])

    def _put(self, text: str) -> None:
        """Writes; after the reader has closed the stream, as in `| head`, output is discarded."""
        try:
            if self._stream is not None and text:
                self._stream.write(text)
                self._stream.flush()
        except OSError:
            self._stream = None


def console_for(settings: Settings, doing: str = "starting") -> TerminalConsole:
    """The console on stderr; a terminal shows ``doing`` until the first message, as during imports."""
    console = TerminalConsole(sys.stderr, settings)
    if is_terminal(sys.stderr):
        console.phase(doing)
    return console


def called(settings: Settings, function: str, threads: int, /, *given: Any, **options: Any) -> Any:
    """The result of a function of ``mlsanm_cli.app`` that reports its progress on stderr."""
    with console_for(settings) as console:
        return of_app(function, threads)(*given, console=console, **options)


def fitting(columns: Sequence[str], width: int) -> str:
    """The columns of a step as a line of at most ``width`` characters. Columns that do not fit are omitted,
    first the residual, then from the end; the first one always remains.

    >>> fitting(["step    3 ", "position 0.5", "residual 1e-09 ", "closed 7", "peak pressure 25.1"], 60)
    'step    3   position 0.5  closed 7  peak pressure 25.1'
    """
    kept = list(columns)
    while len("  ".join(kept).rstrip()) > width and len(kept) > 1:
        del kept[2 if len(kept) == len(columns) > 2 else -1]
    return "  ".join(kept).rstrip()
