"""What a scene is: a case as a user writes it, and the figures by which its result is judged."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Table = dict[str, Any]
Pair = tuple[float, float]
Move = Callable[[Array], Array]
"""Places (n, 2) of a scene to those of a variant."""

FORCE, PEAK, PLACE = 1.0, 3.0, 3.0
"""Limits in percent of forces, peak pressures and displacements."""


@dataclass(frozen=True)
class Result:
    """What a run has told: summary.json, and its directory."""

    summary: Table
    folder: Path

    def force(self, contact: str) -> Array:
        """Force (2,) on the slave."""
        return np.array(self.summary["contacts"][contact]["force"])

    def peak(self, contact: str) -> float:
        return float(self.summary["contacts"][contact]["peak_pressure"])

    def pressed(self, contact: str) -> float:
        """Integral of the pressure."""
        with h5py.File(self.folder / "run.h5") as file:
            one = file[f"contacts/{contact}"]
            return float(one["pressure"][-1] @ one["weight"][:])

    def size(self, contact: str) -> float:
        """Integral of the size of pressure and traction."""
        with h5py.File(self.folder / "run.h5") as file:
            one = file[f"contacts/{contact}"]
            return float(np.hypot(one["pressure"][-1], one["traction"][-1]) @ one["weight"][:])

    def half_width(self, contact: str) -> float:
        return float(self.summary["contacts"][contact]["half_width"])

    def moved(self, probe: str) -> Array:
        """Displacement (2,) of a probe."""
        return np.array(self.summary["probes"][probe]["displacement"])

    def exerted(self, name: str) -> Array:
        """Force (2,) of a load or support on its body."""
        return np.array(self.summary["forces"][name])

    def carried(self, load: str) -> Array:
        """Displacement (2,) of the platen or obstacle that a load moves."""
        with h5py.File(self.folder / "run.h5") as file:
            return np.array(file[f"path/displacements/{load}"][-1])

    def patches(self, contact: str) -> int:
        """Connected parts that touch in the last state."""
        with h5py.File(self.folder / "run.h5") as file:
            pressure = file[f"contacts/{contact}/pressure"][-1]
        closed = np.concatenate([[False], pressure > 1e-3 * pressure.max(), [False]])
        return int((closed[1:] & ~closed[:-1]).sum())


@dataclass(frozen=True)
class Figure:
    """One figure of a result, its true value, and by how many percent it may be off."""

    what: str
    got: Callable[[Result], float]
    true: float
    limit: float = FORCE
    scale: float | None = None
    """What the error is relative to, for values that may be zero; by default the true value."""

    def error(self, got: float) -> float:
        """In percent."""
        return 100.0 * (got - self.true) / (self.scale or abs(self.true))


def force_at(contact: str, axis: int, sign: float = 1.0) -> Callable[[Result], float]:
    """What reads one component of a contact's force."""
    return lambda result: sign * float(result.force(contact)[axis])


def size_of(contact: str) -> Callable[[Result], float]:
    """What reads how large the horizontal force of a contact is."""
    return lambda result: abs(float(result.force(contact)[0]))


@dataclass(frozen=True)
class Refusal:
    """That a scene has no equilibrium beyond a position on its path, and words that must tell so.

    Without a position the words are to be told in any case, as a warning or as an error.
    """

    words: tuple[str, ...]
    position: float | None
    limit: float = 2.0


@dataclass(frozen=True)
class Scene:
    """A case, judged. ``files`` write what the case names, moved as a variant is and scaled.

    ``missing`` names the key that the scene would need; such a scene is counted, not run.
    """

    name: str
    kind: str
    case: Table = field(default_factory=dict)
    figures: Sequence[Figure] = ()
    refusal: Refusal | None = None
    files: Mapping[str, Callable[[Path, Move], None]] = field(default_factory=dict)
    missing: str = ""
    elements: bool = False
    """Whether finite elements tell its forces, peaks and displacements, see elements.py."""
    supports: Sequence[Table] = ()
    """What holds loose bodies in finite elements against motions that only turned directions drive."""
    straight_walls: bool = False
    """Whether round bodies slide along straight sides that do not turn, whose normals are those of contacts
    then; otherwise the elements take the more curved surface's, as straight ones turn."""


SCENES: dict[str, Callable[[], Scene]] = {}


def scene(make: Callable[[], Scene]) -> Callable[[], Scene]:
    """Registers a function that makes a scene of its own name; it is made once."""
    SCENES[make.__name__] = cache(make)
    return make


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


def listed(boundaries: str | list[str]) -> list[str]:
    """One boundary, or several, as a list."""
    return [boundaries] if isinstance(boundaries, str) else boundaries


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
