"""The line of each key in a TOML text that ``tomllib``, which returns no positions, has accepted."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Iterator, Mapping
from typing import Any

KeyPath = tuple[str | int, ...]

MAX_KEY_PARTS = 40
"""Largest number of parts of a dotted key; longer ones get the line of their first parts."""

# Tried in this order: triple quotes before single ones.
_TEXT = re.compile(
    r'"""(?:[^"\\]|\\.|"{1,2}(?!"))*?"{3,5}'
    r"|'''.*?'''(?:'{0,2})"
    r'|"(?:[^"\\\n]|\\.)*"'
    r"|'[^'\n]*'"
    r"|#[^\n]*",
    re.DOTALL,
)
_TOKEN = re.compile(r"[\[\]{},=\n]|[^\[\]{},=\s]+")


def key_lines(text: str) -> dict[KeyPath, int]:
    """Line (from 1) of every key, table header and list item of a valid TOML text.

    List items are addressed by index. An implicit table gets the line of the key that implies it.

    >>> key_lines('title = "t"\\n[[body]]\\nx = [0,\\n 1]')[("body", 0, "x", 1)]
    4
    """
    text = text.replace("\r\n", "\n") + "\n"
    lines: dict[KeyPath, int] = {}
    counts: dict[KeyPath, int] = {}
    table: KeyPath = ()
    # The key whose value is being read; and the path of each enclosing array, with an index, or inline table.
    key: KeyPath | None = None
    within: list[tuple[KeyPath, int | None]] = []
    line, start, end = 1, 0, 0

    def note(path: KeyPath) -> None:
        for length in range(1, min(len(path), MAX_KEY_PARTS) + 1):
            lines.setdefault(path[:length], line)

    # Texts and comments contain no structure; only their lines count.
    for token in _TOKEN.finditer(_TEXT.sub(_blank, text)):
        sign, at = token.group(), token.start()
        path, index = within[-1] if within else (table, None)
        if sign == "\n":
            line += 1
            if not within:
                key, start = None, token.end()
        elif at < end:
            continue
        elif sign == "[" and not within and key is None:
            end = text.index("\n", at)
            table = _header(text[at:end], counts)
            note(table)
            # Missing keys are reported at the header, even if a dotted key or a sub-table came first.
            lines[table] = line
        elif sign == "=":
            key = (*path, *_names(tomllib.loads(f"{text[start:at]}= 0")))
            note(key)
        elif sign in "]}":
            within.pop()
        elif sign == ",":
            start = token.end()
            if index is not None:
                within[-1] = path, index + 1
        else:
            if index is not None:
                key = (*path, index)
                note(key)
            if sign in "[{" and key is not None:
                within.append((key, 0 if sign == "[" else None))
                start = token.end()
    return lines


def _blank(found: re.Match[str]) -> str:
    """A text in quotes as letters and a comment as spaces, with the same line ends at the same places."""
    return re.sub(r"[^\n]", " " if found.group().startswith("#") else "x", found.group())


def _header(text: str, counts: dict[KeyPath, int]) -> KeyPath:
    """The path of the keys below ``[table]`` or ``[[list of tables]]``, given the numbers of items so far."""
    path: KeyPath = ()
    *parents, last = _names(tomllib.loads(text))
    for name in parents:
        path = (*path, name)
        path = (*path, counts[path] - 1) if path in counts else path
    path = (*path, last)
    if text.startswith("[["):
        counts[path] = counts.get(path, 0) + 1
    return (*path, counts[path] - 1) if path in counts else path


def _names(content: Any) -> Iterator[str]:
    """The names in a dotted key, given the nested tables that it alone defines."""
    while isinstance(content, dict) and content:
        ((name, content),) = content.items()
        yield name


def line_of(lines: Mapping[KeyPath, int], path: KeyPath) -> int:
    """Line of the path or of the innermost enclosing table in the file; 0 if there is none."""
    for length in range(len(path), 0, -1):
        line = lines.get(path[:length])
        if line is not None:
            return line
    return 0
