"""Random stacks: one to four bodies on a base or on a rigid obstacle, or a shaft in a ring, drawn upright.

Bodies are the parts of random_parts.toml; materials are isotropic, nearly incompressible or orthotropic,
of any contrast; contacts have friction or not, one of two laws, a bond, a gap as an expression; bases are
held, on springs, or at parts of their foot, some under a layer of another stiffness. They are pressed by
force, displacement, a pressure on a part or one that varies, weight or a moment; shear to and fro, heat and
unloading follow.
"""

from __future__ import annotations

import math
import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.scenes.scene import Table

PARTS = tomllib.loads(Path(__file__).with_name("random_parts.toml").read_text())
SQUARE = [[-1, 0], [1, 0], [1, 1], [-1, 1]]
SIDES = ["foot", "right", "head", "left"]
Span = tuple[float, float]


def case(plane: str, materials: Mapping[str, Table], bodies: Sequence[Table], **rest: Any) -> Table:
    """A case; ``rest`` are its other tables."""
    return {
        "format": 1,
        "model": {"plane": plane},
        "material": dict(materials),
        "body": list(bodies),
        "output": {"vtu": False},
        **{key: value for key, value in rest.items() if value},
    }


def body(name: str, material: str, kind: str, **shape: Any) -> Table:
    return {"name": name, "material": material, "shape": {"kind": kind, **shape}}


def polygon(name: str, material: str, points: Sequence[Span], **shape: Any) -> Table:
    return body(name, material, "polygon", points=[list(map(float, p)) for p in points], **shape)


def held(boundary: str, *directions: str) -> Table:
    return {"boundary": boundary} | dict.fromkeys(directions or ("ux", "uy"), 0.0)


def pair(name: str, slave: str, master: str, friction: float | str = 0.0, **rest: Any) -> Table:
    return {"name": name, "slave": slave, "master": master, "friction": friction, **rest}


def platen(name: str, boundary: str, **rest: Any) -> Table:
    return {"name": name, "boundary": boundary, "kind": "platen", **rest}


def probe(name: str, body_name: str, x: float, y: float) -> Table:
    return {"name": name, "body": body_name, "point": [x, y]}


@dataclass
class Stack:
    """A scene while it is drawn, in mm and N."""

    rng: np.random.Generator
    materials: dict[str, Table] = field(default_factory=dict)
    tables: dict[str, list[Table]] = field(
        default_factory=lambda: {key: [] for key in ("body", "support", "contact", "load", "stage", "probe")}
    )
    words: list[str] = field(default_factory=list)
    smooth: list[str] = field(default_factory=list)
    """Contacts that no sharp corner can reach."""
    soft: float = math.inf
    """Least modulus."""

    def between(self, low: float, high: float) -> float:
        return float(self.rng.uniform(low, high))

    def chance(self, share: float) -> bool:
        return bool(self.rng.random() < share)

    def chosen(self, *words: str, p: list[float] | None = None) -> str:
        word = str(self.rng.choice(words, p=p))
        self.words.append(word)
        return word

    def material(self, name: str, heat: bool) -> str:
        """A material of its own for a body."""
        E = 10.0 ** self.between(-3.0, 3.0 if self.chance(0.2) else 0.0)
        kind = self.chosen("isotropic", "incompressible", "orthotropic", p=[0.6, 0.15, 0.25])
        made: Table = {"alpha": 1e-5} if heat else {}
        if kind == "orthotropic":
            by = self.between(1.5, 12.0)
            made |= {"E1": E, "E2": E / by, "E3": E / by, "G12": 0.4 * E / by**0.5}
            made |= dict.fromkeys(("nu12", "nu13", "nu23"), 0.3) | {"angle": self.between(-90.0, 90.0)}
            E /= by
        else:
            incompressible = kind == "incompressible"
            nu = float(self.rng.choice([0.48, 0.499])) if incompressible else self.between(0.0, 0.42)
            made |= {"E": E, "nu": nu}
        self.materials[name] = made
        self.soft = min(self.soft, E)
        return name

    def part(self, name: str, kind: str, wide: float, y: Span, heat: bool = False) -> Table:
        """A body of a kind, ``wide`` and between two levels."""
        given, material = PARTS[kind], self.material(name, heat)
        half, low, high = 0.5 * wide, y[0], y[1] - y[0]
        if "shape" in given:
            radius = 0.5 * high if kind in ("disk", "ring") else high
            shape: Table = {"center": [0.0, low + radius], "radius": radius}
            if kind == "half-disk":
                shape["side"] = "lower"
            if kind in ("ring", "half-ring"):
                shape["radii"] = [self.between(0.4, 0.8) * radius, shape.pop("radius")]
            if kind == "half-ring":
                shape["angles"] = [180.0, 360.0]
            return body(name, material, given["shape"], **shape)
        corners = [(half * a, low + high * b) for a, b in given.get("corners", SQUARE)]
        names = given.get("sides", SIDES)
        if "curves" in given:
            on = "head" if name == "base" else "foot"
            curves = {
                key: text for key, text in given["curves"].items() if key == on or len(given["curves"]) == 1
            }
            return body(name, material, "outline", sides=self._curved(corners, names, curves, high))
        more: Table = {}
        if "rounding" in given:
            more["rounding"] = [high * r for r in given["rounding"]]
        if "corner_names" in given:
            more["corners"] = given["corner_names"]
        if "hole" in given:
            a, b, r = given["hole"]
            more["holes"] = [{"center": [half * a, low + high * b], "radius": r * min(half, high)}]
        return polygon(name, material, corners, names=names, **more)

    def _curved(self, corners: list[Span], names: list[str], curves: Table, high: float) -> list[Table]:
        """Sides of an outline, some of them curves through points."""
        known = {"a": 10.0 ** self.between(-3.0, -1.7), "n": int(self.rng.integers(1, 4))}
        known |= {"p": float(self.rng.choice([2.0, 3.0, 4.0])), "cos": math.cos, "pi": math.pi, "abs": abs}
        ends = [*corners[1:], corners[0]]
        sides: list[Table] = []
        for side, a, b in zip(names, corners, ends, strict=True):
            if side not in curves:
                sides.append({"name": side, "to": list(b)})
                continue
            u = np.linspace(-1.0, 1.0, 41) * (1.0 if a[0] < b[0] else -1.0)
            up = [high * float(eval(curves[side], {"__builtins__": {}}, known | {"u": float(v)})) for v in u]
            x, y = np.linspace(a[0], b[0], 41), np.linspace(a[1], b[1], 41) + up
            sides.append({"name": side, "points": np.column_stack([x, y]).tolist()})
        # The corners of curves are where these end.
        for before, after in zip(sides, [*sides[1:], sides[0]], strict=True):
            if "to" in before and "points" in after:
                before["to"] = after["points"][0]
        return sides

    def case(self) -> Table:
        plane, rest = str(self.rng.choice(["strain", "stress"])), dict(self.tables)
        return case(plane, self.materials, rest.pop("body"), **rest)


def stack(number: int) -> tuple[Table, list[str], list[str]]:
    """The upright case of a number, the contacts that no sharp corner can reach, what it is made of."""
    made = Stack(np.random.default_rng([17, number]))
    if made.chance(0.1):
        _fit(made)
        return made.case(), made.smooth, made.words
    heat, friction = made.chance(0.15), float(made.rng.choice([0.0, 0.2, 0.5]))
    below, smooth = _base(made)
    count, level, wide = int(made.rng.choice([1, 1, 2, 2, 3, 4])), 0.0, made.between(3.0, 8.0)
    rolls = False
    for i in range(count):
        last = i == count - 1
        where = ("top", "last") if last else ("top",) if rolls else ("top", "between")
        kinds = [kind for kind, given in PARTS.items() if set(given["on"]) & set(where)]
        if smooth and i:  # what stands on a round body is flat
            kinds = ["block", "round"]
        kind, high = made.chosen(*kinds), made.between(0.4, 0.9) * wide
        name = f"top{i}"
        upper = made.part(name, kind, wide, (level, level + high), heat and last)
        if i == 0 and below == "base.head":
            _aside(made, upper, wide)
        made.tables["body"].append(upper)
        foot, head = (PARTS[kind].get(key, key) for key in ("foot", "head"))
        _meet(made, f"joint{i}", f"{name}.{foot}", below, friction, kind)
        if smooth or PARTS[kind].get("smooth"):
            made.smooth.append(f"joint{i}")
        at = {"ring": (0.0, 0.05), "half-ring": (-0.95, 0.98)}.get(kind, (0.0, 0.5))
        made.tables["probe"].append(probe(name, name, high * at[0], level + high * at[1]))
        rolls = rolls or kind in ("disk", "ring")
        level, smooth = level + high, kind in ("disk", "ring")
        below = [f"{name}.{side}" for side in head] if isinstance(head, list) else f"{name}.{head}"
        wide *= 1.0 if last else made.between(0.5, 0.9)
    _press(made, below, (wide, level), friction, rolls)
    if heat:
        made.words.append("heat")
        field: Any = f"20 + 10*y/{level:.4g}" if made.chance(0.5) else 30.0
        made.tables["load"].append(
            {"name": "warm", "body": f"top{count - 1}", "kind": "temperature", "temperature": field}
        )
        made.tables["stage"].append({"warm": 1.0})
    if made.chance(0.4):
        made.words.append("unload")
        made.tables["stage"].append({"press": 0.5})
    contacts = made.tables["contact"]
    exact = any("obstacle" in one or one["friction"] == "bonded" for one in contacts)
    if made.chance(0.3) and not exact:
        made.words.append("hyperbolic")
        for contact in contacts:
            contact["regularization"] = {"law": "hyperbolic"}
    return made.case(), made.smooth, made.words


def _base(made: Stack) -> tuple[Any, bool]:
    """What the lowest body stands on, a boundary or an obstacle, and whether no corner of it is met."""
    kinds = [kind for kind, given in PARTS.items() if "base" in given["on"]]
    kind = made.chosen("rigid plane", "rigid disk", "rigid hole", *kinds)
    made.words.append("carries")
    if kind not in PARTS:
        # Rigid bodies are as soft as anything.
        made.soft = 1.0
        radius = made.between(20.0, 60.0)
        if kind == "rigid plane":
            return {"kind": "plane", "point": [1.0, 0.0], "normal": [0.0, 1.0]}, False
        inside = {"inside": True} if kind == "rigid hole" else {}
        up = radius if inside else -radius
        return {"kind": "disk", "center": [0.0, up], "radius": radius} | inside, True
    x, deep = made.between(6.0, 10.0), made.between(3.0, 7.0)
    bodies, supports = made.tables["body"], made.tables["support"]
    bodies.append(made.part("base", kind, 2.0 * x, (-deep, 0.0)))
    how = made.chosen("held", "held", "springs", "parts")
    k = 0.1 * made.soft / deep
    if how == "springs":
        supports.append({"boundary": "base.foot", "spring": [k, k]})
    elif how == "parts" and kind in ("block", "holed"):
        for number, (a, b) in enumerate(((-1.0, -0.6), (0.5, 0.9))):
            part = {"from": [a * x, -deep], "to": [b * x, -deep]}
            clamped = number == 0 or made.chance(0.5)
            supports.append(
                (held("base.foot") if clamped else {"boundary": "base.foot", "spring": [k, k]}) | part
            )
    else:
        supports.append(held("base.foot"))
    if kind == "block" and made.chance(0.3):
        made.words.append("layer")
        thick = made.between(0.15, 0.4) * deep
        bodies[0]["shape"]["points"] = [[x * a, -deep + (deep - thick) * b] for a, b in SQUARE]
        bodies.append(made.part("layer", "block", 2.0 * x, (-thick, 0.0)))
        made.tables["contact"].append(pair("bond", "layer.foot", "base.head", "bonded"))
        return "layer.head", False
    return "base.head", bool(PARTS[kind].get("smooth"))


def _aside(made: Stack, upper: Table, wide: float) -> None:
    """Move a body on a curved base along, and up or down until they touch."""
    base = {row["name"]: row for row in made.tables["body"][0]["shape"].get("sides", [])}
    sides = {row["name"]: row for row in upper["shape"].get("sides", [])}
    if "points" not in base.get("head", {}) or upper["shape"]["kind"] not in ("outline", "polygon"):
        return
    made.words.append("aside")
    foot = np.array(sides["foot"]["points"] if sides else np.linspace(*upper["shape"]["points"][:2], 41))
    move = made.between(-0.15, 0.15) * wide
    up = np.interp(foot[:, 0] + move, *np.array(base["head"]["points"])[::-1].T) - foot[:, 1]
    shift = np.array([move, float(up.max())])
    for row in (*upper["shape"].get("sides", []), *upper["shape"].get("holes", []), upper["shape"]):
        for key in ("to", "points", "center"):
            if key in row:
                row[key] = (np.array(row[key]) + shift).tolist()


def _meet(made: Stack, name: str, slave: str, below: Any, friction: float, kind: str) -> None:
    """The contact of a body with what it stands on."""
    if isinstance(below, dict):
        made.tables["contact"].append({"name": name, "slave": slave, "obstacle": below, "friction": friction})
        return
    contact = pair(name, slave, below, friction)
    flat = kind == "block" and below in ("base.head", "layer.head")
    if flat and made.chance(0.15):
        made.words.append("bonded")
        contact["friction"] = "bonded"
    elif flat and made.chance(0.15):
        made.words.append("gap")
        contact["gap"] = f"x**2/(2*{made.between(20.0, 200.0):.4g})"
    elif made.chance(0.4):
        contact["slave"], contact["master"] = contact["master"], contact["slave"]
    made.tables["contact"].append(contact)


def _press(made: Stack, head: Any, at: Span, friction: float, rolls: bool) -> None:
    """Press the last body, then shear it to and fro."""
    (wide, level), loads, stages = at, made.tables["load"], made.tables["stage"]
    force = made.between(0.001, 0.006) * made.soft * wide
    name = (head[0] if isinstance(head, list) else head).split(".")[0]
    flat = not isinstance(head, list) and head.endswith(".head")
    kinds = ("force", "displacement", "turning", "weight", "moment", *(("varying", "part") if flat else ()))
    kind = made.chosen(*(("force", "displacement") if rolls else kinds))
    down = {"fy": -force, "ux": 0.0} if rolls else {"force": [0.0, -force]}
    more: Table = {"rotation": "free"} if kind == "turning" else {}
    if kind == "displacement":
        loads.append(platen("press", head, displacement=[0.0, -force / made.soft]))
    elif kind == "weight":
        loads.append(
            {"name": "press", "body": name, "kind": "body-force", "body-force": [0.0, -force / wide**2]}
        )
    elif kind in ("varying", "part"):
        text = f"{force / wide!r}*(1 + 0.3*x/{wide!r})"
        part = {"from": [-0.2 * wide, level], "to": [0.2 * wide, level]} if kind == "part" else {}
        # Parts of rounded or narrow heads are not where their corners would be.
        part = part if made.tables["body"][-1]["shape"]["kind"] == "polygon" else {}
        loads.append({"name": "press", "boundary": head, "kind": "pressure", "pressure": text} | part)
    elif kind == "moment":
        loads.append(platen("press", head, **down, moment=made.between(-0.05, 0.05) * force * wide))
    else:
        loads.append(platen("press", head, **down, **more))
    stages.append({"press": 1.0})
    if friction and not rolls and kind in ("force", "turning", "displacement") and made.chance(0.6):
        made.words.append("shear")
        shear = force * min(0.4 * friction, 0.2 * wide / level)
        push: Table = (
            {"displacement": [shear / made.soft, 0.0]} if kind == "displacement" else {"force": [shear, 0.0]}
        )
        loads.append(platen("shear", head, **push, **more))
        stages += [{"shear": 1.0}, *({"shear": float(way)} for way in made.rng.choice([-1.0, -0.5, 0.3], 1))]


def _fit(made: Stack) -> None:
    """A shaft, hollow or not, in a ring, with interference or pulled down in a clearance."""
    tight, hollow = made.chance(0.5), made.chance(0.5)
    made.words.append("tight" if tight else "loose")
    clearance = 0.0 if tight else 10.0 ** made.between(-3.0, -1.5)
    one, two = made.material("one", False), made.material("two", False)
    shape: Table = {"radii": [0.4, 1.0]} if hollow else {"radius": 1.0}
    shaft = body("shaft", one, "annulus" if hollow else "disk", center=[0.0, -clearance], **shape)
    ring = body("ring", two, "annulus", center=[0.0, 0.0], radii=[1.0 + clearance, made.between(1.5, 3.0)])
    side = "shaft.outer" if hollow else "shaft.arc"
    contact = pair("joint", side, "ring.inner", float(made.rng.choice([0.0, 0.2])))
    made.tables |= {"body": [ring, shaft], "support": [held("ring.outer")], "contact": [contact]}
    made.tables["probe"].append(probe("edge", "shaft", 0.0, -clearance - 0.95))
    if tight:
        contact["interference"] = 1e-3
    else:
        pull = {"name": "pull", "body": "shaft", "kind": "body-force"}
        made.tables["load"].append(pull | {"body-force": [0.0, -1e-3 * made.soft / math.pi]})
        made.tables["stage"].append({"pull": 1.0})
        made.smooth.append("joint")
