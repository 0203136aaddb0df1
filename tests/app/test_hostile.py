"""Input made to hurt: refused with a message that names the place, within limits of time and memory."""

from __future__ import annotations

import json
import os

import pytest

from benchmarks.forked import Job, Outcome, preload, run_all
from tests.app.scenes import PATCH

SECONDS, MEGABYTES = 2.0, 500.0
"""CPU time and memory that a refusal may take, beyond what the interpreter and the libraries do."""
UPPER = 'shape = { kind = "rectangle", x = [0.0, 2.0], y = [1.0, 2.0] }'
SPACED = "spacing = 0.25\n" + UPPER

Case = tuple[str, tuple[str, ...], str]
"""The text of a case, overrides, and what the message must name."""


NAMES = {"climbing": "../../x", "nul": "a\0b", "escape": "\x1b[2J", "long": "a" * 10_000}
MESHES = "/dev/zero /proc/self/mem fifo folder binary.msh binary.h5 sparse.msh nothing"
FILES = {
    "mesh": tuple(MESHES.split()),
    "points": ("/dev/random", "sparse.csv", "many.csv", "a\0b", "x" * 5000),
    "table": ("/dev/zero", "fifo", "binary.csv", "sparse.csv", "many.csv", ""),
}
EXPRESSIONS = ("9**9**9", "2**2**2**2**2**2**2", "9" * 490, "(" * 240 + "x" + ")" * 240)
WIDE, SPACING = "x = [0.0, 2.0], y = [1", "spacing = 0.25"
POINT = "refine = [{ at = [0.0, 1.0], spacing = 1e-6, radius = 0.1 }]"
EDGE = 'refine = [{ along = "top", spacing = 2e-8, radius = 0.0, growth = 1.0 }]'
SIZES = {
    "even": (SPACING, "spacing = 1e-9", "body.upper.spacing"),
    "smallest number": (SPACING, "spacing = 5e-324", "body.upper.spacing"),
    "long and thin": (WIDE, "x = [0.0, 3e6], y = [1", "body.upper.spacing: the scene needs"),
    "endless": (WIDE, "x = [0.0, 1e300], y = [1", "body.upper.shape.x.1"),
    "far away": (WIDE, "x = [1e15, 1.1e15], y = [1", "body.upper.spacing"),
    "stiff": ("E = 210e3", "E = 1e308", "material.steel.E"),
    "soft": ("E = 210e3", "E = 5e-324", "material.steel.E"),
    "whole number": ("fy = -200.0", f"fy = -{'9' * 400}", "load.press.fy"),
    "at a point": (SPACING, f"{SPACING}\n{POINT}", "body.upper.refine.0.spacing: the scene needs"),
    "along an edge": (SPACING, f"{SPACING}\n{EDGE}", "body.upper.refine.0.spacing: the scene needs"),
}
NUMBERS = {
    "mls.neighbors=1000000": "mls.neighbors",
    "body.upper.spacing=1e-5": "--set: body.upper.spacing: the scene needs",
    "mls.neighbors=9223372036854775808": "mls.neighbors",
    "mls.degree=1000000000": "mls.degree",
    "solver.order=1000000": "solver.order",
    "solver.max_steps=1000000000000000000000": "solver.max_steps",
    "solver.tolerance=1e-300": "solver.tolerance",
    "adapt.passes=1000000": "adapt.passes",
    "body.upper.seed=9223372036854775808": "body.upper.seed",
    "body.99999999999999999999999.spacing=1": "no item",
    "contact.interface.friction=1e300": "contact.interface.friction",
    "=": "--set",
    "output.at=" + "[" * 20_000: "--set",
    "x={" + "a." * 20_000 + "a=1}": "--set",
    ".".join("a" * 20_000) + "=1": "--set",
    "output={at=[0.5]}\nx=1": "--set",
}


def lots() -> dict[str, Case]:
    """Far too many or too deep."""
    points = ",".join(f"[{k},{k % 2 / 10}]" for k in range(3000))
    shape = f'shape = {{ kind = "polygon", points = [{points}] }}'
    end = PATCH + "[output]\nat = "
    return {
        "stages": (PATCH + "[[stage]]\npress = 1.0\n" * 30_000, (), "tables"),
        "some stages": (PATCH + "[[stage]]\npress = 1.0\n" * 6000, (), "stage"),
        "levels": (end + "[" + "0.5," * 1_100_000 + "]\n", (), "values"),
        "some levels": (end + "[" + "0.5," * 20_000 + "]\n", (), "output.at"),
        "keys": ("".join(f"k{k} = 1\n" for k in range(110_000)) + PATCH, (), "keys"),
        "some keys": ("".join(f"k{k} = 1\n" for k in range(5000)) + PATCH, (), "keys"),
        "tables": (PATCH + "".join(f"[t{k}]\n" for k in range(30_000)), (), "tables"),
        "loads": (PATCH + '[[load]]\nkind = "pressure"\npressure = 1.0\n' * 3000, (), "load"),
        "corners": (PATCH.changed(UPPER, shape, 1), (), "body.upper.shape.points"),
        "megabytes": (PATCH, (), "at most 16 MB"),
        "open brackets": (end + "[" * 100_000, (), "nested"),
        "brackets": (end + "[" * 100_000 + "]" * 100_000, (), "nested"),
        "some brackets": (end + "[" * 200 + "]" * 200, (), "nested"),
        "braces": (end + "{a=" * 50_000 + "1" + "}" * 50_000, (), "nested"),
        "dotted table": (PATCH + f"[{'.'.join('a' * 100_000)}]\n", (), "parts"),
        "dotted key": (f"{'.'.join('a' * 100_000)} = 1\n" + PATCH, (), "parts"),
        "quoted key": ('."a b".'.join(["x"] * 50_000) + " = 1\n" + PATCH, (), "parts"),
        "escaped key": ('."\\"".'.join(["x"] * 50_000) + " = 1\n" + PATCH, (), "parts"),
        "nested tables": (PATCH + "".join(f"[{'.'.join('a' * k)}]\n" for k in range(1, 300)), (), "parts"),
        "no end": (PATCH, ("/dev/zero",), "at most 16 MB"),
    }


def hostile() -> dict[str, Case]:
    """Every case, by name."""
    cases: dict[str, Case] = {}
    for what, name in NAMES.items():
        text = json.dumps(name, ensure_ascii=False)
        cases[f"load {what}"] = PATCH.changed('"press"', text, 1), (), ".name: a name "
    cases["name in a stage"] = f'{PATCH}\n[[stage]]\n"a/b" = 1.0\n', (), "stage.0."
    table = '[[load]]\nname = "q"\nboundary = "upper.right"\nkind = "pressure"\n'
    for kind, files in FILES.items():
        for file in files:
            text = json.dumps(file)
            shape = f'shape = {{ kind = "{kind}", file = {text} }}'
            case = (PATCH.changed(SPACED, shape, 1), (), "body.upper.shape.file")
            loaded = (f"{PATCH}\n{table}table = {text}\n", (), "load.q.table")
            cases[f"{kind} {file[:20]}"] = loaded if kind == "table" else case
    for text in EXPRESSIONS:
        quoted = json.dumps(text)
        cases[f"expression {text[:20]}"] = f"{PATCH}\n{table}pressure = {quoted}\n", (), "load.q.pressure"
    for name, (old, new, told) in SIZES.items():
        cases[f"size {name}"] = PATCH.changed(old, new, 1), (), told
    for override, told in NUMBERS.items():
        cases[f"set {override[:40]}"] = PATCH, ("--set", override), told
    return cases | lots()


@pytest.fixture(scope="module")
def outcomes(tmp_path_factory: pytest.TempPathFactory) -> dict[str, tuple[Outcome, str]]:
    """All of them in one child after the other, with the files they name next to them."""
    preload()
    place = tmp_path_factory.mktemp("hostile")
    os.mkfifo(place / "fifo")
    (place / "folder").mkdir()
    for name in ("binary.msh", "binary.csv", "binary.h5"):
        (place / name).write_bytes(bytes(range(256)) * 400)
    for name in ("sparse.msh", "sparse.csv"):
        with (place / name).open("wb") as file:
            file.truncate(20 * 2**30)
    (place / "many.csv").write_text("x,y,tag\n" + "0.5,0.5,\n" * 3_000_000)
    jobs, told = {}, {}
    for number, (name, (text, extra, wanted)) in enumerate(hostile().items()):
        case = place / f"{number}.toml"
        if name == "megabytes":
            with case.open("w") as file:
                file.write(text)
                file.truncate(100 * 2**20)
        else:
            case.write_text(text, encoding="utf-8")
        command = ["run", *(extra if extra[:1] == ("/dev/zero",) else (case.name, *extra)), "--out", "run"]
        jobs[name], told[name] = Job(command, place), wanted
    before = {path.name for path in place.iterdir()}
    found = run_all(list(jobs.values()), seconds=20.0, memory_mb=1500.0)
    assert {path.name for path in place.iterdir()} == before
    return {name: (outcome, told[name]) for name, outcome in zip(jobs, found, strict=True)}


@pytest.mark.parametrize("name", list(hostile()))
def test_refused_at_once(name: str, outcomes: dict[str, tuple[Outcome, str]]) -> None:
    outcome, told = outcomes[name]
    assert outcome.code == 2, outcome.err
    assert not outcome.traceback
    assert told in outcome.err
    assert outcome.out == ""
    assert len(outcome.err) < 20_000
    assert outcome.err.replace("\n", "").isprintable()
    assert outcome.cpu < SECONDS
    assert outcome.grown_mb < MEGABYTES
