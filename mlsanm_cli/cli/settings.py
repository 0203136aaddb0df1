"""Settings from the options common to all commands, the number of threads, and the standard streams, which
the caller or the reader may close at any time."""

from __future__ import annotations

import contextlib
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TextIO

import click

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


def set_threads(threads: int) -> None:
    """Sets the number of threads of the numerical libraries, which read it when they are imported."""
    for variable in THREAD_VARIABLES:
        os.environ[variable] = str(threads)


@contextmanager
def numerics(threads: int) -> Iterator[None]:
    """The block in which a command imports the numerics, with this number of threads."""
    from mlsanm_cli.startup import lean_imports

    set_threads(threads)
    with lean_imports():
        yield


def open_closed_streams() -> None:
    """Replaces closed standard streams (``>&-``) by the null device.

    Otherwise the first file opened by a run would get the number of the stream, and its output.
    """
    for number in range(3):
        try:
            os.fstat(number)
        except OSError:
            os.open(os.devnull, os.O_RDWR)
    # Python sets streams that are closed at start to None.
    sys.stdout = sys.stdout or open(os.devnull, "w", encoding="utf-8")  # noqa: SIM115
    sys.stderr = sys.stderr or open(os.devnull, "w", encoding="utf-8")  # noqa: SIM115


def say(settings: Settings, text: str, *, newline: bool = True) -> None:
    """Writes to stdout. An error is stored in the settings, and the command continues: its results and exit
    code do not depend on the reader."""
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
