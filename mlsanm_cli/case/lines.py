"""The line of each key in a TOML text.

``tomllib`` returns values without positions. This scanner reads the same text again and records positions
only; it relies on ``tomllib`` having accepted the text.
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field

KeyPath = tuple[str | int, ...]

MAX_KEY_PARTS = 40
"""Largest number of parts of a dotted key; longer ones get the line of their first parts."""

_BLANK = re.compile(r"(?:[ \t\r\n]|#[^\n]*)*")
_SPACE = re.compile(r"[ \t]*")
_BARE_KEY = re.compile(r"[A-Za-z0-9_-]+")
_SCALAR = re.compile(r"[^,\]}#\n]*")
# Tried in this order: triple quotes before single ones.
_STRINGS = (
    re.compile(r'"""(?:[^"\\]|\\.|"{1,2}(?!"))*?"{3,5}', re.DOTALL),
    re.compile(r"'''.*?'''(?:'{0,2})", re.DOTALL),
    re.compile(r'"(?:[^"\\\n]|\\.)*"'),
    re.compile(r"'[^'\n]*'"),
)


@dataclass
class _Scanner:
    text: str
    at: int = 0
    lines: dict[KeyPath, int] = field(default_factory=dict)
    counts: dict[KeyPath, int] = field(default_factory=dict)
    line: int = 1
    counted: int = 0

    def here(self) -> int:
        """Line of the current position; positions only increase, so the count continues from the last one."""
        self.line += self.text.count("\n", self.counted, self.at)
        self.counted = self.at
        return self.line

    def skip(self, pattern: re.Pattern[str]) -> None:
        found = pattern.match(self.text, self.at)
        if found is not None:
            self.at = found.end()

    def peek(self, text: str) -> bool:
        return self.text.startswith(text, self.at)

    def string(self) -> str | None:
        """The string literal at the current position with its quotes, None if there is none."""
        for pattern in _STRINGS:
            found = pattern.match(self.text, self.at)
            if found is not None:
                self.at = found.end()
                return found.group()
        return None

    def key(self) -> list[str]:
        """A dotted key, up to the character that ends it."""
        parts: list[str] = []
        while True:
            self.skip(_SPACE)
            quoted = self.string()
            if quoted is not None:
                parts.append(_unquote(quoted))
            else:
                bare = _BARE_KEY.match(self.text, self.at)
                parts.append(bare.group() if bare else "")
                self.skip(_BARE_KEY)
            self.skip(_SPACE)
            if not self.peek("."):
                return parts
            self.at += 1

    def note(self, path: KeyPath, line: int) -> None:
        for length in range(1, min(len(path), MAX_KEY_PARTS) + 1):
            self.lines.setdefault(path[:length], line)

    def header(self) -> KeyPath:
        """``[table]`` or ``[[list of tables]]``: the path that the keys below it belong to."""
        line = self.here()
        is_list = self.peek("[[")
        self.at += 2 if is_list else 1
        *parents, last = self.key()
        self.at += 2 if is_list else 1
        path: KeyPath = ()
        for part in parents:
            path = self.inside(path, part)
        if is_list:
            path = (*path, last)
            index = self.counts.get(path, 0)
            self.counts[path] = index + 1
            path = (*path, index)
        else:
            path = self.inside(path, last)
        self.note(path, line)
        # Missing keys are reported at the header, even if a dotted key or a sub-table came first.
        self.lines[path] = line
        return path

    def inside(self, path: KeyPath, part: str) -> KeyPath:
        """The table ``part`` below ``path``; of a list of tables the latest item."""
        path = (*path, part)
        count = self.counts.get(path)
        return path if count is None else (*path, count - 1)

    def pair(self, table: KeyPath) -> None:
        line = self.here()
        path = (*table, *self.key())
        self.note(path, line)
        self.at += 1  # the sign "="
        self.skip(_SPACE)
        self.value(path)

    def value(self, path: KeyPath) -> None:
        if self.peek("["):
            for index in self.items("]"):
                item = (*path, index)
                self.note(item, self.here())
                self.value(item)
        elif self.peek("{"):
            for _ in self.items("}"):
                self.pair(path)
        elif self.string() is None:
            self.skip(_SCALAR)

    def items(self, end: str) -> Iterator[int]:
        """Stops at each item of an array or inline table; the caller reads it."""
        self.at += 1
        index = 0
        while True:
            self.skip(_BLANK)
            if self.peek(",") and index:
                self.at += 1
                self.skip(_BLANK)
            if self.peek(end) or self.at >= len(self.text):
                self.at += 1
                return
            yield index
            index += 1

    def scan(self) -> dict[KeyPath, int]:
        table: KeyPath = ()
        self.skip(_BLANK)
        while self.at < len(self.text):
            before = self.at
            if self.peek("["):
                table = self.header()
            else:
                self.pair(table)
            self.skip(_BLANK)
            if self.at == before:
                break
        return self.lines


def _unquote(quoted: str) -> str:
    if quoted.startswith("'"):
        return quoted[1:-1]
    # TOML's basic strings are JSON's, except for the eight-digit escape and, in later versions, \e and \x.
    plain = re.sub(r"\\U([0-9A-Fa-f]{8})", lambda found: chr(int(found.group(1), 16)), quoted)
    try:
        return str(json.loads(plain, strict=False))
    except ValueError:
        return quoted[1:-1]


def key_lines(text: str) -> dict[KeyPath, int]:
    """Line (from 1) of every key, table header and list item of a valid TOML text.

    List items are addressed by index. An implicit table gets the line of the key that implies it.

    >>> key_lines('title = "t"\\n[[body]]\\nx = [0,\\n 1]')[("body", 0, "x", 1)]
    4
    """
    return _Scanner(text.replace("\r\n", "\n")).scan()


def line_of(lines: Mapping[KeyPath, int], path: KeyPath) -> int:
    """Line of the path or of the innermost enclosing table in the file; 0 if there is none."""
    for length in range(len(path), 0, -1):
        line = lines.get(path[:length])
        if line is not None:
            return line
    return 0
