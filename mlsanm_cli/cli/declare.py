"""Declaration of commands: arguments and options, and what the shell completes, nothing from faulty files."""

from __future__ import annotations

import math
import os
import tomllib
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, TypeVar

import click

from mlsanm_cli.cli.console import Settings
from mlsanm_cli.inputs import is_text

Function = TypeVar("Function", bound=Callable[..., Any])


class File(click.Path):
    """A path that is UTF-8 text, as results name files; ``-`` is the standard input if ``read_once``."""

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


def completed(candidates: Callable[[click.Context], Iterable[Any]]) -> dict[str, Any]:
    """The setting of a parameter that the shell completes by the texts among ``candidates``."""

    def complete(context: click.Context, parameter: click.Parameter, incomplete: str) -> list[str]:
        known = dict.fromkeys(candidates(context))
        return [one for one in known if isinstance(one, str) and one.startswith(incomplete)]

    return {"shell_complete": complete}


def keys_of_case(context: click.Context) -> Iterator[str]:
    """Keys as for ``--set`` and ``--vary``, with the names in the case given to the command, or ``*``."""
    (case, *_) = (*_contents(context, ("case",)), {})
    for key in plain_keys(context):
        table, dot, rest = key.partition(".")
        named = table in ("body", "material", "load", "contact", "probe") and dot
        names = (*_names(case, (table,)), "*")
        yield from (f"{table}.{name}.{rest}=" for name in names) if named else (f"{key}=",)


def plain_keys(context: click.Context) -> list[str]:
    from mlsanm_cli.case.explain import value_keys

    return value_keys()


def kinds(context: click.Context) -> Iterable[str]:
    from mlsanm_cli.case.starters import kinds as known

    return known()


def _names(case: Mapping[str, Any], tables: Sequence[str]) -> Iterator[str]:
    """Names of items of tables, and boundaries of supports."""
    for items in map(case.get, tables):
        listed = items if isinstance(items, list | dict) else []
        for one in listed:
            name = one.get("name", one.get("boundary")) if isinstance(one, dict) else one
            if isinstance(name, str) and isinstance(one, dict) == isinstance(items, list):
                yield name


def _contents(
    context: click.Context, parameters: Sequence[str], below: str = ""
) -> Iterator[Mapping[str, Any]]:
    """The content of the TOML files given so far, or of those ``below`` the directories given; if the value
    of an option is missing, click keeps them in ``args``. Files that cannot be read are empty."""
    given = next(filter(None, (context.params.get(name) for name in parameters)), None)
    places = [name for name in context.args if not name.startswith("-")] if given is None else given
    for place in places if isinstance(places, list | tuple) else [places]:
        try:
            yield tomllib.loads((Path(place) / below).read_text(encoding="utf-8"))
        except (OSError, ValueError):
            yield {}


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

    def names(context: click.Context) -> Iterator[str]:
        for case in _contents(context, ("rundirs", "rundir"), "resolved.toml"):
            yield from _names(case, tables)

    return option(f"--{name}", text, metavar="NAME", **completed(names))


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
KEYS: dict[str, Any] = {"multiple": True, **completed(keys_of_case)}
_SET_HELP = "Change a key of the case, as in --set solver.order=15. Repeatable."
SET = option("--set overrides", _SET_HELP, metavar="KEY=VALUE", **KEYS)
THREADS = count("--threads", "Number of threads.")
MAX_WALL = option(
    "--max-wall",
    "Stop after this wall-clock time, with exit code 75; `mlsanm resume` continues.",
    # About thirty years, a time that timers accept on all systems.
    type=Seconds(min=0.0, min_open=True, max=1e9),
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
