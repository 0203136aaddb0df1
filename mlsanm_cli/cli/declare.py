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
Decorator = Callable[[Function], Function]


def option(names: str, text: str, **settings: Any) -> Decorator[Any]:
    """An option with these names, separated by spaces, and its help."""
    return click.option(*names.split(), help=text, **settings)


def flag(name: str, text: str) -> Decorator[Any]:
    return option(f"--{name}", text, is_flag=True)


def count(names: str, text: str, default: int | None = 1) -> Decorator[Any]:
    """An option whose value is a number from 1 on."""
    shown = default is not None
    return option(names, text, type=click.IntRange(min=1), default=default, show_default=shown)


def file_option(names: str, text: str) -> Decorator[Any]:
    return option(names, text, type=FILE)


def output(text: str) -> Decorator[Any]:
    return file_option("-o --output out", text)


def positions(text: str) -> Decorator[Any]:
    return option("--at", text, type=float, multiple=True)


def name_option(name: str, text: str, *tables: str) -> Decorator[Any]:
    """An option whose value is the name of an item of these tables of the case of a run."""
    return option(f"--{name}", text, metavar="NAME", shell_complete=completion.names(*tables))


def _common(names: str, text: str, **settings: Any) -> Decorator[Any]:
    """An option that is stored in the settings."""

    def store(context: click.Context, parameter: click.Parameter, value: Any) -> None:
        setattr(context.ensure_object(Settings), str(parameter.name), value)

    # Eager options are read first, and so apply to errors in other options too.
    return option(names, text, is_eager=True, expose_value=False, callback=store, **settings)


COLORS = click.Choice(["auto", "always", "never"])
COMMON: tuple[Decorator[Any], ...] = (
    _common("--quiet -q", "Show warnings and errors only.", is_flag=True),
    _common("--json", "Print the result as JSON on stdout.", is_flag=True),
    _common("--color", "Colours; auto depends on the terminal and NO_COLOR.", type=COLORS, default="auto"),
    _common("--debug", "Show tracebacks of errors.", is_flag=True),
)
"""The options of every command."""
CASE = click.argument("case", type=File(read_once=False))
CASE_OR_STDIN = click.argument("case", type=FILE)
RUNDIR = click.argument("rundir", type=FILE)
RUNDIRS = click.argument("rundirs", metavar="RUNDIR...", type=FILE, nargs=-1, required=True)
KEYS: dict[str, Any] = {"multiple": True, "shell_complete": completion.keys}
_SET_HELP = "Change a key of the case, as in --set solver.order=15. Repeatable."
SET = option("--set overrides", _SET_HELP, metavar="KEY=VALUE", **KEYS)
THREADS = count("--threads", "Number of threads.")
MAX_WALL = option(
    "--max-wall",
    "Stop after this wall-clock time, with exit code 75; `mlsanm resume` continues.",
    type=Seconds(min=0.0, min_open=True, max=MAX_WALL_SECONDS),
    metavar="SECONDS",
)


def command(*declared: Decorator[Any]) -> Callable[[Callable[..., int]], click.Command]:
    """Makes a command of a function of the settings and the values declared; it returns the exit code."""

    def decorate(function: Callable[..., int]) -> click.Command:
        made = click.pass_obj(function)
        for decorator in reversed((*declared, *COMMON)):
            made = decorator(made)
        return click.command()(made)

    return decorate
