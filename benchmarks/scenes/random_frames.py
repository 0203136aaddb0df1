"""Random scenes of one or two bodies on a base, written in any frame: turned by any angle, in any units.

Drawn for ``random_scenes.py --frames``, which solves every scene as drawn and again upright in mm and N. A
base (a block held, on springs, with a hole or a curved head; a rigid plane, disk or hole) carries a body,
often a loose one with another one on it, which a plate, a traction or its weight presses; shear, heat and
unloading follow.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from benchmarks.scenes.parts import Pair, body, case, held, platen, polygon
from benchmarks.scenes.scene import Table

Rng = np.random.Generator
UNITS = ((1.0, 1.0), (1e-3, 1e6), (1e3, 1e-3))
"""Lengths and stresses: mm and N, m and Pa, and others."""


@dataclass(frozen=True)
class Frame:
    """Where a scene is written: turned by ``angle`` in degrees, in units of length and stress."""

    angle: float = 0.0
    length: float = 1.0
    stress: float = 1.0

    def turned(self, x: float, y: float, scale: float = 1.0) -> list[float]:
        """A vector in the frame."""
        a = np.deg2rad(self.angle)
        c, s = (float(np.round(v, 15)) for v in (np.cos(a), np.sin(a)))
        return [scale * (c * x - s * y), scale * (s * x + c * y)]

    def at(self, x: float, y: float) -> list[float]:
        return self.turned(x, y, self.length)

    def places(self, points: list[Pair]) -> list[list[float]]:
        return [self.at(*point) for point in points]

    def force(self, x: float, y: float) -> list[float]:
        return self.turned(x, y, self.length * self.stress)


def drawn_frame(number: int) -> Frame:
    """The frame that a scene is drawn in: upright, at right angles, or at any angle."""
    rng = np.random.default_rng([13, number])
    angle = float(rng.choice([0.0, 90.0, 180.0, rng.uniform(-180.0, 180.0), rng.uniform(-180.0, 180.0)]))
    return Frame(angle, *UNITS[int(rng.integers(len(UNITS)))])


def framed(number: int, frame: Frame) -> tuple[Table, list[str], list[str]]:
    """The case of a number in a frame, the contacts that no sharp corner can reach, what it is made of."""
    rng = np.random.default_rng([17, number])
    made = FramedScene(frame, rng)
    base = made.base()
    wide = float(rng.uniform(3.0, 8.0))
    level, below, smooth = 0.0, base, base in ("disk", "hole")
    tops = 1 if rng.random() < 0.6 else 2
    for i in range(tops):
        kind, high = made.top(f"top{i}", wide, level, below, last=i == tops - 1)
        made.meet(f"joint{i}", f"top{i}.foot", below if i else base, smooth or kind != "box", first=i == 0)
        level, below, smooth = level + high, f"top{i}.head", kind == "disk"
        wide *= 1.0 if i == tops - 1 else float(rng.uniform(0.5, 0.9))
    made.loads(f"top{tops - 1}", wide, level)
    return made.case(), made.smooth, made.words


class FramedScene:
    """A scene while it is drawn: upright in mm and N, written in its frame."""

    def __init__(self, frame: Frame, rng: Rng) -> None:
        self.frame, self.rng = frame, rng
        self.materials: dict[str, Table] = {}
        self.tables: dict[str, list[Table]] = {
            key: [] for key in ("body", "support", "contact", "load", "stage", "probe")
        }
        self.smooth: list[str] = []
        self.words: list[str] = []
        self.soft = np.inf
        self.friction = float(rng.choice([0.0, 0.2, 0.5]))
        self.law = str(rng.choice(["default", "hyperbolic", "default"]))
        self.bonded = rng.random() < 0.08
        self.heat = rng.random() < 0.15
        self.level = float(10.0 ** rng.uniform(1.0, 5.0))

    def chosen(self, *words: str, p: list[float] | None = None) -> str:
        word = str(self.rng.choice(words, p=p))
        self.words.append(word)
        return word

    def material(self, name: str) -> str:
        """A material around the scene's modulus: isotropic, nearly incompressible or orthotropic."""
        rng, unit = self.rng, self.frame.stress
        E = self.level * float(10.0 ** rng.uniform(-1.0, 1.0))
        kind = self.chosen("isotropic", "incompressible", "orthotropic", p=[0.6, 0.15, 0.25])
        alpha = {"alpha": 1e-5} if self.heat else {}
        if kind == "orthotropic":
            by = float(rng.uniform(1.5, 12.0))
            self.materials[name] = {
                "E1": E * unit,
                "E2": E / by * unit,
                "E3": E / by * unit,
                "G12": 0.4 * E / np.sqrt(by) * unit,
                **dict.fromkeys(("nu12", "nu13", "nu23"), 0.3),
                "angle": float(rng.uniform(-90.0, 90.0)) + self.frame.angle,
                **alpha,
            }
            E /= by
        else:
            nu = float(rng.choice([0.48, 0.499]) if kind == "incompressible" else rng.uniform(0.0, 0.42))
            self.materials[name] = {"E": E * unit, "nu": nu, **alpha}
        self.soft = min(self.soft, E)
        return name

    def add(self, made: Table, high: float) -> None:
        """A body, some with a spacing of their own, fine enough for them and for the holes of bases."""
        if self.rng.random() < 0.3:
            self.words.append("spacing")
            made["spacing"] = float(self.rng.uniform(0.04, 0.08)) * high * self.frame.length
        self.tables["body"].append(made)

    def block(self, name: str, x: Pair, y: Pair, rounding: float = 0.0, hole: float = 0.0) -> Table:
        """A block with sides foot, right, head, left; arcs belong to its foot and head."""
        points = [(x[0], y[0]), (x[1], y[0]), (x[1], y[1]), (x[0], y[1])]
        more: Table = {}
        if rounding:
            more["rounding"] = [rounding * self.frame.length] * 4
            more["corners"] = ["foot", "foot", "head", "head"] if self.rng.random() < 0.5 else [""] * 4
        if hole:
            middle = self.frame.at(0.5 * (x[0] + x[1]), 0.5 * (y[0] + y[1]))
            more["holes"] = [{"center": middle, "radius": hole * self.frame.length}]
        names = ["foot", "right", "head", "left"]
        return polygon(name, self.material(name), self.frame.places(points), names=names, **more)

    def base(self) -> str:
        """What the lowest body stands on: the boundary or the obstacle."""
        rng = self.rng
        kind = self.chosen(
            "held",
            "springs",
            "holed",
            "plane",
            "disk",
            "hole",
            "bump",
            p=[0.25, 0.15, 0.1, 0.15, 0.1, 0.1, 0.15],
        )
        if kind in ("plane", "disk", "hole"):
            self.bonded = False
            return kind
        x, deep = float(rng.uniform(6.0, 10.0)), float(rng.uniform(3.0, 7.0))
        if kind == "bump":
            self.add(self.hill("base", x, deep), deep)
        else:
            hole = 0.25 * deep if kind == "holed" else 0.0
            self.add(self.block("base", (-x, x), (-deep, 0.0), hole=hole), deep)
        if kind == "springs":
            k = 0.05 * self.level / deep * self.frame.stress / self.frame.length
            self.tables["support"].append({"boundary": "base.foot", "spring": [k, k]})
        else:
            self.tables["support"].append(held("base.foot"))
        return "base.head"

    def hill(self, name: str, x: float, deep: float) -> Table:
        """A block whose head is a shallow curve through points."""
        s = np.linspace(x, -x, 15)
        radius = float(self.rng.uniform(15.0, 60.0))
        curve = self.frame.places([(float(v), float(-(v**2) / (2.0 * radius))) for v in s])
        low = -deep - x**2 / (2.0 * radius)
        ends = self.frame.places([(-x, low), (x, low)])
        sides = [
            {"name": "head", "points": curve},
            {"name": "left", "to": ends[0]},
            {"name": "foot", "to": ends[1]},
            {"name": "right"},
        ]
        return body(name, self.material(name), "outline", sides=sides)

    def top(self, name: str, wide: float, level: float, below: str, last: bool) -> tuple[str, float]:
        """A body that stands on a level: its kind and height."""
        rng, frame = self.rng, self.frame
        high = float(rng.uniform(0.4, 0.9)) * wide
        kinds = ("round",) if below == "hole" else ("box", "round", "nose", "disk")
        kind = self.chosen(*(kind for kind in kinds if last <= (kind != "disk")))
        if kind == "disk":
            center = frame.at(0.0, level + 0.5 * high)
            made = body(name, self.material(name), "disk", center=center, radius=0.5 * high * frame.length)
        elif kind == "nose":
            s = np.linspace(-0.5 * wide, 0.5 * wide, 15)
            radius = float(rng.uniform(2.0, 10.0)) * wide
            curve = frame.places([(float(v), level + float(v**2) / (2.0 * radius)) for v in s])
            ends = frame.places([(0.5 * wide, level + high), (-0.5 * wide, level + high)])
            sides = [
                {"name": "foot", "points": curve},
                {"name": "right", "to": ends[0]},
                {"name": "head", "to": ends[1]},
                {"name": "left"},
            ]
            made = body(name, self.material(name), "outline", sides=sides)
        else:
            rounding = 0.0 if kind == "box" else float(rng.uniform(0.08, 0.3)) * high
            made = self.block(name, (-0.5 * wide, 0.5 * wide), (level, level + high), rounding)
        self.add(made, high)
        where = frame.at(0.0, level + 0.6 * high)
        self.tables["probe"].append({"name": name, "body": name, "point": where})
        return kind, high

    def meet(self, name: str, slave: str, below: str, smooth: bool, first: bool) -> None:
        """The contact of a body with what it stands on."""
        rng, frame = self.rng, self.frame
        disk = self.tables["body"][-1]["shape"]["kind"] == "disk"
        lower = below.partition(".")[0]
        slave = slave.replace("foot", "arc") if disk else slave
        round_below = any(
            one["name"] == lower and one["shape"]["kind"] == "disk" for one in self.tables["body"]
        )
        below = below.replace("head", "arc") if round_below else below
        made: Table = {"name": name, "slave": slave, "friction": self.friction}
        if self.law != "default":
            made["regularization"] = {"law": self.law}
        flat = not disk and "nose" not in self.words
        if below == "plane":
            made["obstacle"] = {
                "kind": "plane",
                "point": frame.at(1.0, 0.0),
                "normal": frame.turned(0.0, 1.0),
            }
        elif below in ("disk", "hole"):
            radius, up = float(rng.uniform(20.0, 60.0)), -1.0 if below == "disk" else 1.0
            obstacle = {"kind": "disk", "center": frame.at(0.0, up * radius), "radius": radius * frame.length}
            made["obstacle"] = obstacle | ({"inside": True} if below == "hole" else {})
        else:
            made["master"] = below
            if first and self.bonded and flat and self.tables["body"][0]["shape"]["kind"] == "polygon":
                made["friction"] = "bonded"
                made.pop("regularization", None)
                self.words.append("bonded")
            elif rng.random() < 0.5:
                made["slave"], made["master"] = made["master"], made["slave"]
        if smooth and made["friction"] != "bonded":
            self.smooth.append(name)
        self.tables["contact"].append(made)

    def loads(self, name: str, wide: float, level: float) -> None:
        """Press by force or displacement; then shear, heat, unload."""
        head = f"{name}.head"
        rng, frame, loads, stages = self.rng, self.frame, self.tables["load"], self.tables["stage"]
        press = float(rng.uniform(0.002, 0.01)) * self.soft * 3.0
        # A disk rolls away but under a plate that goes straight down.
        rolls = "disk" in self.words[1:]
        free = () if rolls else ("turning", "weight", "traction")
        kind = self.chosen("force", "displacement", *free)
        more: Table = {"rotation": "free"} if kind == "turning" else {}
        if kind == "displacement":
            loads.append(platen("press", head, displacement=frame.at(0.0, -0.004 * level)))
        elif kind == "weight":
            high = level / len(self.tables["probe"])
            b = frame.turned(0.0, -press / (3.0 * high), frame.stress / frame.length)
            loads.append({"name": "press", "body": name, "kind": "body-force", "body-force": b})
        elif kind == "traction":
            t = frame.turned(0.0, -press / 3.0, frame.stress)
            loads.append({"name": "press", "boundary": head, "kind": "traction", "traction": t})
        else:
            loads.append(platen("press", head, force=frame.force(0.0, -press), **more))
        stages.append({"press": 1.0})
        if self.friction and not self.bonded and not rolls:
            if kind in ("force", "turning") and rng.random() < 0.6:
                self.words.append("shear")
                shear = press * min(0.4 * self.friction, 0.2 * wide / level)
                loads.append(platen("shear", head, force=frame.force(shear, 0.0), **more))
                stages.append({"shear": 1.0})
                if rng.random() < 0.5:
                    stages.append({"shear": -1.0})
            if kind == "displacement" and rng.random() < 0.6:
                self.words.append("drag")
                loads.append(platen("shear", head, displacement=frame.at(0.003 * level, 0.0)))
                stages.append({"shear": 1.0})
        if self.heat:
            self.words.append("heat")
            loads.append({"name": "warm", "body": name, "kind": "temperature", "temperature": 30.0})
            stages.append({"warm": 1.0})
        if rng.random() < 0.4:
            self.words.append("unload")
            stages.append({"press": 0.5})

    def case(self) -> Table:
        return case(
            str(self.rng.choice(["strain", "stress"])), self.materials, self.tables.pop("body"), **self.tables
        )
