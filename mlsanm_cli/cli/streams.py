"""The standard streams, of which a caller may have closed some, or whose reader may leave at any moment."""

from __future__ import annotations

import contextlib
import os
import sys
from typing import TextIO

import click

from mlsanm_cli.cli.settings import Settings


def open_closed_streams() -> None:
    """Give a process that was started without stdin, stdout or stderr (``>&-``) the null device for it.

    Otherwise the first file of a run would get the number of the stream, and whatever is written there.
    """
    for number in range(3):
        try:
            os.fstat(number)
        except OSError:
            os.open(os.devnull, os.O_RDWR)
    # Python has None for a stream that was closed when it started; it lives as long as the process.
    sys.stdout = sys.stdout or open(os.devnull, "w", encoding="utf-8")  # noqa: SIM115
    sys.stderr = sys.stderr or open(os.devnull, "w", encoding="utf-8")  # noqa: SIM115


def say(settings: Settings, text: str, *, newline: bool = True) -> None:
    """Write to stdout. Where that fails the settings remember why, and the command goes on: what it did, and
    its exit code, do not depend on who reads the result."""
    if settings.unsaid is not None:
        return
    try:
        # The text is coloured or plain already; click would decide again by its own rules.
        click.echo(text, nl=newline, color=True)
    except OSError as error:
        settings.unsaid = error
        silence(sys.stdout)


def silence(stream: TextIO) -> None:
    """Let what a stream still has, and all that comes, go nowhere: Python flushes it once more at its end."""
    # A stream that is no file, as in tests, has no number.
    with contextlib.suppress(OSError, ValueError, AttributeError):
        os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())
