"""The same scene written differently: turned, mirrored, in other units, with other clouds, roles swapped.

Every variant changes the case, and knows how vectors of its results turn back.
"""

from __future__ import annotations

import copy
import re
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from benchmarks.scenes.scene import Array, Move, Pair, Table, listed

LENGTH, STRESS = 1e3, 1e-6
"""From metres and pascals to millimetres and megapascals; the other way round is as good a test."""

PLACES = ("from", "to", "hinge", "pivot")
"""Keys of supports, loads and contacts that are places."""
TURN = np.array([[0.0, -1.0], [1.0, 0.0]])
MIRROR = np.array([[-1.0, 0.0], [0.0, 1.0]])
SIDES = {
    "turned": dict(zip(("right", "top", "left", "bottom"), ("top", "left", "bottom", "right"), strict=True))
}
SIDES["mirrored"] = {"left": "right", "right": "left", "bottom": "bottom", "top": "top"}
HALVES = {
    "turned": dict(
        zip(("right", "upper", "left", "lower"), ("upper", "left", "lower", "right"), strict=True)
    ),
    "mirrored": {"left": "right", "right": "left", "upper": "upper", "lower": "lower"},
}


Spacings = tuple[float, dict[str, tuple[float, dict[Pair, float]]]]
"""Spacing of a body far from its refinements; along each of its sides that of half its length, and those at
its ends and where they are least, by place."""
FINER = 0.6
"""Spacings below this part of those far away are refined ones."""


@dataclass(frozen=True)
class Variant:
    """``change`` makes its case of the scene's, ``matrix`` (2, 2) turns places, the others scale units."""

    name: str
    change: Callable[[Table], Table]
    matrix: Array
    length: float = 1.0
    stress: float = 1.0

    def move(self) -> Move:
        return lambda places: self.length * places @ self.matrix.T


def variants() -> list[Variant]:
    """All of them but for the halved spacing, which needs the run's own clouds: see ``halved``."""
    still = np.eye(2)
    return [
        Variant("seed", _seeded, still),
        Variant("swapped", _swapped, still),
        Variant("turned", lambda given: _moved(given, TURN, "turned"), TURN),
        Variant("mirrored", lambda given: _moved(given, MIRROR, "mirrored"), MIRROR),
        Variant("units", _scaled, still, LENGTH, STRESS),
    ]


def halved(given: Table, spacings: dict[str, Spacings]) -> Variant:
    """Half of the spacing that every body had in its first run, but for nodes of files."""
    made = respaced(given, spacings, 0.5)
    return Variant("halved", lambda _: made, np.eye(2))


def respaced(given: Table, spacings: dict[str, Spacings], factor: float) -> Table:
    """A ``factor`` times the spacing that every body had in its first run, and of finer ones along its
    contacts, but for nodes of files."""
    made = copy.deepcopy(given)
    sides = {
        side
        for one in made.get("contact", [])
        for key in ("slave", "master")
        if key in one
        for side in listed(one[key])
    }
    for one in made["body"]:
        if has_nodes(one):
            continue
        name = one["name"]
        far, along = spacings[name]
        one["spacing"] = factor * far
        one["refine"] = []
        fine: dict[Pair, float] = {}
        for side, (h, places) in along.items():
            if f"{name}.{side}" in sides and h < far:
                one["refine"].append(_finer(factor * h) | {"along": side})
            fine |= {place: least for place, least in places.items() if least < FINER * far}
        one["refine"] += [_finer(factor * least) | {"at": list(place)} for place, least in fine.items()]
    return made


def _finer(spacing: float) -> Table:
    """A zone whose spacings grow as automatic ones do."""
    return {"spacing": spacing, "radius": 0.0, "growth": 0.15}


def has_nodes(one: Table) -> bool:
    """Whether a body's nodes are those of its file."""
    return one["shape"]["kind"] in ("mesh", "points") and one["shape"].get("use", "nodes") == "nodes"


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


def _scaled(given: Table) -> Table:
    """Lengths by LENGTH, stresses by STRESS, forces per thickness by both."""
    made = copy.deepcopy(given)
    for one in made["material"].values():
        one.update({key: one[key] * STRESS for key in ("E", "E1", "E2", "E3", "G12") if key in one})
    for one in made["body"]:
        shape = one["shape"]
        for key in ("x", "y", "center", "radius", "radii", "points", "rounding"):
            if key in shape:
                shape[key] = times(shape[key], LENGTH)
        for side in shape.get("sides", []):
            side.update({key: times(side[key], LENGTH) for key in ("to", "points") if key in side})
        for hole in shape.get("holes", []):
            hole.update({key: times(hole[key], LENGTH) for key in ("center", "radius")})
        if isinstance(one.get("spacing"), float):
            one["spacing"] *= LENGTH
    for one in made.get("support", []):
        if "near" in one:
            one["near"] = times(one["near"], LENGTH)
        if "spring" in one:
            one["spring"] = times(one["spring"], STRESS / LENGTH)
    for one in made.get("load", []):
        for keys, by in (
            (("traction", "pressure"), STRESS),
            (("force", "fx", "fy"), STRESS * LENGTH),
            (("moment",), STRESS * LENGTH**2),
            (("displacement", "ux", "uy"), LENGTH),
            (("body-force",), STRESS / LENGTH),
        ):
            one.update({key: times(one[key], by, LENGTH) for key in keys if key in one})
        if isinstance(one.get("temperature"), str):
            one["temperature"] = times(one["temperature"], 1.0, LENGTH)
    for one in made.get("contact", []):
        one.update(
            {key: times(one[key], LENGTH, LENGTH) for key in ("interference", "reach", "gap") if key in one}
        )
        if "obstacle" in one:
            obstacle = one["obstacle"]
            for key in ("point", "center", "radius", "points"):
                if key in obstacle:
                    obstacle[key] = times(obstacle[key], LENGTH)
    for one in made.get("probe", []):
        one["point"] = times(one["point"], LENGTH)
    for one in (*made.get("load", []), *made.get("contact", []), *made.get("support", [])):
        one.update({key: times(one[key], LENGTH) for key in PLACES if key in one})
    return made


def times(value: object, by: float, length: float = 1.0) -> object:
    """A number, an expression in x and y or a list of them, multiplied, where lengths are multiplied by
    ``length``; words like "free" stay."""
    if isinstance(value, list):
        return [times(one, by, length) for one in value]
    if isinstance(value, str):
        inside = re.sub(r"\b([xy])\b", rf"(\1/{length})", value)
        return value if value.isalpha() and len(value) > 1 else f"{by!r}*({inside})"
    return value * by  # type: ignore[operator]


def _moved(given: Table, matrix: Array, how: str) -> Table:
    """Places, directions and names of sides."""
    made = copy.deepcopy(given)
    shapes = {one["name"]: one["shape"]["kind"] for one in made["body"]}
    for one in made["material"].values():
        if "E1" in one or "angle" in one:
            angle = one.get("angle", 0.0)
            one["angle"] = angle + 90.0 if how == "turned" else 180.0 - angle
    for one in made["body"]:
        _shape(one["shape"], matrix, how)
    for one in made.get("support", []):
        _conditions(one, matrix)
        if "spring" in one:
            one["spring"] = [abs(v) for v in (matrix @ np.array(one["spring"])).tolist()]
    for one in made.get("load", []):
        _load(one, matrix)
    for one in made.get("contact", []):
        if "obstacle" in one:
            _obstacle(one["obstacle"], matrix, how)
        if isinstance(one.get("gap"), str):
            one["gap"] = _replaced(one["gap"], matrix)
    for one in made.get("probe", []):
        one["point"] = _turn(one["point"], matrix)
    for key in ("support", "load", "contact"):
        for one in made.get(key, []):
            one.update({place: _turn(one[place], matrix) for place in PLACES if place in one})
            for side in ("boundary", "slave", "master"):
                if side in one:
                    named = [_side(boundary, shapes, how) for boundary in listed(one[side])]
                    one[side] = named if isinstance(one[side], list) else named[0]
    return made


def _turn(place: list[float], matrix: Array) -> list[float]:
    return [float(v) for v in matrix @ np.array(place)]


def _side(boundary: str, shapes: dict[str, str], how: str) -> str:
    name, _, side = boundary.partition(".")
    if shapes[name] == "rectangle":
        side = SIDES[how][side]
    if shapes[name] == "sector" and how == "mirrored":
        side = {"start": "end", "end": "start"}.get(side, side)
    return f"{name}.{side}"


def _shape(shape: Table, matrix: Array, how: str) -> None:
    if shape["kind"] == "rectangle":
        corners = np.array([[shape["x"][i], shape["y"][i]] for i in (0, 1)]) @ matrix.T
        shape["x"], shape["y"] = ([float(v) for v in sorted(axis)] for axis in corners.T)
    if "center" in shape:
        shape["center"] = _turn(shape["center"], matrix)
    if "side" in shape:
        shape["side"] = HALVES[how][shape["side"]]
    if "angles" in shape:
        a, b = shape["angles"]
        shape["angles"] = [a + 90.0, b + 90.0] if how == "turned" else [180.0 - b, 180.0 - a]
    if "points" in shape:
        shape["points"] = [_turn(place, matrix) for place in shape["points"]]
    for side in shape.get("sides", []):
        if "to" in side:
            side["to"] = _turn(side["to"], matrix)
        if "points" in side:
            side["points"] = [_turn(place, matrix) for place in side["points"]]
    for hole in shape.get("holes", []):
        hole["center"] = _turn(hole["center"], matrix)


def _conditions(one: Table, matrix: Array) -> None:
    """Zero displacements in the directions that are named."""
    if "near" in one:
        one["near"] = _turn(one["near"], matrix)
    given = [key in one for key in ("ux", "uy")]
    for key in ("ux", "uy"):
        one.pop(key, None)
    for key, yes in zip(("ux", "uy"), np.abs(matrix) @ np.array(given, float), strict=True):
        if yes:
            one[key] = 0.0


def _load(one: Table, matrix: Array) -> None:
    for key in ("rotation", "moment"):
        if isinstance(one.get(key), float):
            one[key] *= float(round(np.linalg.det(matrix)))
    for key in ("traction", "force", "displacement", "body-force"):
        if key in one:
            one[key] = _vector(one[key], matrix)
    for key in ("pressure", "temperature"):
        if isinstance(one.get(key), str):
            one[key] = _replaced(one[key], matrix)
    for x, y in (("fx", "fy"), ("ux", "uy")):
        named = [key in one for key in (x, y)]
        values = matrix @ np.array([one.pop(x, 0.0), one.pop(y, 0.0)])
        yes = np.abs(matrix) @ np.array(named, float)
        one.update({key: float(v) for key, v, on in zip((x, y), values, yes, strict=True) if on})


def _vector(values: list[float | str], matrix: Array) -> list[float | str]:
    """Components turned with the scene, each a number or an expression."""
    if not any(isinstance(one, str) for one in values):
        return _turn(values, matrix)  # type: ignore[arg-type, return-value]
    moved = [_replaced(one, matrix) if isinstance(one, str) else f"{one}" for one in values]
    return [" + ".join(f"{by:g}*({one})" for by, one in zip(row, moved, strict=True)) for row in matrix]


def _replaced(text: str, matrix: Array) -> str:
    """An expression of x and y, of the places it is moved to."""
    back = matrix.T
    new = {"x": f"({back[0, 0]:g}*x+{back[0, 1]:g}*y)", "y": f"({back[1, 0]:g}*x+{back[1, 1]:g}*y)"}
    return re.sub(r"\b[xy]\b", lambda found: new[found[0]], text)


def _obstacle(obstacle: Table, matrix: Array, how: str) -> None:
    for key in ("point", "normal", "center"):
        if key in obstacle:
            obstacle[key] = _turn(obstacle[key], matrix)
    if "points" in obstacle:
        places = [_turn(place, matrix) for place in obstacle["points"]]
        obstacle["points"] = places[::-1] if how == "mirrored" else places
