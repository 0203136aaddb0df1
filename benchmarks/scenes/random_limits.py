"""Random scenes with friction whose forces or limit loads statics tells: those of random_limits.toml.

Blocks that slide or tip, plates between two blocks, linings, disks that spin in grooves, between plates and
between brake blocks, or roll, logs, feet, shrunk hubs, belts, wedges that lock or slip back, pads that are
pushed to and fro. Friction coefficients are 0.01 to 1.5.
"""

from __future__ import annotations

import math
import tomllib
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.scenes.random_stacks import body, case, polygon
from benchmarks.scenes.scene import Array, Figure, Refusal, Result, Scene, Table
from benchmarks.scenes.variants import Frame

KINDS: Mapping[str, Table] = tomllib.loads(Path(__file__).with_suffix(".toml").read_text())
SLIDES = ("slid", "slip")
WORDS = {
    "slides": SLIDES,
    "tips": ("tip", "tilt", "turn", "rotat"),
    "spins": (*SLIDES, "turn", "rotat", "spin"),
    "rests": (*SLIDES, "hold", "roll"),
}
"""Words that must tell what a scene does beyond its limit load."""
END = 1.0 + 1.0 / 1.5
"""Position of a limit where the last of two stages asks for 1.5 times as much."""
SIDES = ("foot", "right", "head", "left")


@dataclass(frozen=True)
class Upright:
    """A result as it would be upright in mm and N, and what is read of it."""

    result: Result
    frame: Frame

    def force(self, contact: str) -> Array:
        return np.asarray(self.result.force(contact) @ self.frame.matrix / self.frame.unit((1, 1)))

    def vectors(self, places: Array) -> Array:
        return np.asarray(places @ self.frame.matrix / self.frame.length)

    def component(self, contact: str, axis: int) -> float:
        return float(self.force(contact)[axis])

    def rolled(self) -> float:
        return float(self.vectors(self.result.moved("middle"))[0])

    def along(self) -> float:
        return float(self.force("low")[0] / self.force("low")[1])

    def loop(self, shear: float) -> float:
        """What a pad dissipates in its second turn over the loop of its ``shear``."""
        place = self.result.read("path/position")
        # What is pushed settles in the first turn: the second one closes.
        later = place >= 4.0 - 1e-9
        work = self.result.read("contacts/fret/dissipated_work")[later] / self.frame.unit((2, 1))
        factor = np.interp(place[later], [4.0, 5.0, 6.0], [1.0, -1.0, 1.0])
        along = shear * self.vectors(self.result.read("path/displacements/shear")[later])[:, 0]
        # Chords of two sizes tell what lies between a curve and its chords.
        turn = int(np.argmin(factor))
        every, other = np.arange(len(factor)), np.r_[0 : turn + 1 : 2, turn, turn : len(factor) : 2, -1]
        fine, coarse = (
            float((0.5 * (f[1:] + f[:-1]) * np.diff(u)).sum())
            for f, u in ((factor[one], along[one]) for one in (every, other))
        )
        loop = fine + (fine - coarse) / 3.0
        # What settles to rest hardly has a loop: then it counts against the elastic work.
        return 1.0 + (float(work[-1] - work[0]) - loop) / max(loop, 0.01 * float(np.ptp(along)))


def limited(number: int, frame: Frame) -> Scene:
    """The scene of a number in a frame, which is at right angles for scenes that need it."""
    kind = list(KINDS)[number % len(KINDS)]
    told, rng = KINDS[kind], np.random.default_rng([19, number])
    if told.get("guided"):
        angle = np.pi / 2.0 * round(float(np.arctan2(frame.matrix[1, 0], frame.matrix[0, 0])) / (np.pi / 2.0))
        frame = Frame.turned(np.degrees(angle), frame.length, frame.stress)
    names = drawn(told["draw"], rng)
    plane = str(names.get("plane") or rng.choice(["strain", "stress"]))
    tables = {key: filled(value, names) for key, value in told["case"].items()}
    tables.setdefault("stage", [{load["name"]: 1.0} for load in tables["load"]])
    bodies = [shaped(**one) for one in tables.pop("body")]
    materials = {one["material"]: names["materials"][one["material"]] for one in bodies}

    def got(read: str, given: Table, result: Result) -> float:
        return float(getattr(Upright(result, frame), read)(**given))

    figures = []
    for one in filled(told.get("figures", []), names):
        true, limit, scale = one.pop("true"), one.pop("limit", 1.0), one.pop("scale", None)
        what = one.pop("what", "") or f"{one['contact']} {'xy'[one['axis']]}"
        figures.append(Figure(what, partial(got, one.pop("read"), one), true, limit, scale))
    words = WORDS.get(filled(told.get("words", ""), names), ())
    refusal = Refusal(words, filled(told.get("position", END), names)) if words else None
    given = frame.case(case(plane, materials, bodies, **tables))
    return Scene(f"{kind}{number}", kind, given, figures, refusal)


def drawn(told: Table, rng: np.random.Generator) -> Table:
    """The values of a scene by name, in order; moduli are within a factor of 100 of each other."""

    def friction(least: float = 0.01, most: float = 1.5) -> float:
        return float(np.exp(rng.uniform(np.log(least), np.log(most))))

    between: Callable[[float, float], float] = lambda low, high: float(rng.uniform(low, high))  # noqa: E731
    known: Table = {**vars(math), "friction": friction, "between": between}
    known |= {
        "chosen": lambda *given: np.asarray(rng.choice(given)).item(),
        "chance": lambda share: rng.random() < share,
    }
    for name, value in told.items():
        if name == "materials":
            known["soft"] = level = 10.0 ** between(1.0, 5.0)
            moduli = {one: level * 10.0 ** between(0.0, 2.0 * (i > 0)) for i, one in enumerate(value)}
            known[name] = {one: {"E": E, "nu": between(0.0, 0.45)} for one, E in moduli.items()}
        else:
            known[name] = filled(value, known)
    return known


def filled(value: Any, names: Table) -> Any:
    """A value with those of its expressions, without the tables whose ``if`` does not hold."""
    if isinstance(value, str):
        return (
            eval(value[1:].strip(), {"__builtins__": {}, **BUILTINS, **names}) if value[:1] == "=" else value
        )
    if isinstance(value, list):
        return [one for one in (filled(one, names) for one in value) if one is not None]
    if isinstance(value, dict):
        made = {key: filled(one, names) for key, one in value.items()}
        return made if made.pop("if", True) else None
    return value


BUILTINS: Table = {one.__name__: one for one in (abs, min, max, float)}


def shaped(name: str, material: str, **shape: Any) -> Table:
    """A body of random_limits.toml; rounded corners of a block belong to foot and head."""
    if "shape" in shape:
        return {"name": name, "material": material, **shape}
    if "radii" in shape:
        return body(name, material, "annulus", **shape)
    if "points" in shape:
        return polygon(name, material, **{"names": list(SIDES), **shape})
    (left, right), (low, high) = shape.get("x") or (-shape["half"], shape["half"]), shape["y"]
    corners, rounding = [(left, low), (right, low), (right, high), (left, high)], shape.get("rounding")
    rounded = {"rounding": [rounding] * 4, "corners": ["foot", "foot", "head", "head"]} if rounding else {}
    return polygon(name, material, corners, names=list(SIDES), **rounded)
