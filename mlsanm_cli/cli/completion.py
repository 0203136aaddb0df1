"""Shell completion: keys of the case, kinds of scenes, names in cases and runs.

Errors in files are ignored; nothing is completed then.
"""

from __future__ import annotations

import tomllib
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

import click

NAMED_TABLES = ("body", "material", "load", "contact", "probe")
"""Tables whose items have names, which are part of keys."""
Complete = Callable[[click.Context, click.Parameter, str], list[str]]


def keys(context: click.Context, parameter: click.Parameter, incomplete: str) -> list[str]:
    """Keys as for ``--set`` and ``--vary``, with the names in the case given to the command."""
    from mlsanm_cli.case.explain import value_keys

    case = _content(next(iter(_given(context, "case")), None))
    candidates = [f"{name}=" for key in value_keys() for name in _with_names(key, case)]
    return _matching(candidates, incomplete)


def plain_keys(context: click.Context, parameter: click.Parameter, incomplete: str) -> list[str]:
    """Keys as for ``explain``."""
    from mlsanm_cli.case.explain import value_keys

    return _matching(value_keys(), incomplete)


def kinds(context: click.Context, parameter: click.Parameter, incomplete: str) -> list[str]:
    """Kinds of starter cases."""
    from mlsanm_cli.case.starters import kinds as known

    return _matching(list(known()), incomplete)


def names(*tables: str) -> Complete:
    """A function that completes names of items of tables in the case of a run; for supports, boundaries."""

    def complete(context: click.Context, parameter: click.Parameter, incomplete: str) -> list[str]:
        known: list[Any] = []
        for place in _given(context, "rundirs", "rundir"):
            case = _content(place / "resolved.toml")
            for table in tables:
                known += [item.get("name", item.get("boundary")) for item in _items(case, table)]
        return _matching([name for name in dict.fromkeys(known) if isinstance(name, str)], incomplete)

    return complete


def _with_names(key: str, case: Mapping[str, Any]) -> Iterator[str]:
    """A key with the names of the items of a case and with the wildcard."""
    table, dot, rest = key.partition(".")
    if table not in NAMED_TABLES or not dot:
        yield key
        return
    items = case.get(table)
    known = list(items) if isinstance(items, Mapping) else [item.get("name") for item in _items(case, table)]
    for name in [*known, "*"]:
        if isinstance(name, str):
            yield f"{table}.{name}.{rest}"


def _items(case: Mapping[str, Any], table: str) -> list[Mapping[str, Any]]:
    """The items of a list of tables that are tables."""
    items = case.get(table)
    return [item for item in items if isinstance(item, Mapping)] if isinstance(items, list) else []


def _matching(candidates: list[str], incomplete: str) -> list[str]:
    return [name for name in candidates if name.startswith(incomplete)]


def _given(context: click.Context, *names: str) -> list[Path]:
    """The files given to the command so far; if the value of an option is missing, click keeps them in
    ``args``."""
    for name in names:
        given = context.params.get(name)
        if given:
            return [Path(place) for place in (given if isinstance(given, tuple) else (given,))]
    return [Path(place) for place in context.args if not place.startswith("-")]


def _content(path: Any) -> Mapping[str, Any]:
    """The content of a TOML file; empty if it cannot be read."""
    if path is None:
        return {}
    try:
        return tomllib.loads(Path(path).read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return {}
