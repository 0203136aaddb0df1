"""Shell completion: keys of the case, kinds of scenes, names in cases and runs. Errors in files are ignored;
nothing is completed then."""

from __future__ import annotations

import tomllib
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import click

NAMED_TABLES = ("body", "material", "load", "contact", "probe")
"""Tables whose items have names, which are part of keys."""
Complete = Callable[[click.Context, click.Parameter, str], list[str]]


def keys(context: click.Context, parameter: click.Parameter, incomplete: str) -> list[str]:
    """Keys as for ``--set`` and ``--vary``, with the names in the case given to the command, or ``*``."""
    from mlsanm_cli.case.explain import value_keys

    (case, *_) = (*_contents(context, ("case",)), {})
    candidates = []
    for key in value_keys():
        table, dot, rest = key.partition(".")
        if table in NAMED_TABLES and dot:
            items = case.get(table)
            known = (
                list(items) if isinstance(items, dict) else [item.get("name") for item in _items(case, table)]
            )
            candidates += [f"{table}.{name}.{rest}=" for name in (*known, "*") if isinstance(name, str)]
        else:
            candidates.append(f"{key}=")
    return [key for key in candidates if key.startswith(incomplete)]


def plain_keys(context: click.Context, parameter: click.Parameter, incomplete: str) -> list[str]:
    from mlsanm_cli.case.explain import value_keys

    return [key for key in value_keys() if key.startswith(incomplete)]


def kinds(context: click.Context, parameter: click.Parameter, incomplete: str) -> list[str]:
    from mlsanm_cli.case.starters import kinds as known

    return [kind for kind in known() if kind.startswith(incomplete)]


def names(*tables: str) -> Complete:
    """A function that completes names of items of tables in the case of a run; for supports, boundaries."""

    def complete(context: click.Context, parameter: click.Parameter, incomplete: str) -> list[str]:
        known: list[Any] = []
        for case in _contents(context, ("rundirs", "rundir"), "resolved.toml"):
            items = [item for table in tables for item in _items(case, table)]
            known += [item.get("name", item.get("boundary")) for item in items]
        return [
            name for name in dict.fromkeys(known) if isinstance(name, str) and name.startswith(incomplete)
        ]

    return complete


def _items(case: Mapping[str, Any], table: str) -> list[dict[str, Any]]:
    """The items of a list of tables that are tables."""
    items = case.get(table)
    return [item for item in items if isinstance(item, dict)] if isinstance(items, list) else []


def _contents(
    context: click.Context, parameters: Sequence[str], below: str = ""
) -> Iterator[Mapping[str, Any]]:
    """The content of the TOML files given to the command so far, or of those in the directories given; if the
    value of an option is missing, click keeps them in ``args``. Files that cannot be read are empty."""
    given = next(filter(None, (context.params.get(name) for name in parameters)), None)
    places = [name for name in context.args if not name.startswith("-")] if given is None else given
    for place in places if isinstance(places, list | tuple) else [places]:
        try:
            yield tomllib.loads((Path(place) / below).read_text(encoding="utf-8"))
        except (OSError, ValueError):
            yield {}
