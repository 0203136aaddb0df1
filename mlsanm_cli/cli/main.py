"""Entry point of the command line: turns errors into messages and exit codes."""

from __future__ import annotations

import errno
import io
import signal
import sys
import threading
from collections.abc import Iterator, Sequence
from contextlib import contextmanager

import click

from mlsanm_cli.cli.commands import cli
from mlsanm_cli.cli.console import Settings, TerminalConsole, open_closed_streams, say, silence
from mlsanm_cli.cli.text import as_json
from mlsanm_cli.errors import CaseError, CaseProblem, MlsanmError

USAGE, BUG, STOPPED = 2, 70, 75
STREAM_ERRORS = (errno.EPIPE, errno.EBADF, errno.EFBIG, errno.EIO, errno.ENOSPC)
"""Errors of writing to a stream that has no reader or is on a full disk."""
MAX_PROBLEMS = 200
"""Largest number of problems of a case that are printed."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Runs a command and returns its exit code; never raises. 0 done, 2 bad usage or bad case, 3 numerical
    failure, 70 bug, 75 stopped by a signal."""
    open_closed_streams()
    settings = Settings()
    # Before parsing: errors in options are reported as JSON too.
    settings.json = "--json" in (sys.argv[1:] if arguments is None else arguments)
    try:
        code = _run(arguments, settings)
        if settings.stdout_error is not None and not isinstance(settings.stdout_error, BrokenPipeError):
            message = f"cannot write to stdout: {settings.stdout_error.strerror}"
            TerminalConsole(sys.stderr, settings).error(message, "")
            code = code or USAGE
        return code
    finally:
        try:
            sys.stderr.flush()
        except OSError:
            # Python would flush it again at exit, fail again, and change the exit code.
            silence(sys.stderr)


def _run(arguments: Sequence[str] | None, settings: Settings) -> int:
    """Runs a command, reports its error, if any, and returns its exit code."""
    stdout, stderr = sys.stdout, sys.stderr
    try:
        with _signals_as_interrupts():
            given = None if arguments is None else list(arguments)
            code = cli.main(given, prog_name="mlsanm", standalone_mode=False, obj=settings)
            sys.stdout.flush()
        return code if isinstance(code, int) else 0
    except SystemExit as error:
        # Raised by click after shell completion and, with wrapped streams, after help to a closed stream.
        if sys.stdout is not stdout:
            sys.stdout, sys.stderr = stdout, stderr
            silence(stdout)
            return 0
        return error.code if isinstance(error.code, int) else 0
    except OSError as error:
        if error.filename is not None or error.errno not in STREAM_ERRORS:
            return _report(error, settings)
        # A stream, as files have names: click writes help, version and completion itself.
        settings.stdout_error = error
        silence(sys.stdout)
        return 0
    except BaseException as error:
        return _report(error, settings)


def _report(error: BaseException, settings: Settings) -> int:
    """Prints the error, with ``--json`` on stdout too, unknown places as null; returns its exit code."""
    if settings.debug and not isinstance(error, click.ClickException):
        import traceback

        traceback.print_exception(error)
    problems: Sequence[CaseProblem]
    console = TerminalConsole(sys.stderr, settings)
    if isinstance(error, click.ClickException):
        shown = io.StringIO()
        error.show(file=shown)
        console.message(shown.getvalue().removesuffix("\n"))
        code, problems = USAGE, [CaseProblem("", error.format_message())]
    elif isinstance(error, CaseError):
        code, problems, count = error.exit_code, error.problems, len(error.problems)
        for problem in problems[:MAX_PROBLEMS]:
            console.message(str(problem).replace("\n", "\\n"))
        if count > MAX_PROBLEMS:
            console.message(f"and {count - MAX_PROBLEMS} more")
        console.error(f"{count} problem{'' if count == 1 else 's'} in the case, nothing was run", "")
    else:
        code, message, hint = _described(error, settings)
        console.error(message, hint)
        problems = [CaseProblem("", message, hint=hint)]
    if settings.json:
        keys = {"file": "source", "line": "line", "key": "key", "message": "message", "hint": "hint"}
        listed = [{key: getattr(one, name) or None for key, name in keys.items()} for one in problems]
        say(settings, as_json({"problems": listed}))
    return code


def _described(error: BaseException, settings: Settings) -> tuple[int, str, str]:
    """Exit code, message and hint of an error that is not a CaseError."""
    match error:
        case MlsanmError():
            return error.exit_code, error.message, error.hint
        case click.Abort() | KeyboardInterrupt():
            # click keeps the original error as the cause of an Abort.
            message = str(error) or str(error.__cause__ or "") or "stopped by a signal"
            return STOPPED, message, "nothing was saved: repeat the command"
        case MemoryError():
            return USAGE, "out of memory", "increase the spacings; `mlsanm check` estimates the size"
        case OSError(filename=name) if name is not None:
            return USAGE, f"{name}: {error.strerror or error}", ""
    hint = "" if settings.debug else "please report it with the case file and the output of --debug"
    return BUG, f"a bug in mlsanm: {type(error).__name__}: {error}", hint


@contextmanager
def _signals_as_interrupts() -> Iterator[None]:
    """Within the block SIGTERM and SIGUSR1 end a command like Ctrl-C, which closes its files."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    # The handler of Ctrl-C raises KeyboardInterrupt.
    numbers = [getattr(signal, name) for name in ("SIGTERM", "SIGUSR1") if hasattr(signal, name)]
    before = {number: signal.signal(number, signal.default_int_handler) for number in numbers}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
