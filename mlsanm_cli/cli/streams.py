"""The standard streams, which the caller or the reader may close at any time."""

from __future__ import annotations

import contextlib
import os
import sys
from typing import TextIO

import click

from mlsanm_cli.cli.settings import Settings


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
