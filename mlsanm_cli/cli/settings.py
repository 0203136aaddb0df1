"""Settings from the options common to all commands, and the number of threads."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import TextIO

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
