"""Declaration of commands: their arguments and options, each once."""

from __future__ import annotations

import math
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

import click

from mlsanm_cli.cli import completion
from mlsanm_cli.cli.settings import Settings
from mlsanm_cli.inputs import is_text

Function = TypeVar("Function", bound=Callable[..., Any])

MAX_WALL_SECONDS = 1e9
"""About thirty years, a time that timers accept on all systems."""


class File(click.Path):
    """A path that is valid text, as results contain file names; ``-``, the standard input, if it is
    ``read_once``."""

    def __init__(self, read_once: bool = True) -> None:
        super().__init__(path_type=Path)
        self._read_once = read_once

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """The path; usage error for bytes that are not UTF-8, and for the standard input of several reads."""
        path = super().convert(value, param, ctx)
        if not is_text(Path(os.fsdecode(path))):
            self.fail(f"the name {str(path)!r} is not UTF-8 text; rename it", param, ctx)
        if str(value) == "-" and not self._read_once:
            self.fail("the case is read several times: write it to a file", param, ctx)
        return path


class Seconds(click.FloatRange):
    """A duration within the limit of timers."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """The seconds; usage error for nan, which FloatRange accepts."""
        seconds = super().convert(value, param, ctx)
        if math.isnan(seconds):
            self.fail("nan is not a duration", param, ctx)
        return seconds


FILE = File()


def _store(context: click.Context, parameter: click.Parameter, value: Any) -> None:
    if parameter.name is not None:
        setattr(context.ensure_object(Settings), parameter.name, value)


def _common_option(*names: str, **settings: Any) -> Callable[[Function], Function]:
    # Eager options are read first, and so apply to errors in other options too.
    return click.option(*names, is_eager=True, expose_value=False, callback=_store, **settings)


Decorator = Callable[[Function], Function]
COMMON: tuple[Decorator[Any], ...] = (
    _common_option("--quiet", "-q", is_flag=True, help="Show warnings and errors only."),
    _common_option("--json", is_flag=True, help="Print the result as JSON on stdout."),
    _common_option(
        "--color",
        type=click.Choice(["auto", "always", "never"]),
        default="auto",
        help="Colours; auto depends on the terminal and NO_COLOR.",
    ),
    _common_option("--debug", is_flag=True, help="Show tracebacks of errors."),
)
"""The options of every command, stored in the settings."""
CASE = click.argument("case", type=File(read_once=False))
CASE_OR_STDIN = click.argument("case", type=FILE)
RUNDIR = click.argument("rundir", type=FILE)
RUNDIRS = click.argument("rundirs", metavar="RUNDIR...", type=FILE, nargs=-1, required=True)
SET = click.option(
    "--set",
    "overrides",
    metavar="KEY=VALUE",
    multiple=True,
    shell_complete=completion.keys,
    help="Change a key of the case, as in --set solver.order=15. Repeatable.",
)
THREADS = click.option(
    "--threads", type=click.IntRange(min=1), default=1, show_default=True, help="Number of threads."
)
MAX_WALL = click.option(
    "--max-wall",
    type=Seconds(min=0.0, min_open=True, max=MAX_WALL_SECONDS),
    metavar="SECONDS",
    help="Stop after this wall-clock time, with exit code 75; `mlsanm resume` continues.",
)


def flag(name: str, text: str) -> Decorator[Any]:
    """An option without a value."""
    return click.option(f"--{name}", is_flag=True, help=text)


def file_option(*names: str, help: str) -> Decorator[Any]:  # noqa: A002
    """An option whose value is a file or directory."""
    return click.option(*names, type=FILE, help=help)


def output(text: str) -> Decorator[Any]:
    """The option of an output file."""
    return file_option("-o", "--output", "out", help=text)


def positions(text: str) -> Decorator[Any]:
    """The option of positions on the load path."""
    return click.option("--at", type=float, multiple=True, help=text)


def name_option(name: str, text: str, *tables: str) -> Decorator[Any]:
    """An option whose value is the name of an item of these tables of the case of a run."""
    return click.option(f"--{name}", metavar="NAME", shell_complete=completion.names(*tables), help=text)


def command(*declared: Decorator[Any]) -> Callable[[Callable[..., int]], click.Command]:
    """Makes a command of a function of the settings and the values declared; it returns the exit code."""

    def decorate(function: Callable[..., int]) -> click.Command:
        made = click.pass_obj(function)
        for decorator in reversed((*declared, *COMMON)):
            made = decorator(made)
        return click.command()(made)

    return decorate
