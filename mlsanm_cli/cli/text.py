"""Tables and numbers as text."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from typing import Any

from mlsanm_cli.toml import plain

MAX_LINE_LENGTH = 2000
BOLD, RED, YELLOW, DIM = "1", "31", "33", "2"


def paint(text: str, code: str, color: bool) -> str:
    return f"\x1b[{code}m{text}\x1b[0m" if color and text else text


def printable(text: str) -> str:
    r"""The text with control characters escaped and very long lines shortened.

    >>> printable("a\x1b[2Jb")
    'a\\x1b[2Jb'
    """
    return "\n".join(_line(line) for line in text.split("\n"))


def _line(line: str) -> str:
    if len(line) > MAX_LINE_LENGTH:
        line = f"{line[: MAX_LINE_LENGTH // 2]} [...] {line[-MAX_LINE_LENGTH // 2 :]}"
    if line.isprintable():
        return line
    return "".join(c if c.isprintable() or c == "\t" else ascii(c)[1:-1] for c in line)


def as_json(value: Any) -> str:
    return json.dumps(plain(value), indent=2, allow_nan=False)


def number(value: Any) -> str:
    """A value as a cell of a table.

    >>> number(0.000123456789), number([0.0, -350.0]), number(True), number(None)
    ('0.000123457', '0, -350', 'yes', '-')
    """
    value = plain(value)
    if value is None:
        return "-"
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, float):
        return f"{value:.6g}"
    if isinstance(value, list):
        return ", ".join(number(item) for item in value) or "none"
    return printable(str(value))


LABELS = {
    "finest": "finest spacing",
    "closest": "separation distance, in spacings",
    "hole": "fill distance, in spacings",
    "growth": "growth of spacing",
    "stencils_enlarged": "enlarged stencils",
    "worst_ratio": "conditioning of stencils",
    "git": "commit",
    "argv": "command",
}
"""Headings of keys whose names are too short."""


def label(key: str) -> str:
    """A key as a heading: ``peak_pressure`` as ``peak pressure``."""
    words = LABELS.get(key) or key.replace("_", " ")
    return words.replace(" cpu ", " CPU ").removesuffix(" mb") + (" in MB" if words.endswith(" mb") else "")


def table(title: str, rows: Sequence[tuple[str, str]], color: bool = False) -> str:
    """Two aligned columns with a title."""
    width = max((len(name) for name, _ in rows), default=0)
    lines = [paint(title, BOLD, color)] if title else []
    lines += [f"  {name:<{width}}  {value}".rstrip() for name, value in rows]
    return "\n".join(lines)


def grid(title: str, columns: Sequence[str], rows: Sequence[Sequence[str]], color: bool = False) -> str:
    """A table with a heading per column; the first column is left-aligned, the others right-aligned."""
    widths = [max(map(len, cells)) for cells in zip(columns, *rows, strict=True)]
    lines = []
    for row in (columns, *rows):
        _, *others = (cell.rjust(width) for cell, width in zip(row, widths, strict=True))
        lines.append("  " + "  ".join([row[0].ljust(widths[0]), *others]).rstrip())
    heading = [paint(title, BOLD, color)] if title else []
    return "\n".join([*heading, paint(lines[0], DIM, color), *lines[1:]])


def pretty(mapping: Mapping[str, Any], title: str = "", color: bool = False, width: int = 100) -> str:
    """A nested mapping as tables: values as rows, similar mappings as columns."""
    if mapping and title and all(isinstance(value, dict) for value in mapping.values()):
        return _items(title, mapping, color, width)
    flat: list[tuple[str, str]] = []
    blocks: list[str] = []
    for key, value in mapping.items():
        value, heading = plain(value), f"{title} {label(key)}".strip()
        if isinstance(value, list) and any(isinstance(item, str) and " " in item for item in value):
            blocks.append(table(heading, [("-", str(item)) for item in value], color))
        elif isinstance(value, list) and value and all(isinstance(item, dict) for item in value):
            numbered = {str(index): item for index, item in enumerate(value, start=1)}
            blocks.append(_items(heading, numbered, color, width))
        elif not isinstance(value, dict):
            flat.append((label(key), number(value)))
        elif value and all(isinstance(item, dict) for item in value.values()):
            blocks.append(_items(heading, value, color, width))
        elif value:
            blocks.append(pretty(value, heading, color, width))
    first = [table(title, flat, color)] if flat or not blocks else []
    return "\n".join([*first, *blocks])


def _items(title: str, items: Mapping[str, Mapping[str, Any]], color: bool, width: int) -> str:
    """Items with the same keys: one row each if they fit, else one table each."""
    keys = list(dict.fromkeys(key for item in items.values() for key in item))
    simple = not any(isinstance(item.get(key), dict) for item in items.values() for key in keys)
    rows = [[name, *(number(item.get(key)) for key in keys)] for name, item in items.items()]
    columns = ["", *map(label, keys)]
    used = sum(max(len(row[i]) for row in [columns, *rows]) + 2 for i in range(len(columns)))
    if simple and used <= width:
        return grid(title, columns, rows, color)
    return "\n".join(pretty(item, f"{title} {label(name)}", color, width) for name, item in items.items())
