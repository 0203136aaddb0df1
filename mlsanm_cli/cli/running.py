"""Functions of commands imported on call, their progress messages and the output of their results."""

from __future__ import annotations

import importlib
import shutil
import sys
from collections.abc import Callable, Mapping
from typing import Any

from mlsanm_cli.cli.console import TerminalConsole
from mlsanm_cli.cli.settings import Settings, numerics, say
from mlsanm_cli.cli.text import as_json, pretty


def of_app(function: str, threads: int = 1) -> Callable[..., Any]:
    """A function of ``mlsanm_cli.app``, named by module and name, imported with this number of threads: after
    the console is open, as that takes a second or more."""
    module, _, name = function.rpartition(".")
    with numerics(threads):
        loaded: Callable[..., Any] = getattr(importlib.import_module(f"mlsanm_cli.app.{module}"), name)
    return loaded


def console_for(settings: Settings, doing: str = "starting") -> TerminalConsole:
    """The console for progress messages on stderr; a terminal shows ``doing`` until the first of them.

    Opened before the numerical modules are imported, which takes a second or more.
    """
    console = TerminalConsole(sys.stderr, settings)
    console.begin(doing)
    return console


def print_result(settings: Settings, result: Mapping[str, Any], text: str) -> None:
    """Prints the result on stdout: as JSON, as text, or not at all with ``quiet``."""
    if settings.json:
        say(settings, as_json(result))
    elif not settings.quiet:
        say(settings, text)


def pretty_result(settings: Settings, result: Mapping[str, Any]) -> str:
    """The result as tables that fit the width of the terminal."""
    width = shutil.get_terminal_size((100, 24)).columns
    return pretty(result, color=settings.paints(sys.stdout), width=width)
