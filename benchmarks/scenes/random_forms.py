"""Random scenes of less regular bodies, supports and loads, in any frame and any units.

Drawn for ``random_scenes.py --forms``: feet and heads of polygons with re-entrant corners, blocks with slots,
holes or an arch, shallow waves, noses through points, half rings; bases held at a part, on rollers or springs
on parts, or of two bonded layers of very unlike stiffness; pressures on parts, moments, weight, heat that
varies; unloading and reversed friction.
"""

from __future__ import annotations

import numpy as np

from benchmarks.scenes.parts import Pair, body, held, platen, polygon
from benchmarks.scenes.random_frames import Frame, FramedScene
from benchmarks.scenes.scene import Array, Table

Corners = list[Pair]


def formed(number: int, frame: Frame) -> tuple[Table, list[str], list[str]]:
    """The case of a number in a frame, the contacts that no sharp corner can reach, what it is made of."""
    made = _Form(frame, np.random.default_rng([23, number]))
    made.base()
    made.upper()
    made.press()
    return made.case(), made.smooth, made.words


class _Form(FramedScene):
    """A scene while it is drawn; the base's face is at y = 0."""

    half = 0.0
    """Half of the base's width."""
    deep = 0.0
    wide = 0.0
    high = 0.0
    bent = False
    """Whether the upper body has a face that no corner ends."""

    def sided(self, name: str, places: Corners, names: list[str], **more: object) -> Table:
        return polygon(name, self.material(name), self.frame.places(places), names=names, **more)

    def wave(self, x: Array) -> list[Pair]:
        """A shallow wave through points on its crest at 0."""
        waves, size = int(self.rng.integers(1, 4)), float(10.0 ** self.rng.uniform(-3.5, -2.0)) * np.ptp(x)
        y = 0.5 * size * (np.cos(2.0 * np.pi * waves * x / np.ptp(x)) - 1.0)
        return list(zip(x.tolist(), y.tolist(), strict=True))

    def base(self) -> str:
        """The lower body, and its layer."""
        rng, frame = self.rng, self.frame
        x, d = float(rng.uniform(5.0, 8.0)), float(rng.uniform(3.0, 5.0))
        self.half, self.deep = x, d
        kind = self.chosen("ell", "slot", "holes", "arch", "wavy", "layer", "parts", "ring")
        if kind == "ell":
            corners = [(-x, -d), (0.3 * x, -d), (0.3 * x, -0.5 * d), (x, -0.5 * d), (x, 0.0), (-x, 0.0)]
            more = (
                {"rounding": [0.0, 0.0, 0.15 * d * frame.length, 0.0, 0.0, 0.0]} if rng.random() < 0.6 else {}
            )
            made = self.sided("base", corners, ["foot", "step", "under", "right", "head", "left"], **more)
        elif kind == "slot":
            low, top, depth = -0.6 * d, -0.4 * d, float(rng.uniform(-0.4, 0.5)) * x
            corners = [(-x, -d), (x, -d), (x, low), (depth, low), (depth, top), (x, top), (x, 0.0), (-x, 0.0)]
            rounded = 0.08 * d * frame.length
            made = self.sided(
                "base",
                corners,
                ["foot", "right", "lower", "end", "upper", "lip", "head", "left"],
                rounding=[0.0, 0.0, 0.0, rounded, rounded, 0.0, 0.0, 0.0],
            )
        elif kind == "holes":
            radius = float(rng.uniform(0.1, 0.25)) * d
            holes = [
                {"center": frame.at(place * x, -0.5 * d), "radius": radius * frame.length}
                for place in rng.permutation([-0.6, -0.2, 0.2, 0.6])[: int(rng.integers(1, 4))]
            ]
            made = self.sided("base", _box(x, -d, 0.0), ["foot", "right", "head", "left"], holes=holes)
        elif kind == "arch":
            s = np.linspace(-0.5, 0.5, 13)
            under = [(float(v) * x, -d + 0.5 * d * float(np.cos(np.pi * v))) for v in s]
            feet = frame.places([(-x, 0.0), (-x, -d), (-0.5 * x, -d), (x, -d), (x, 0.0)])
            sides = [
                {"name": "left", "to": feet[1]},
                {"name": "foot", "to": feet[2]},
                {"name": "under", "points": frame.places(under)},
                {"name": "foot", "to": feet[3]},
                {"name": "right", "to": feet[4]},
                {"name": "head", "to": feet[0]},
            ]
            made = body("base", self.material("base"), "outline", sides=sides)
        elif kind == "wavy":
            ends = frame.places([(-x, -d), (x, -d)])
            sides = [
                {"name": "head", "points": frame.places(self.wave(np.linspace(x, -x, 61)))},
                {"name": "left", "to": ends[0]},
                {"name": "foot", "to": ends[1]},
                {"name": "right"},
            ]
            made = body("base", self.material("base"), "outline", sides=sides)
        elif kind == "ring":
            radii = [float(rng.uniform(1.2, 2.0)) * x * frame.length, 0.0]
            radii[1] = radii[0] + float(rng.uniform(0.3, 0.8)) * d * frame.length
            center = frame.turned(0.0, -radii[1])
            angles = [frame.angle + 90.0 - 35.0, frame.angle + 90.0 + 35.0]
            made = body("base", self.material("base"), "sector", center=center, radii=radii, angles=angles)
        else:
            made = self.sided("base", _box(x, -d, 0.0), ["foot", "right", "head", "left"])
        self.add(made, d)
        if kind == "layer":
            thick = float(rng.uniform(0.15, 0.4)) * d
            made["shape"]["points"] = frame.places(_box(x, -d, -thick))
            self.add(self.sided("layer", _box(x, -thick, 0.0), ["foot", "right", "head", "left"]), thick)
            made["material"] = self.unlike("base")
            self.tables["contact"].append(
                {"name": "bond", "slave": "layer.foot", "master": "base.head", "friction": "bonded"}
            )
        self.supported(kind)
        return kind

    def unlike(self, name: str) -> str:
        """A material a hundred times stiffer or softer than it was."""
        by = float(self.rng.choice([0.01, 100.0]))
        material = self.materials[name]
        material.update(
            {key: material[key] * by for key in ("E", "E1", "E2", "E3", "G12") if key in material}
        )
        self.soft = min(
            min(one.get("E", one.get("E2")) for one in self.materials.values()) / self.frame.stress, self.soft
        )
        return name

    def supported(self, kind: str) -> None:
        """Held at its foot or at parts of it."""
        x, d, supports = self.half, self.deep, self.tables["support"]
        if kind == "ring":
            supports += [held("base.start"), held("base.end")]
            return
        if kind != "parts":
            supports.append(held("base.foot"))
            return
        how = self.chosen("rollers", "springs", "clamp")
        k = 0.2 * self.soft / d * self.frame.stress / self.frame.length
        for a, b in ((-1.0, -0.6), (0.5, 0.9)):
            part = dict(zip(("from", "to"), self.frame.places([(a * x, -d), (b * x, -d)]), strict=True))
            if how == "springs":
                supports.append({"boundary": "base.foot", "spring": [k, k], **part})
            elif how == "clamp" or a < -0.9 or self.frame.angle % 90.0:
                supports.append({**held("base.foot"), **part})
            else:
                along = "ux" if round(self.frame.angle / 90.0) % 2 else "uy"
                supports.append({"boundary": "base.foot", along: 0.0, **part})

    def upper(self) -> None:
        """The body above, and its contact."""
        rng, frame = self.rng, self.frame
        wide, high = float(rng.uniform(2.5, 0.8 * self.half)), float(rng.uniform(2.0, 4.0))
        self.wide, self.high = wide, high
        kind = self.chosen("tee", "notch", "nose", "wave", "half-ring", "chamfer", "holed")
        w = 0.5 * wide
        named = ["foot", "right", "head", "left"]
        inside = -0.2 * w, 0.8 * high
        self.bent = kind in ("nose", "wave", "half-ring", "chamfer")
        if kind == "tee":
            inner, mid, r = 0.5 * w, 0.5 * high, 0.1 * high * frame.length
            if rng.random() < 0.5:  # the flange stands on the base
                corners = [(-w, 0.0), (w, 0.0), (w, mid), (inner, mid), (inner, high)]
                corners += [(-inner, high), (-inner, mid), (-w, mid)]
                names = ["foot", "toe", "right", "web", "head", "flank", "left", "heel"]
                rounding = [0.0, 0.0, 0.0, r, 0.0, 0.0, r, 0.0]
            else:
                corners = [(-inner, 0.0), (inner, 0.0), (inner, mid), (w, mid), (w, high)]
                corners += [(-w, high), (-w, mid), (-inner, mid)]
                names = ["foot", "web", "right", "toe", "head", "heel", "left", "flank"]
                rounding = [0.0, 0.0, r, 0.0, 0.0, 0.0, 0.0, r]
            more = {"rounding": rounding} if rng.random() < 0.7 else {}
            made = self.sided("top", corners, names, **more)
        elif kind == "notch":
            low, top, r = 0.4 * high, 0.6 * high, 0.06 * high * frame.length
            corners = [
                (-w, 0.0),
                (w, 0.0),
                (w, low),
                (0.2 * w, low),
                (0.2 * w, top),
                (w, top),
                (w, high),
                (-w, high),
            ]
            names = ["foot", "right", "lower", "end", "upper", "lip", "head", "left"]
            made = self.sided("top", corners, names, rounding=[0.0, 0.0, 0.0, r, r, 0.0, 0.0, 0.0])
        elif kind == "chamfer":
            r = float(rng.uniform(0.1, 0.3)) * high * frame.length
            rounding = [r, 0.5 * r, 0.0, 0.0]
            corners = ["foot", "foot", "", ""]
            made = self.sided("top", _box(w, 0.0, high), named, rounding=rounding, corners=corners)
        elif kind == "half-ring":
            radius = [float(rng.uniform(0.4, 0.8)) * w * frame.length, w * frame.length]
            angles = [frame.angle + 180.0, frame.angle + 360.0]
            made = body(
                "top", self.material("top"), "sector", center=frame.at(0.0, w), radii=radius, angles=angles
            )
            self.high = w
            inside = -0.5 * sum(radius) / frame.length, 0.95 * w
        elif kind == "holed":
            hole = {"center": frame.at(0.3 * w, 0.45 * high), "radius": 0.2 * min(w, high) * frame.length}
            made = self.sided("top", _box(w, 0.0, high), named, holes=[hole])
        else:
            s = np.linspace(-w, w, 41)
            if kind == "nose":
                power = float(rng.choice([2.0, 3.0, 4.0]))
                face = [(float(v), 0.1 * high * abs(float(v) / w) ** power) for v in s]
            else:
                face = [(a, -b) for a, b in self.wave(s)]
            ends = frame.places([(w, high), (-w, high)])
            sides = [
                {"name": "foot", "points": frame.places(face)},
                {"name": "right", "to": ends[0]},
                {"name": "head", "to": ends[1]},
                {"name": "left"},
            ]
            made = body("top", self.material("top"), "outline", sides=sides)
        self.add(made, self.high)
        below = "layer" if "layer" in self.words else "base"
        foot = "top.outer" if kind == "half-ring" else "top.foot"
        face = "base.outer" if "ring" in self.words else f"{below}.head"
        self.tables["probe"] += [
            {"name": "top", "body": "top", "point": self.frame.at(*inside)},
            {"name": "base", "body": below, "point": self.frame.at(0.2 * w, -0.1 * self.deep)},
        ]
        sides = [foot, face] if rng.random() < 0.7 else [face, foot]
        made = {"name": "joint", "slave": sides[0], "master": sides[1], "friction": self.friction}
        if self.law != "default":
            made["regularization"] = {"law": self.law}
        self.tables["contact"].append(made)
        if self.bent or "ring" in self.words:
            self.smooth.append("joint")

    def press(self) -> None:
        """Loads and stages."""
        rng, frame, loads, stages = self.rng, self.frame, self.tables["load"], self.tables["stage"]
        w, high = 0.5 * self.wide, self.high
        ring = "half-ring" in self.words
        size = float(rng.uniform(0.001, 0.006)) * self.soft * self.wide * (0.1 if ring else 1.0)
        heads = ["top.start", "top.end"] if ring else ["top.head"]
        kind = (
            "force" if ring else self.chosen("force", "part", "varying", "weight", "moment", "displacement")
        )
        head: object = heads if ring else heads[0]
        if kind == "displacement":
            down = frame.at(0.0, -size / self.soft)
            loads.append(platen("press", head, displacement=down))
        elif kind == "part":
            ends = frame.places([(-0.4 * w, high), (0.3 * w, high)])
            value = size / (0.7 * w) * frame.stress
            part = dict(zip(("from", "to"), ends, strict=True))
            loads.append({"name": "press", "boundary": head, "kind": "pressure", "pressure": value, **part})
        elif kind == "varying":
            (a, b), n = frame.turned(1.0, 0.0), frame.length * w
            text = f"{size / self.wide * frame.stress:.9g}*(1 + 0.3*({a:.12g}*x + {b:.12g}*y)/{n:.9g})"
            loads.append({"name": "press", "boundary": head, "kind": "pressure", "pressure": text})
        elif kind == "weight":
            b = frame.turned(0.0, -size / (self.wide * high), frame.stress / frame.length)
            loads.append({"name": "press", "body": "top", "kind": "body-force", "body-force": b})
        elif kind == "moment":
            moment = float(rng.uniform(-0.08, 0.08)) * size * self.wide * frame.length**2 * frame.stress
            loads.append(platen("press", head, force=frame.force(0.0, -size), moment=moment))
        else:
            loads.append(platen("press", head, force=frame.force(0.0, -size)))
        stages.append({"press": 1.0})
        if self.friction and kind in ("force", "displacement"):
            step = frame.at(0.3 * self.friction * size / self.soft, 0.0)
            push = frame.force(0.4 * self.friction * size, 0.0)
            shear = {"displacement": step} if kind == "displacement" else {"force": push}
            loads.append(platen("shear", head, **shear))
            stages += [{"shear": 1.0}, {"shear": float(rng.choice([0.3, -0.5, -1.0]))}]
            self.words.append("reversed")
        if self.heat:
            self.words.append("heat")
            a, b = frame.turned(0.0, 1.0)
            field = f"20 + 10*({a:.12g}*x + {b:.12g}*y)/{high * frame.length:.9g}"
            loads.append({"name": "warm", "body": "top", "kind": "temperature", "temperature": field})
            stages.append({"warm": 1.0})
        if rng.random() < 0.4:
            self.words.append("unload")
            stages.append({"press": 0.4})


def _box(x: float, low: float, high: float) -> Corners:
    return [(-x, low), (x, low), (x, high), (-x, high)]
