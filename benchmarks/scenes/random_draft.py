"""Bodies, loads and figures of random scenes, drawn upright and written in a frame."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from benchmarks.scenes.parts import Pair, case, platen, polygon, pressed
from benchmarks.scenes.parts import body as make_body
from benchmarks.scenes.random_frames import Frame
from benchmarks.scenes.scene import Array, Figure, Result, Table

Rng = np.random.Generator
SLIDES = ("slid", "slip")
TIPS = ("tip", "tilt", "turn", "rotat")
SPINS = (*SLIDES, "turn", "rotat", "spin")
"""Words that must tell what a scene does beyond its limit load."""


@dataclass(frozen=True)
class Draft:
    """What is drawn upright in mm and N, written in a frame."""

    rng: Rng
    frame: Frame

    def friction(self, least: float = 0.01, most: float = 1.5) -> float:
        return float(np.exp(self.rng.uniform(np.log(least), np.log(most))))

    def between(self, low: float, high: float) -> float:
        return float(self.rng.uniform(low, high))

    def materials(self, *names: str) -> tuple[dict[str, Table], float]:
        """Moduli within a factor of 100 of each other, and the least of them, upright."""
        level = 10.0 ** self.between(1.0, 5.0)
        moduli = {name: level * 10.0 ** self.between(0.0, 2.0 * (i > 0)) for i, name in enumerate(names)}
        made = {
            name: {"E": E * self.frame.stress, "nu": self.between(0.0, 0.45)} for name, E in moduli.items()
        }
        return made, level

    def block(self, name: str, material: str, x: Pair, y: Pair, rounding: float = 0.0) -> Table:
        """Sides foot, right, head, left; rounded corners belong to foot and head."""
        corners = [(x[0], y[0]), (x[1], y[0]), (x[1], y[1]), (x[0], y[1])]
        more: Table = {}
        if rounding:
            more = {
                "rounding": [rounding * self.frame.length] * 4,
                "corners": ["foot", "foot", "head", "head"],
            }
        names = ["foot", "right", "head", "left"]
        return polygon(name, material, self.frame.places(corners), names=names, **more)

    def ring(self, name: str, material: str, at: Pair, radii: Pair) -> Table:
        scaled = [r * self.frame.length for r in radii]
        return make_body(name, material, "annulus", center=self.frame.at(*at), radii=scaled)

    def disk(self, name: str, material: str, at: Pair, radius: float) -> Table:
        return make_body(name, material, "disk", center=self.frame.at(*at), radius=radius * self.frame.length)

    def plane(self, name: str, slave: str, point: Pair, normal: Pair, friction: float) -> Table:
        obstacle = {"kind": "plane", "point": self.frame.at(*point), "normal": self.frame.turned(*normal)}
        return {"name": name, "slave": slave, "obstacle": obstacle, "friction": friction}

    def plate(self, name: str, side: str, x: float, y: float) -> Table:
        return platen(name, side, force=self.frame.force(x, y))

    def twist(self, name: str, side: str, moment: float, **more: object) -> Table:
        return platen(name, side, moment=moment * self.frame.length**2 * self.frame.stress, **more)

    def pressure(self, name: str, side: str, value: float, ends: Sequence[Pair] = ()) -> Table:
        part = dict(zip(("from", "to"), self.frame.places(list(ends)), strict=False))
        return pressed(name, side, value * self.frame.stress) | part

    def along(self, result: Result, contact: str) -> Array:
        """Its force, upright in N."""
        axes = np.array([self.frame.turned(1.0, 0.0), self.frame.turned(0.0, 1.0)])
        return np.asarray(axes @ result.force(contact)) / (self.frame.length * self.frame.stress)

    def figure(
        self, contact: str, axis: int, true: float, limit: float = 1.0, scale: float | None = None
    ) -> Figure:
        return Figure(
            f"{contact} {'xy'[axis]}", lambda r: float(self.along(r, contact)[axis]), true, limit, scale
        )

    def case(self, materials: dict[str, Table], bodies: list[Table], **rest: object) -> Table:
        return case(str(self.rng.choice(["strain", "stress"])), materials, bodies, **rest)
