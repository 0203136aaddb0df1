"""Settings from the common options, functions imported on call, and output to streams that may be closed."""

from __future__ import annotations

import contextlib
import importlib
import os
import shutil
import sys
from collections.abc import Callable, Mapping
from typing import Any, TextIO

import click

from mlsanm_cli.cli.text import as_json, pretty
from mlsanm_cli.records import dataclass
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
    """Replaces closed standard streams by the null device: else the first file opened would get their
    output."""
    for number in range(3):
        try:
            os.fstat(number)
        except OSError:
            os.open(os.devnull, os.O_RDWR)
    # Python sets streams that are closed at start to None.
    sys.stdout = sys.stdout or open(os.devnull, "w", encoding="utf-8")  # noqa: SIM115
    sys.stderr = sys.stderr or open(os.devnull, "w", encoding="utf-8")  # noqa: SIM115


def say(settings: Settings, text: str, *, newline: bool = True) -> None:
    """Writes to stdout; errors are stored in the settings, as results and exit code do not depend on the
    reader."""
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
