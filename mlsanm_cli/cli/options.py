"""Options shared by commands, and output of results."""

from __future__ import annotations

import math
import os
import shutil
import sys
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, TypeVar

import click

from mlsanm_cli.cli import completion
from mlsanm_cli.cli.console import TerminalConsole
from mlsanm_cli.cli.settings import Settings, say
from mlsanm_cli.cli.text import as_json, pretty
from mlsanm_cli.inputs import is_text

Function = TypeVar("Function", bound=Callable[..., Any])

MAX_WALL_SECONDS = 1e9
"""About thirty years, a time that timers accept on all systems."""


class File(click.Path):
    """A path that is valid text, as results contain file names."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """The path; usage error for bytes that are not UTF-8."""
        path = super().convert(value, param, ctx)
        if not is_text(Path(os.fsdecode(path))):
            self.fail(f"the name {str(path)!r} is not UTF-8 text; rename it", param, ctx)
        return path


class Seconds(click.FloatRange):
    """A duration within the limit of timers."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """The seconds; usage error for nan, which FloatRange accepts."""
        seconds = super().convert(value, param, ctx)
        if math.isnan(seconds):
            self.fail("nan is not a duration", param, ctx)
        return seconds


FILE = File(path_type=Path)


def _store(context: click.Context, parameter: click.Parameter, value: Any) -> None:
    if parameter.name is not None:
        setattr(context.ensure_object(Settings), parameter.name, value)


def _common_option(*names: str, **settings: Any) -> Callable[[Function], Function]:
    # Eager options are read first, and so apply to errors in other options too.
    return click.option(*names, is_eager=True, expose_value=False, callback=_store, **settings)


def common(function: Function) -> Function:
    """The options of every command, stored in the settings."""
    for decorate in (
        _common_option("--debug", is_flag=True, help="Show tracebacks of errors."),
        _common_option(
            "--color",
            type=click.Choice(["auto", "always", "never"]),
            default="auto",
            help="Colours; auto depends on the terminal and NO_COLOR.",
        ),
        _common_option("--json", is_flag=True, help="Print the result as JSON on stdout."),
        _common_option("--quiet", "-q", is_flag=True, help="Show warnings and errors only."),
    ):
        function = decorate(function)
    return function


threads_option = click.option(
    "--threads", type=click.IntRange(min=1), default=1, show_default=True, help="Number of threads."
)
max_wall_option = click.option(
    "--max-wall",
    type=Seconds(min=0.0, min_open=True, max=MAX_WALL_SECONDS),
    metavar="SECONDS",
    help="Stop after this wall-clock time, with exit code 75; `mlsanm resume` continues.",
)
cache_option = click.option("--cache/--no-cache", hidden=True, expose_value=False)
"""Kept for existing scripts, without effect: operators are not cached on disk."""
set_option = click.option(
    "--set",
    "overrides",
    metavar="KEY=VALUE",
    multiple=True,
    shell_complete=completion.keys,
    help="Change a key of the case, as in --set solver.order=15. Repeatable.",
)


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
