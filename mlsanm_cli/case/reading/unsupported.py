"""What the case file format knows but this version cannot do: refused by name, never ignored.

Whoever brings a feature deletes its line from `PLANNED`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from mlsanm_cli.case.lines import KeyPath

Applies = Callable[[Any], bool]


@dataclass(frozen=True)
class Planned:
    """A key, or some values of it, that later versions will bring.

    ``path`` may hold ``"*"`` for any name or index; ``part`` keys (counted from the front) of a match
    form the table that is not judged further, because it would only look wrong in other ways too.
    """

    path: tuple[str, ...]
    what: str
    applies: Applies = lambda value: True
    part: int = 0
    hint: str = ""


def _nonzero(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and value != 0


_MOVING = "a support that moves its boundary"
_MOVE = 'a support holds at 0.0; use a load of kind "displacement" to move a boundary'

PLANNED: tuple[Planned, ...] = (
    Planned(("support", "*", "ux"), _MOVING, _nonzero, hint=_MOVE),
    Planned(("support", "*", "uy"), _MOVING, _nonzero, hint=_MOVE),
)


@dataclass(frozen=True)
class Refusal:
    """A planned key found in a case; nothing at or below ``covers`` needs another message."""

    path: KeyPath
    message: str
    hint: str
    covers: KeyPath


def refusals(data: Mapping[str, Any]) -> Iterator[Refusal]:
    """Every planned key or value in the raw content of a case file."""
    for planned in PLANNED:
        for path, value in _matches(data, planned.path, ()):
            if planned.applies(value):
                covers = path[: planned.part] if planned.part else path
                message = f"{planned.what.format(value)} is not supported yet"
                yield Refusal(path, message, planned.hint, covers)


def _matches(value: Any, pattern: tuple[str, ...], path: KeyPath) -> Iterator[tuple[KeyPath, Any]]:
    if not pattern:
        yield path, value
        return
    head, rest = pattern[0], pattern[1:]
    if isinstance(value, Mapping):
        for key in value if head == "*" else [head] if head in value else []:
            yield from _matches(value[key], rest, (*path, key))
    elif isinstance(value, tuple) and head == "*":
        for index, item in enumerate(value):
            yield from _matches(item, rest, (*path, index))
