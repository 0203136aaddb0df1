"""Places of keys in TOML texts, judged by values that carry their own place."""

from __future__ import annotations

import tomllib
from collections.abc import Iterator
from typing import Any

from mlsanm_cli.case.report import KeyPath, key_lines, line_of

NASTY = r'''# [not.a.table] = 1
title = "a # no comment [x] = 1" # [nor.this]
multi = """
[fake]
key = 1 "" quotes \""" and a \
   continued line""""
literal = \'\'\'
[[fake]]
'' two quotes \'\'\'\'\'
dates = 1979-05-27 07:32:00   # with a space
"quoted.key" . 'sub key' . bare-key = 1e5
'back\slash' = 1
"\"\u0041\U00000042" = 2

[ spaced . "table" ]
a.b.c = true
list = [ # comment ] in a list
  1, [2,
  3], { deep = [4,
  5] },
]
inline = { p = 1, q = { r = "}" }, "s t" = ']' }

[[item]]
name = "one"
[item.sub]
k = 1
[[item.part]]
n = 0
[[item.part]]
n = 1
[[item]]
name = "two"
[[item.part]]
n = 2
[item.part.deep]
z = 3
'''.replace("\\'", "'")


def test_nasty_text() -> None:
    tomllib.loads(NASTY)
    lines = key_lines(NASTY)
    rows = NASTY.split("\n")

    def row(path: KeyPath) -> str:
        return rows[lines[path] - 1]

    assert row(("title",)).startswith("title")
    assert row(("multi",)).startswith("multi")
    assert row(("literal",)).startswith("literal")
    assert row(("dates",)).startswith("dates")
    assert row(("quoted.key", "sub key", "bare-key")).startswith('"quoted.key"')
    assert row(("spaced", "table")).startswith("[ spaced")
    assert row(("spaced", "table", "a", "b", "c")).startswith("a.b.c")
    assert row(("spaced", "table", "list", 1, 1)) == "  3], { deep = [4,"
    assert row(("spaced", "table", "list", 2, "deep", 1)) == "  5] },"
    assert row(("spaced", "table", "inline", "q", "r")).startswith("inline")
    assert row(("spaced", "table", "inline", "s t")).startswith("inline")
    assert lines["item", 1] == rows.index('name = "two"')
    assert row(("item", 0, "part", 1, "n")) == "n = 1"
    assert row(("item", 1, "part", 0, "n")) == "n = 2"
    assert row(("item", 1, "part", 0, "deep", "z")) == "z = 3"
    assert row(("back\\slash",)).endswith("= 1")
    assert row(('"AB',)).endswith("= 2")
    assert ("fake",) not in lines
    assert set(lines) >= set(_paths(tomllib.loads(NASTY)))


def _paths(value: Any, path: KeyPath = ()) -> Iterator[KeyPath]:
    if path:
        yield path
    if isinstance(value, dict):
        for key, item in value.items():
            yield from _paths(item, (*path, key))
    elif isinstance(value, list):
        for index, item in enumerate(value):
            yield from _paths(item, (*path, index))


def test_windows_line_ends() -> None:
    lines = key_lines('a = 1\r\nb = """x\r\ny"""\r\n[t]\r\nc = 2\r\n')
    assert (lines["a",], lines["b",], lines["t",], lines["t", "c"]) == (1, 2, 4, 5)


def test_missing_key_gets_the_header_of_its_table() -> None:
    lines = key_lines("\n[[body]]\nname = 'b'\n\n[[body]]\n[body.shape]\nkind = 'x'\n")
    assert line_of(lines, ("body", 1, "spacing")) == 5
    assert line_of(lines, ("body", 1, "shape", "radius")) == 6
    assert line_of(lines, ("model", "plane")) == 0


def test_header_wins_over_the_sub_table_that_came_first() -> None:
    assert key_lines("[a.b]\nx = 1\n[a]\ny = 2\n")["a",] == 3
