"""Published cases made quick, and broken as typing, pasting and generating files can break them.

A case is changed either as text (lines deleted, swapped, cut) or as tables (numbers, types, keys, items), by
a generator with a seed; the same seed breaks it in the same way.
"""

from __future__ import annotations

import copy
import random
import tomllib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import tomli_w

ROOT = Path(__file__).parents[1]
PUBLISHED = sorted(
    path for folder in ("cases", "mlsanm_cli/case/starters") for path in (ROOT / folder).glob("*.toml")
)
ACROSS = 8.0
"""Nodes across the smaller side of a body, about."""
NEAR = 6.0
ALONG = 1.5
"""By so much refinements around points and along boundaries are finer."""
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
LINES = (
    "[mls]", "[solver]", "[adapt]", "[output]", "[[stage]]", "[[probe]]", "[[body]]", "[reference]",
    "[body.shape]", "[contact.regularization]", "friction = 0.4", "degree = 3", "passes = 1", "order = 5",
    'law = "exact"', 'law = "hyperbolic"', 'method = "newton"', "= 1", "[",
    'scheme = "collocation"', "at = [0.5]", "neighbors = 20",
    'formulation = "monolithic"', "press = 0.5", "reach = 0.1", "interference = 0.01", "x = 1",
    "spring = [1e3, 1e3]", 'rotation = "free"', "spacing = 0.3",
)  # fmt: skip

Table = dict[str, Any]
Place = tuple[Any, Any]


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
            near = NEAR if "at" in refine else ALONG
            refine["spacing"] = float(f"{even / near:.2g}")
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
    changes = chance.choice((1, 1, 1, 2, 3))
    texts = 0
    for _ in range(changes):
        if chance.random() < 0.3:
            texts += 1
        else:
            chance.choice(TABLE_CHANGES)(content, chance)
    text = _written(content)
    for _ in range(texts):
        text = chance.choice(TEXT_CHANGES)(text, chance)
    return text


def _written(content: Table) -> str:
    return tomli_w.dumps(content)


def _places(value: Any, keep: Callable[[Any], bool]) -> list[Place]:
    """Every (container, key) of a value that ``keep`` accepts, at any depth."""
    pairs: list[Place] = []
    if isinstance(value, dict):
        pairs = [(value, key) for key in value]
    elif isinstance(value, list):
        pairs = [(value, index) for index in range(len(value))]
    found = [(box, key) for box, key in pairs if keep(box[key])]
    return found + [place for box, key in pairs for place in _places(box[key], keep)]


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def _pick(content: Table, chance: random.Random, keep: Callable[[Any], bool] = lambda _: True) -> Place:
    return chance.choice(_places(content, keep) or [(content, next(iter(content), "format"))])


def _scale_number(content: Table, chance: random.Random) -> None:
    box, key = _pick(content, chance, _is_number)
    if _is_number(box[key]):
        box[key] *= chance.choice(FACTORS)


def _replace_number(content: Table, chance: random.Random) -> None:
    box, key = _pick(content, chance, _is_number)
    box[key] = chance.choice(NOT_FINITE if chance.random() < 0.15 else NUMBERS)


def _replace_text(content: Table, chance: random.Random) -> None:
    box, key = _pick(content, chance, lambda value: isinstance(value, str))
    others = [b[k] for b, k in _places(content, lambda value: isinstance(value, str))]
    box[key] = chance.choice(others or ["x"]) if chance.random() < 0.6 else chance.choice(WORDS)


def _change_type(content: Table, chance: random.Random) -> None:
    box, key = _pick(content, chance)
    value = box[key]
    options = [*ODD, str(value), [value], {"x": value}]
    box[key] = copy.deepcopy(chance.choice(options))


def _remove(content: Table, chance: random.Random) -> None:
    box, key = _pick(content, chance)
    box.pop(key, None) if isinstance(box, dict) else box.pop(key)


def _repeat(content: Table, chance: random.Random) -> None:
    box, key = _pick(content, chance, lambda value: isinstance(value, list) and len(value) > 0)
    if isinstance(box[key], list):
        box[key].append(copy.deepcopy(chance.choice(box[key])))


def _misspell(content: Table, chance: random.Random) -> None:
    box, key = _pick(content, chance)
    if isinstance(box, dict) and key in box and len(key) > 1:
        place = chance.randrange(len(key) - 1)
        box[key[:place] + key[place + 1] + key[place] + key[place + 2 :]] = box.pop(key)


def _move(content: Table, chance: random.Random) -> None:
    box, key = _pick(content, chance)
    target, name = _pick(content, chance, lambda value: isinstance(value, dict))
    if isinstance(box, dict) and key in box and isinstance(target[name], dict):
        target[name][key] = copy.deepcopy(box[key])


def _merge(content: Table, chance: random.Random) -> None:
    one, first = _pick(content, chance, lambda value: isinstance(value, dict))
    other, second = _pick(content, chance, lambda value: isinstance(value, dict))
    if isinstance(one[first], dict) and isinstance(other[second], dict):
        one[first] = {**copy.deepcopy(other[second]), **one[first]}


def _swap(content: Table, chance: random.Random) -> None:
    one, first = _pick(content, chance)
    other, second = _pick(content, chance, lambda value: not isinstance(value, dict | list))
    if isinstance(one, dict) and first not in one:
        return
    one[first] = copy.deepcopy(other[second])


def _shuffle(content: Table, chance: random.Random) -> None:
    box, key = _pick(content, chance, lambda value: isinstance(value, list) and len(value) > 1)
    if isinstance(box[key], list):
        chance.shuffle(box[key])


def _express(content: Table, chance: random.Random) -> None:
    loads = content.get("load")
    if isinstance(loads, list) and loads and isinstance(loads[0], dict):
        box, key = _pick({"load": loads}, chance, _is_number)
        box[key] = chance.choice(EXPRESSIONS)


def _set_option(content: Table, chance: random.Random) -> None:
    """A sound option of the method, which the rest of the case may not go with."""
    section, key, value = chance.choice(
        [
            ("mls", "degree", chance.randint(1, 6)),
            ("mls", "scheme", "collocation"),
            ("mls", "neighbors", chance.randint(3, 60)),
            ("adapt", "passes", chance.randint(1, 2)),
            ("solver", "method", chance.choice(["anm", "newton", "active-set"])),
            ("solver", "formulation", "monolithic"),
            ("solver", "order", chance.randint(2, 40)),
            ("solver", "tolerance", 10.0 ** chance.randint(-16, -1)),
            ("solver", "pade", False),
            ("solver", "increments", chance.randint(1, 5)),
            ("solver", "max_steps", chance.randint(1, 5)),
            ("solver", "linear", "superlu"),
            ("output", "at", sorted(chance.random() for _ in range(3))),
            ("output", "fields", []),
            ("output", "vtu", False),
            ("model", "plane", chance.choice(["strain", "stress"])),
        ]
    )
    if isinstance(content.setdefault(section, {}), dict):
        content[section][key] = value


def _set_contact(content: Table, chance: random.Random) -> None:
    contacts = content.get("contact")
    if isinstance(contacts, list) and contacts and isinstance(contacts[0], dict):
        contact = chance.choice(contacts)
        if chance.random() < 0.5:
            contact["friction"] = chance.choice([0.0, 0.1, 0.6, 3.0])
        else:
            contact["regularization"] = chance.choice(
                [{"law": "hyperbolic"}, {"law": "exact"}, {"stick": 1e-2}, {"eta": 1e-2}]
            )


TABLE_CHANGES: tuple[Callable[[Table, random.Random], None], ...] = (
    *(_scale_number, _scale_number, _scale_number, _replace_number, _replace_text, _change_type, _remove),
    *(_repeat, _misspell, _move, _merge, _swap, _shuffle, _express, _set_option, _set_option, _set_contact),
)


def _delete_line(text: str, chance: random.Random) -> str:
    lines = text.splitlines()
    del lines[chance.randrange(len(lines))]
    return "\n".join(lines)


def _double_line(text: str, chance: random.Random) -> str:
    lines = text.splitlines()
    lines.insert(chance.randrange(len(lines)), chance.choice(lines))
    return "\n".join(lines)


def _swap_lines(text: str, chance: random.Random) -> str:
    lines = text.splitlines()
    one, other = chance.randrange(len(lines)), chance.randrange(len(lines))
    lines[one], lines[other] = lines[other], lines[one]
    return "\n".join(lines)


def _insert_line(text: str, chance: random.Random) -> str:
    lines = text.splitlines()
    lines.insert(chance.randrange(len(lines) + 1), chance.choice(LINES))
    return "\n".join(lines)


def _change_letter(text: str, chance: random.Random) -> str:
    place = chance.randrange(len(text))
    return text[:place] + chance.choice("[]{}=\"'.,#\n-09eE_x\t\x00é") + text[place + chance.randrange(2) :]


def _cut(text: str, chance: random.Random) -> str:
    return text[: chance.randrange(1, len(text))]


TEXT_CHANGES: tuple[Callable[[str, random.Random], str], ...] = (
    *(_delete_line, _double_line, _swap_lines, _insert_line, _change_letter, _cut),
)
