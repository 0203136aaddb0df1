"""Entry point of the command line: every error ends here, with its exit code and without a traceback."""

from __future__ import annotations

import io
import os
import signal
import sys
import threading
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from types import FrameType
from typing import TextIO

import click

from mlsanm_cli.cli.commands import cli
from mlsanm_cli.cli.settings import Settings
from mlsanm_cli.cli.text import RED, YELLOW, paint, printable
from mlsanm_cli.errors import CaseError, MlsanmError

USAGE, BUG, STOPPED = 2, 70, 75
SHOWN = 200
"""Problems of a case that are printed; of more nobody reads."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Runs a command and returns its exit code; never raises.

    0 done, 2 bad usage or bad case, 3 numerical failure, 70 bug, 75 stopped by a signal.
    """
    settings = Settings()
    try:
        with _terminate_like_interrupt():
            code = cli.main(
                args=None if arguments is None else list(arguments),
                prog_name="mlsanm",
                standalone_mode=False,
                obj=settings,
            )
            sys.stdout.flush()
        return code if isinstance(code, int) else 0
    except BaseException as error:
        # click makes an exit with code 1 of a broken pipe, its only exit in this mode.
        if isinstance(error, BrokenPipeError) or (isinstance(error, SystemExit) and error.code == 1):
            # The reader left, as `mlsanm info DIR | head` does. Python would complain again when it ends.
            _silence(sys.stdout)
            return 0
        return _report(error, settings)
    finally:
        try:
            sys.stderr.flush()
        except OSError:
            # Python would fail at it once more when it ends, and change the exit code.
            _silence(sys.stderr)


def _silence(stream: TextIO) -> None:
    """Let what a stream still has, and all that comes, go nowhere."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())


def _report(error: BaseException, settings: Settings) -> int:
    """Prints the error and returns the exit code that goes with it."""
    if settings.debug and not isinstance(error, click.ClickException):
        import traceback  # which nobody sees without --debug

        traceback.print_exception(error)
    if isinstance(error, CaseError):
        for problem in error.problems[:SHOWN]:
            _print("", str(problem).replace("\n", "\\n"), settings)
        count = len(error.problems)
        if count > SHOWN:
            _print("", f"and {count - SHOWN} more", settings)
        _print("error", f"{count} problem{'' if count == 1 else 's'}, nothing was run", settings)
        return error.exit_code
    if isinstance(error, MlsanmError):
        _print("error", error.message, settings)
        _print("hint", error.hint, settings)
        return error.exit_code
    if isinstance(error, click.ClickException):
        shown = io.StringIO()
        error.show(file=shown)
        print(printable(shown.getvalue()), end="", file=sys.stderr)
        return USAGE
    if isinstance(error, click.Abort | KeyboardInterrupt):
        # click keeps what it makes an Abort of as its cause.
        _print("error", str(error) or str(error.__cause__ or "") or "stopped by a signal", settings)
        return STOPPED
    if isinstance(error, MemoryError):
        _print("error", "the memory is used up", settings)
        _print("hint", "larger spacings need less; `mlsanm check` estimates the size", settings)
        return USAGE
    if isinstance(error, OSError) and error.filename is not None:
        _print("error", f"{error.filename}: {error.strerror or error}", settings)
        return USAGE
    _print("error", f"a bug in mlsanm: {type(error).__name__}: {error}", settings)
    if not settings.debug:
        _print("hint", "please report it, with the case file and what --debug adds to this", settings)
    return BUG


def _print(kind: str, text: str, settings: Settings) -> None:
    if text:
        color = settings.paints(sys.stderr)
        prefix = paint(f"{kind}:", RED if kind == "error" else YELLOW, color) + " " if kind else ""
        print(prefix + printable(text), file=sys.stderr)


@contextmanager
def _terminate_like_interrupt() -> Iterator[None]:
    """SIGTERM ends a command as Ctrl-C does, so that files are closed; the old handler comes back."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return

    def interrupt(number: int, frame: FrameType | None) -> None:
        raise KeyboardInterrupt

    before = signal.signal(signal.SIGTERM, interrupt)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, before)
