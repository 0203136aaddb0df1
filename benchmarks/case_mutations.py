"""Published cases made quick, and broken as typing, pasting and generating files can break them.

A case is changed either as text (lines deleted, swapped, cut) or as tables (numbers, types, keys, items), by
a generator with a seed; the same seed breaks it in the same way.
"""

from __future__ import annotations

import copy
import random
import tomllib
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import tomli_w

ROOT = Path(__file__).parents[1]
PUBLISHED = sorted(
    path for folder in ("cases", "mlsanm_cli/case/starters") for path in (ROOT / folder).glob("*.toml")
)
ACROSS, NEAR, ALONG = 8.0, 6.0, 1.5
"""Nodes across the smaller side of a body, about; by how much refinements around points and along boundaries
are finer."""
NUMBERS = (0, 0.0, -0.0, 1, -1, 2, 3, 0.5, 1.5, 1e-9, 1e9, 1e-300, 1e300, 5e-324, 2**31, 2**63, -(2**63) - 1)
NOT_FINITE = (float("nan"), float("inf"), -float("inf"))
FACTORS = (-1.0, 0.1, 0.5, 0.9, 1.1, 2.0, 10.0, 100.0, 1e-3, 1e6, -1e6)
WORDS = (
    *(
        "auto",
        "",
        " ",
        "exact",
        "anm",
        "top",
        "x",
        "0",
        "../../etc/passwd",
        "/dev/zero",
        "ä",
        "\0",
        "a\nb",
        "_",
    ),
)
EXPRESSIONS = (
    *("x", "-200*y", "sin(x)**2", "1/x", "x.real", "9**9**9", "y if x > 0 else -y", "x +", "log(-1)", "nan"),
)
ODD: tuple[Any, ...] = (True, False, [], {}, [[]], [{}], [1, 2], [1.0, 2.0, 3.0], {"kind": "disk"}, "text")
LETTERS = "[]{}=\"'.,#\n-09eE_x\t\x00é"
LINES = (
    "[mls]", "[solver]", "[adapt]", "[output]", "[[stage]]", "[[probe]]", "[[body]]", "[reference]",
    "[body.shape]", "[contact.regularization]", "friction = 0.4", "degree = 3", "passes = 1", "order = 5",
    'law = "exact"', 'law = "hyperbolic"', 'method = "newton"', "= 1", "[",
    'scheme = "collocation"', "at = [0.5]", "neighbors = 20",
    'formulation = "monolithic"', "press = 0.5", "reach = 0.1", "interference = 0.01", "x = 1",
    "spring = [1e3, 1e3]", 'rotation = "free"', "spacing = 0.3",
)  # fmt: skip
OPTIONS = """
mls.degree = 1 2 3 4 5 6 | mls.scheme = "collocation" | mls.neighbors = 3 9 20 60 | adapt.passes = 1 2
solver.method = "anm" "newton" "active-set" | solver.formulation = "monolithic" | solver.order = 2 10 40
solver.tolerance = 1e-16 1e-10 1e-5 0.1 | solver.pade = false | solver.increments = 1 3 5
solver.max_steps = 1 2 5 | solver.linear = "superlu" | output.at = [0.2,0.5,0.9] | output.fields = []
output.vtu = false | model.plane = "strain" "stress" | contact.friction = 0.0 0.1 0.6 3.0
contact.regularization = {law="hyperbolic"} {law="exact"} {stick=1e-2} {eta=1e-2}
"""
"""Sound options of the method, which the rest of a case may not go with."""

Table = dict[str, Any]
Place = tuple[Any, Any]
Change = Callable[[Table, random.Random], None]


def quick(content: Table) -> Table:
    """The case with spacings so coarse that a run takes a fraction of a second."""
    content = copy.deepcopy(content)
    content.pop("adapt", None)
    for body in content["body"]:
        if "spacing" not in body:
            continue
        even = _smaller_side(body["shape"]) / ACROSS
        body["spacing"] = float(f"{even:.2g}")
        for refine in body.get("refine", []):
            refine["spacing"] = float(f"{even / (NEAR if 'at' in refine else ALONG):.2g}")
            refine["growth"] = 0.3
        # Of the refinements of edges, which published cases need, one is enough here.
        del body.get("refine", [])[1:]
    return content


def _smaller_side(shape: Table) -> float:
    if shape["kind"] == "rectangle":
        return float(min(high - low for low, high in (shape["x"], shape["y"])))
    if "radii" in shape:
        # Thin rings need some nodes across, wide ones would have thousands around.
        inner, outer = shape["radii"]
        return float(max(2.0 * (outer - inner) / 3.0, 0.3 * outer))
    if "radius" in shape:
        return float(shape["radius"])
    x, y = zip(*shape["points"], strict=True)
    return float(min(max(x) - min(x), max(y) - min(y)))


def published() -> dict[str, Table]:
    """All published cases and starters, made quick, by name."""
    return {f"{path.parent.name}/{path.stem}": quick(tomllib.loads(path.read_text())) for path in PUBLISHED}


def mutated(case: Table, chance: random.Random) -> str:
    """A case file's text with one change or a few."""
    content = copy.deepcopy(case)
    texts = 0
    for _ in range(chance.choice((1, 1, 1, 2, 3))):
        if chance.random() < 0.3:
            texts += 1
        else:
            chance.choice(TABLE_CHANGES)(content, chance)
    text = tomli_w.dumps(content)
    for _ in range(texts):
        text = _retyped(text, chance)
    return text


def _retyped(text: str, chance: random.Random) -> str:
    """A line deleted, repeated, swapped or inserted, a letter changed, or the rest cut off."""
    lines = text.splitlines()
    one, other = chance.randrange(len(lines)), chance.randrange(len(lines))
    how = chance.choice(("delete", "repeat", "swap", "insert", "letter", "cut"))
    if how == "delete":
        del lines[one]
    elif how == "swap":
        lines[one], lines[other] = lines[other], lines[one]
    elif how in ("repeat", "insert"):
        lines.insert(one, lines[other] if how == "repeat" else chance.choice(LINES))
    else:
        place = chance.randrange(1, len(text))
        rest = chance.choice(LETTERS) + text[place + chance.randrange(2) :] if how == "letter" else ""
        return text[:place] + rest
    return "\n".join(lines)


def _places(value: Any, keep: Callable[[Any], bool]) -> list[Place]:
    """Every (container, key) of a value that ``keep`` accepts, at any depth."""
    keys = list(value) if isinstance(value, dict) else range(len(value)) if isinstance(value, list) else ()
    found = [(value, key) for key in keys if keep(value[key])]
    return found + [place for key in keys for place in _places(value[key], keep)]


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def _pick(content: Table, chance: random.Random, *kinds: type) -> Place:
    """A place with a value of one of some kinds, or any."""
    places = _places(content, lambda value: isinstance(value, kinds or object))
    return chance.choice(places or [(content, next(iter(content), "format"))])


def _changed(content: Table, chance: random.Random, how: str) -> None:
    """Another number, text or type at a place, or the place removed, repeated or misspelt."""
    kind = {"text": (str,), "repeat": (list,)}.get(how, ())
    numbers = _places(content, _is_number) or [({"x": 1}, "x")]
    box, key = chance.choice(numbers) if how == "number" else _pick(content, chance, *kind)
    value = box.get(key) if isinstance(box, dict) else box[key]
    if how == "number" and chance.random() < 0.75:
        box[key] *= chance.choice(FACTORS)
    elif how == "number":
        box[key] = chance.choice(NOT_FINITE if chance.random() < 0.15 else NUMBERS)
    elif how == "text":
        others = [b[k] for b, k in _places(content, lambda value: isinstance(value, str))]
        box[key] = chance.choice(others or ["x"]) if chance.random() < 0.6 else chance.choice(WORDS)
    elif how == "type":
        box[key] = copy.deepcopy(chance.choice([*ODD, str(value), [value], {"x": value}]))
    elif how == "remove":
        box.pop(key, None) if isinstance(box, dict) else box.pop(key)
    elif how == "repeat" and isinstance(value, list) and value:
        value.append(copy.deepcopy(chance.choice(value)))
        if chance.random() < 0.3:
            chance.shuffle(value)
    elif how == "misspell" and isinstance(box, dict) and key in box and len(key) > 1:
        place = chance.randrange(len(key) - 1)
        box[key[:place] + key[place + 1] + key[place] + key[place + 2 :]] = box.pop(key)


def _move(content: Table, chance: random.Random) -> None:
    """A value, or all values of a table, also where they do not belong."""
    box, key = _pick(content, chance)
    target, name = _pick(content, chance, dict)
    table = target.get(name) if isinstance(target, dict) else target[name]
    if isinstance(box, dict) and key in box and isinstance(table, dict):
        value = copy.deepcopy(box[key])
        table |= value if isinstance(value, dict) and chance.random() < 0.5 else {key: value}


def _swap(content: Table, chance: random.Random) -> None:
    one, first = _pick(content, chance)
    other, second = _pick(content, chance, str, int, float, list)
    if isinstance(other, list) or second in other:
        one[first] = copy.deepcopy(other[second])


def _express(content: Table, chance: random.Random) -> None:
    places = _places(content.get("load"), _is_number)
    if places:
        box, key = chance.choice(places)
        box[key] = chance.choice(EXPRESSIONS)


def _option(content: Table, chance: random.Random) -> None:
    option = chance.choice([part for line in OPTIONS.strip().splitlines() for part in line.split(" | ")])
    path, _, values = option.partition(" = ")
    section, key = path.split(".")
    table = content.setdefault(section, {})
    table = chance.choice(table) if isinstance(table, list) and table else table
    if isinstance(table, dict):
        table[key] = tomllib.loads(f"x = {chance.choice(values.split())}")["x"]


_number, _text, _type, _remove, _repeat, _misspell = (
    partial(_changed, how=how) for how in ("number", "text", "type", "remove", "repeat", "misspell")
)
TABLE_CHANGES: tuple[Change, ...] = (
    *(_number, _number, _number, _number, _text, _type, _remove, _repeat, _misspell, _move, _move),
    *(_swap, _express, _option, _option, _option),
)
