"""Problems of a case, collected with file, line, key and suggestions; the lines of keys in a file; limits on
counts, depths and magnitudes, far beyond any scene, which bound the time of all other checks."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Iterable, Iterator, Mapping
from functools import cached_property
from typing import Any

from mlsanm_cli.errors import CaseError, CaseProblem, Fault

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

    def blank(found: re.Match[str]) -> str:
        """A text in quotes as letters and a comment as spaces, with the same line ends at the same places."""
        return re.sub(r"[^\n]", " " if found[0].startswith("#") else "x", found[0])

    # Texts and comments contain no structure; only their lines count.
    for token in _TOKEN.finditer(_TEXT.sub(blank, text)):
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
    enclosing = (path[:length] for length in range(len(path), 0, -1))
    return next((lines[place] for place in enclosing if place in lines), 0)


_OTHER_NAMES = {
    "E": "young youngs_modulus e_modulus elastic_modulus",
    "nu": "poisson poissons_ratio poisson_ratio",
    "friction": "mu",
    "spacing": "h size mesh_size",
    "kind": "type",
    "max_steps": "steps",
    "tolerance": "tol",
    "support": "bc boundary_condition",
    "platen": "force moment",
}
SYNONYMS = {name: key for key, names in _OTHER_NAMES.items() for name in names.split()}
"""Names used by other codes and textbooks that no comparison of letters would find."""


def nearest(word: object, valid: Iterable[str]) -> str:
    """The valid name most similar to the word, or an empty string.

    >>> nearest("spacign", ["seed", "spacing"])
    'spacing'
    """
    options = {name.lower().replace("-", "_"): name for name in valid}
    wanted = str(word).lower().replace("-", "_")
    synonym = SYNONYMS.get(wanted, "").lower()
    if synonym in options:
        return options[synonym]
    import difflib

    near = difflib.get_close_matches(wanted, options, n=1, cutoff=0.6)
    longer = [name for name in options if wanted and (name.startswith(wanted) or wanted.startswith(name))]
    near = near or (longer if len(longer) == 1 else [])
    return options[near[0]] if near else ""


def suggestion(word: object, valid: Iterable[str], what: str = "valid") -> str:
    """A hint with the most similar valid name, or with all of them."""
    names = list(dict.fromkeys(valid))
    if near := nearest(word, names):
        return f'did you mean "{near}"?'
    return f"{what}: {', '.join(names)}" if names else "none are defined"


def dotted(data: Any, path: KeyPath) -> str:
    """The path in the form of ``--set``: items of lists by name, those without one by index."""
    parts: list[str] = []
    value = data
    for step in path:
        value = child(value, step)
        name = value.get("name") if isinstance(step, int) and isinstance(value, Mapping) else None
        parts.append(name if isinstance(name, str) and name else str(step))
    return ".".join(parts)


def child(value: Any, step: str | int) -> Any:
    """The item of a table or list at a key or index, None if there is none."""
    if isinstance(value, Mapping):
        return value.get(step) if isinstance(step, str) else None
    if isinstance(value, tuple | list) and isinstance(step, int) and 0 <= step < len(value):
        return value[step]
    return None


class Report:
    """Problems found so far in the ``data`` of a case, read from the TOML ``text`` of the file ``source``;
    ``changed`` are the paths set on the command line."""

    def __init__(
        self, data: Mapping[str, Any], text: str, source: str, changed: frozenset[KeyPath] = frozenset()
    ) -> None:
        self.data, self.text, self.source, self.changed = data, text, source, changed
        self._found: dict[tuple[KeyPath, str], CaseProblem] = {}

    @cached_property
    def lines(self) -> Mapping[KeyPath, int]:
        return key_lines(self.text)

    def add(self, faults: Iterable[Fault]) -> None:
        """Adds a problem for each fault, once for the same path and message."""
        for fault in faults:
            path, line, source = fault.key, 0, "--set"
            created = path not in self.lines and any(one[: len(path)] == path for one in self.changed)
            if not created and not any(path[: len(one)] == one for one in self.changed):
                line, source = max(line_of(self.lines, path), 1), self.source
            key = dotted(self.data, path) or "(file)"
            if len(key) > 500:
                key = f"{key[:60]}[...]{key[-60:]}"
            problem = CaseProblem(key, fault.message, line, source, fault.hint)
            self._found.setdefault((path, fault.message), problem)

    def refuse(self, faults: Iterable[Fault]) -> None:
        """Raises CaseError if there are any."""
        self.add(faults)
        if self._found:
            raise CaseError(self.problems)

    @property
    def paths(self) -> frozenset[KeyPath]:
        return frozenset(path for path, _ in self._found)

    @property
    def problems(self) -> tuple[CaseProblem, ...]:
        """All problems in the order of their lines, those of the command line last."""
        return tuple(sorted(self._found.values(), key=lambda p: (p.line == 0, p.line)))


MAX_ITEMS: Mapping[str, int] = {
    **dict.fromkeys(("material", "body", "refine", "holes", "support", "load", "contact"), 500),
    "sides": 2000,
    "points": 2000,
    "obstacle.points": 20_000,
    "probe": 1000,
    "stage": 5000,
    "stop": 100,
    "at": 10_000,
    "table": 100_000,
}
"""Largest number of items by the key of their list or table, or by the last two keys."""
MIN_MAGNITUDE, MAX_MAGNITUDE = 1e-60, 1e60
"""Products of a few numbers of these magnitudes neither overflow nor underflow."""
_PART = r"""(?:[\w-]++|"(?:[^"\\\n]|\\.)*+"|'[^'\n]*+')"""
LONG_KEY = re.compile(rf"""(?<![\w."'-])(?:{_PART}[ \t]*+\.[ \t]*+){{{MAX_KEY_PARTS}}}""")
MAX_TABLES, MAX_KEYS, MAX_VALUES = 20_000, 100_000, 1_000_000
MAX_KEYS_OF_TABLE = 2000
TABLE = re.compile(r"""(?m)^[ \t]*\[\[?[ \t]*[A-Za-z"'_]""")


def text_problem(text: str) -> tuple[int, str]:
    """Line and message for text that would keep the TOML parser busy for minutes; line 0 if there is none."""
    # Each part of a key takes at least two characters.
    for number, line in enumerate(text.split("\n"), start=1):
        if len(line) >= 2 * MAX_KEY_PARTS and LONG_KEY.search(line):
            return number, f"a key of {MAX_KEY_PARTS} or more parts"
    if sum(1 for _ in TABLE.finditer(text)) > MAX_TABLES:
        return 1, f"more than {MAX_TABLES} tables"
    for sign, most, what in (("=", MAX_KEYS, "keys"), (",", MAX_VALUES, "values")):
        if text.count(sign) > most:
            return 1, f"more than {most} {what}"
    return 0, ""


def size_faults(content: Mapping[str, Any]) -> list[Fault]:
    """Lists and tables with too many items, whose content is not examined, and too deep nesting."""
    faults: list[Fault] = []
    waiting: list[tuple[KeyPath, Any]] = [((), content)]
    while waiting:
        path, value = waiting.pop()
        if len(path) > MAX_KEY_PARTS:
            return [Fault(path[:1], f"is nested more than {MAX_KEY_PARTS} levels deep")]
        named, owner, *_ = [step for step in reversed(path) if isinstance(step, str)] + ["", ""]
        counted = isinstance(value, list | tuple) or path == ("material",)
        most = MAX_ITEMS.get(f"{owner}.{named}", MAX_ITEMS.get(named))
        if counted and path[-1:] == (named,) and most is not None and len(value) > most:
            faults.append(Fault(path, f"has {len(value)} items", f"at most {most}"))
        elif isinstance(value, dict) and len(value) > MAX_KEYS_OF_TABLE:
            faults.append(Fault(path, f"has {len(value)} keys", f"at most {MAX_KEYS_OF_TABLE}"))
        else:
            items = [((*path, step), item) for step, item in items_of(value)]
            waiting += [entry for entry in items if isinstance(entry[1], dict | list | tuple)]
    return faults


def number_faults(value: Any, path: KeyPath = ()) -> Iterator[Fault]:
    """Numbers too large or too small for floating-point arithmetic."""
    for step, item in items_of(value):
        if not isinstance(item, int | float):
            yield from number_faults(item, (*path, step))
        elif problem := magnitude_problem(item, coordinate=isinstance(step, int)):
            hint = f"allowed magnitudes: {MIN_MAGNITUDE:g} to {MAX_MAGNITUDE:g}"
            yield Fault((*path, step), problem, hint)


def magnitude_problem(value: int | float, coordinate: bool = True) -> str:
    """What makes a number unfit for floating point, ""; coordinates may be 0 up to round-off."""
    small = 0.0 < abs(value) < MIN_MAGNITUDE and not coordinate
    if not small and not MAX_MAGNITUDE < abs(value) < float("inf"):
        return ""
    shown = f"{value:g}" if isinstance(value, float) else "a number"
    return f"{shown} is too {'small' if small else 'large'} for floating-point arithmetic"


def items_of(value: Any) -> Iterable[tuple[str | int, Any]]:
    """Keys or numbers and items of a table or list."""
    if isinstance(value, dict):
        return value.items()
    return enumerate(value) if isinstance(value, list | tuple) else ()
