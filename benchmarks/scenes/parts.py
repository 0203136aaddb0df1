"""Tables of a case: bodies, supports, contacts, loads."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from benchmarks.scenes.scene import Table

Pair = tuple[float, float]


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


def solid(E: float, nu: float, **rest: Any) -> Table:
    return {"E": E, "nu": nu, **rest}


def body(name: str, material: str, kind: str, **shape: Any) -> Table:
    return {"name": name, "material": material, "shape": {"kind": kind, **shape}}


def box(name: str, material: str, x: Pair, y: Pair) -> Table:
    return body(name, material, "rectangle", x=list(x), y=list(y))


def polygon(name: str, material: str, points: Sequence[Pair], **shape: Any) -> Table:
    return body(name, material, "polygon", points=[list(map(float, p)) for p in points], **shape)


def held(boundary: str, *directions: str) -> Table:
    return {"boundary": boundary} | dict.fromkeys(directions or ("ux", "uy"), 0.0)


def pinned(name: str, near: Pair, *directions: str) -> Table:
    return {"body": name, "near": list(near)} | dict.fromkeys(directions or ("ux", "uy"), 0.0)


def pair(name: str, slave: str, master: str, friction: float | str = 0.0, **rest: Any) -> Table:
    return {"name": name, "slave": slave, "master": master, "friction": friction, **rest}


def on_plane(name: str, slave: str | list[str], point: Pair, normal: Pair, friction: float = 0.0) -> Table:
    obstacle = {"kind": "plane", "point": list(point), "normal": list(normal)}
    return {"name": name, "slave": slave, "obstacle": obstacle, "friction": friction}


def on_disk(name: str, slave: str, center: Pair, radius: float, friction: float = 0.0, **rest: Any) -> Table:
    obstacle = {"kind": "disk", "center": list(center), "radius": radius, **rest}
    return {"name": name, "slave": slave, "obstacle": obstacle, "friction": friction}


def platen(name: str, boundary: str, **rest: Any) -> Table:
    return {"name": name, "boundary": boundary, "kind": "platen", **rest}


def pushed(name: str, obstacle: str, **rest: Any) -> Table:
    return {"name": name, "obstacle": obstacle, "kind": "obstacle", **rest}


def pressed(name: str, boundary: str, pressure: float) -> Table:
    return {"name": name, "boundary": boundary, "kind": "pressure", "pressure": pressure}


def weighed(name: str, body_name: str, x: float, y: float) -> Table:
    return {"name": name, "body": body_name, "kind": "body-force", "body-force": [x, y]}


def probe(name: str, body_name: str, x: float, y: float) -> Table:
    return {"name": name, "body": body_name, "point": [x, y]}
