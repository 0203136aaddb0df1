"""The same scene written differently: turned, mirrored, in other units, with other clouds, roles swapped.

Every variant changes the case, and knows how vectors of its results turn back. ``altered`` scenes have other
materials and loads.
"""

from __future__ import annotations

import copy
import re
import zlib
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from benchmarks.scenes.scene import Array, Move, Scene, Table, listed

SQUARE = ("right", "top", "left", "bottom")
HALVES = ("right", "upper", "left", "lower")
MODULI = ("E", "E1", "E2", "E3", "G12")
POISSON_RATIOS = (0.0, 0.1, 0.2, 0.3, 0.4, 0.45, 0.48)
PLANES = {"strain": "stress", "stress": "strain"}
SCALARS = {"pressure": (0, 1), "moment": (2, 1), "rotation": (0, 0), "temperature": (0, 0)}
VECTORS = {"traction": (0, 1), "force": (1, 1), "displacement": (1, 0), "body-force": (-1, 1)}
AXES = {("fx", "fy"): (1, 1), ("ux", "uy"): (1, 0)}
"""Loads, with the powers of length and stress in their units."""
FINER = 0.6
"""Spacings below this part of those far away are refined ones."""

Spacings = tuple[float, dict[str, tuple[float, dict[tuple[float, float], float]]]]
"""Spacing of a body far from its refinements; along each of its sides that of half its length, and those at
its ends and where they are least, by place."""


@dataclass(frozen=True)
class Variant:
    """``change`` makes its case of the scene's; places are turned by ``matrix`` (2, 2), units are scaled."""

    name: str
    change: Callable[[Table], Table]
    matrix: Array = field(default_factory=lambda: np.eye(2))
    length: float = 1.0
    stress: float = 1.0

    def move(self) -> Move:
        return lambda places: self.length * places @ self.matrix.T


def variants() -> list[Variant]:
    """All of them but for the halved spacing, which needs the run's own clouds: see ``halved``."""
    turned = Frame(np.array([[0.0, -1.0], [1.0, 0.0]]))
    mirrored = Frame(np.array([[-1.0, 0.0], [0.0, 1.0]]))
    # From metres and pascals to millimetres and megapascals; the other way round is as good a test.
    units = Frame(np.eye(2), 1e3, 1e-6)
    return [
        Variant("seed", _seeded),
        Variant("swapped", _swapped),
        Variant("turned", turned.case, turned.matrix),
        Variant("mirrored", mirrored.case, mirrored.matrix),
        Variant("units", units.case, length=units.length, stress=units.stress),
    ]


def halved(given: Table, spacings: dict[str, Spacings]) -> Variant:
    """Half of the spacing that every body had in its first run, but for nodes of files."""
    made = respaced(given, spacings, 0.5)
    return Variant("halved", lambda _: made)


def respaced(given: Table, spacings: dict[str, Spacings], factor: float) -> Table:
    """A ``factor`` times the spacing that every body had in its first run, and of finer ones along its
    contacts, but for nodes of files."""
    made = copy.deepcopy(given)
    contacts = made.get("contact", [])
    sides = {side for one in contacts for key in ("slave", "master") for side in listed(one.get(key, []))}
    for one in made["body"]:
        if has_nodes(one):
            continue
        far, along = spacings[one["name"]]
        fine: dict[tuple[float, float], float] = {}
        zones = []
        for side, (h, places) in along.items():
            if f"{one['name']}.{side}" in sides and h < far:
                zones.append({"spacing": factor * h, "along": side})
            fine |= {place: least for place, least in places.items() if least < FINER * far}
        zones += [{"spacing": factor * least, "at": list(place)} for place, least in fine.items()]
        # Their spacings grow as automatic ones do.
        one["refine"] = [zone | {"radius": 0.0, "growth": 0.15} for zone in zones]
        one["spacing"] = factor * far
    return made


def evenly_spaced(given: Table, spacings: dict[str, Spacings], factor: float) -> Table:
    """Even spacings, ``factor`` times those far from the refinements of a run; bodies that fit have one."""
    made, far = copy.deepcopy(given), {name: h for name, (h, _) in spacings.items()}
    fitted = any("interference" in one for one in made["contact"])
    for one in made["body"]:
        one["spacing"] = factor * (min(far.values()) if fitted else far[one["name"]])
    return made


def has_nodes(one: Table) -> bool:
    """Whether a body's nodes are those of its file."""
    return one["shape"]["kind"] in ("mesh", "points") and one["shape"].get("use", "nodes") == "nodes"


def altered(scene: Scene, seed: int) -> Scene:
    """The scene with moduli up to 5 times larger or smaller, other Poisson's ratios, all loads 0.5 to 1.6
    times as large, and friction, interferences and the plane changed. It has no figures and no limit load."""
    rng = np.random.default_rng([seed, zlib.crc32(scene.name.encode())])
    given = copy.deepcopy(scene.case)
    for material in given["material"].values():
        factor = float(10.0 ** rng.uniform(-0.7, 0.7))
        material.update({key: factor * material[key] for key in MODULI if key in material})
        if "nu" in material:
            material["nu"] = float(rng.choice(POISSON_RATIOS))
    larger = Frame(np.eye(2), force=float(rng.uniform(0.5, 1.6)))
    for load in given.get("load", []):
        larger.load(load)
    for contact in given.get("contact", []):
        friction = contact.get("friction")
        if isinstance(friction, float):
            contact["friction"] = float(rng.uniform(0.6, 1.5)) * friction or float(
                rng.choice([0.0, 0.0, 0.1, 0.3])
            )
        if isinstance(contact.get("interference"), float):
            contact["interference"] *= float(rng.uniform(0.6, 1.4))
    if rng.random() < 0.3:
        given["model"]["plane"] = PLANES[given["model"]["plane"]]
    # References are found by name.
    name = f"{scene.name} altered"
    return replace(scene, name=name, case=given, figures=(), refusal=None, elements=False)


def _seeded(given: Table) -> Table:
    made = copy.deepcopy(given)
    for number, one in enumerate(made["body"]):
        if not has_nodes(one):
            one["seed"] = 11 + number
    return made


def _swapped(given: Table) -> Table:
    made = copy.deepcopy(given)
    for one in made.get("contact", []):
        if "master" in one:
            one["slave"], one["master"] = one["master"], one["slave"]
    return made


@dataclass(frozen=True)
class Frame:
    """Where a case is written anew: turned or mirrored by a ``matrix``, in other units, with loads times
    ``force``."""

    matrix: Array
    length: float = 1.0
    stress: float = 1.0
    force: float = 1.0

    @classmethod
    def turned(cls, angle: float, length: float = 1.0, stress: float = 1.0) -> Frame:
        """Turned by an angle in degrees."""
        c, s = (float(np.round(v, 15)) for v in (np.cos(np.radians(angle)), np.sin(np.radians(angle))))
        return cls(np.array([[c, -s], [s, c]]), length, stress)

    @property
    def _sign(self) -> float:
        return float(round(np.linalg.det(self.matrix)))

    def unit(self, powers: tuple[int, int]) -> float:
        return self.length ** powers[0] * self.stress ** powers[1]

    def case(self, given: Table) -> Table:
        """Places, directions, names of sides and units of a case."""
        made = copy.deepcopy(given)
        for one in made["material"].values():
            one.update({key: one[key] * self.stress for key in MODULI if key in one})
            if "E1" in one or "angle" in one:
                one["angle"] = self._angles([one.get("angle", 0.0)])[0]
        shapes = {one["name"]: one["shape"]["kind"] for one in made["body"]}
        for one in made["body"]:
            self._shape(one["shape"])
            if isinstance(one.get("spacing"), float):
                one["spacing"] *= self.length
        for one in made.get("support", []):
            self._axes(one, ("ux", "uy"), 1.0)
            if "spring" in one:
                one["spring"] = (self.unit((-1, 1)) * self.matrix**2 @ one["spring"]).tolist()
        for one in made.get("load", []):
            self.load(one)
        for one in made.get("contact", []):
            for key in ("interference", "reach", "gap"):
                if key in one:
                    one[key] = self._scalar(one[key], self.length)
            self._obstacle(one.get("obstacle", {}))
        for one in (one for key in ("support", "load", "contact", "probe") for one in made.get(key, [])):
            self._places(one, "near", "from", "to", "hinge", "pivot", "point")
            for key in ("boundary", "slave", "master"):
                if key in one:
                    sides = [self._side(side, shapes) for side in listed(one[key])]
                    one[key] = sides if isinstance(one[key], list) else sides[0]
        return made

    def load(self, one: Table) -> None:
        for key, powers in SCALARS.items():
            sign = self._sign if key in ("moment", "rotation") else 1.0
            if key in one and one[key] not in ("free", "fixed"):
                one[key] = self._scalar(one[key], sign * self.force * self.unit(powers))
        for key, powers in VECTORS.items():
            if key in one:
                one[key] = self._vector(one[key], self.force * self.unit(powers))
        for names, powers in AXES.items():
            self._axes(one, names, self.force * self.unit(powers))

    def place(self, place: list[float]) -> list[float]:
        return [float(v) for v in self.length * (self.matrix @ np.array(place))]

    def _places(self, one: Table, *keys: str) -> None:
        for key in keys:
            if key in one:
                nested = key == "points"
                one[key] = [self.place(p) for p in one[key]] if nested else self.place(one[key])

    def _scalar(self, value: Any, by: float) -> Any:
        """A number, or an expression of the places it is moved to."""
        if not isinstance(value, str):
            return value * by
        x, y = (
            " + ".join(f"{v / self.length!r}*{c}" for v, c in zip(row, "xy", strict=True))
            for row in self.matrix.T.tolist()
        )
        text = re.sub(r"\b[xy]\b", lambda found: f"({x if found[0] == 'x' else y})", value)
        return text if by == 1.0 else f"{by!r}*({text})"

    def _vector(self, values: list[Any], by: float) -> list[Any]:
        if not any(isinstance(one, str) for one in values):
            return [float(v) for v in by * (self.matrix @ np.array(values))]
        moved = [self._scalar(one, by) if isinstance(one, str) else f"{by * one}" for one in values]
        return [
            " + ".join(f"{v:g}*({one})" for v, one in zip(row, moved, strict=True)) for row in self.matrix
        ]

    def _axes(self, one: Table, names: tuple[str, str], by: float) -> None:
        """Components by their names; those that are not named stay so."""
        given = [key in one for key in names]
        values = [one.pop(key, 0.0) for key in names]
        if any(isinstance(value, str) for value in values):
            values = self._vector(values, by)
        else:
            values = (by * (self.matrix @ np.array(values)) + 0.0).tolist()
        named = np.abs(self.matrix) @ np.array(given, float)
        one.update({key: v for key, v, yes in zip(names, values, named, strict=True) if yes})

    def _renamed(self, side: str, order: tuple[str, ...]) -> str:
        """The name of a side of a square whose normal is turned."""
        at = np.array([(1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (0.0, -1.0)])
        return order[int(np.argmax(at @ (self.matrix @ at[order.index(side)])))]

    def _side(self, boundary: str, shapes: dict[str, str]) -> str:
        name, _, side = boundary.partition(".")
        if shapes[name] == "rectangle":
            side = self._renamed(side, SQUARE)
        if shapes[name] == "sector" and self._sign < 0.0:
            side = {"start": "end", "end": "start"}.get(side, side)
        return f"{name}.{side}"

    def _angles(self, angles: list[float]) -> list[float]:
        """Of a body's axes or arcs, by the angle of the turned x axis."""
        turn = float(np.degrees(np.arctan2(self.matrix[1, 0], self.matrix[0, 0])))
        return [turn + self._sign * angle for angle in (angles if self._sign > 0.0 else angles[::-1])]

    def _shape(self, shape: Table) -> None:
        if shape["kind"] == "rectangle":
            corners = np.array([self.place([shape["x"][i], shape["y"][i]]) for i in (0, 1)])
            shape["x"], shape["y"] = np.sort(corners, axis=0).T.tolist()
        if "side" in shape:
            shape["side"] = self._renamed(shape["side"], HALVES)
        if "angles" in shape:
            shape["angles"] = self._angles(shape["angles"])
        for one in (shape, *shape.get("sides", []), *shape.get("holes", [])):
            self._places(one, "center", "points", "to")
            for key in ("radius", "radii", "rounding"):
                if key in one:
                    one[key] = (self.length * np.array(one[key])).tolist()

    def _obstacle(self, obstacle: Table) -> None:
        self._places(obstacle, "point", "center", "points")
        if "normal" in obstacle:
            obstacle["normal"] = [float(v) for v in self.matrix @ np.array(obstacle["normal"])]
        if "radius" in obstacle:
            obstacle["radius"] *= self.length
        if "points" in obstacle and self._sign < 0.0:
            obstacle["points"] = obstacle["points"][::-1]
