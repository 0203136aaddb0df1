"""Random scenes of one body on another, or on a rigid obstacle, with one or two of what a case may have.

Drawn for ``random_scenes.py --features``: rings, orthotropic and nearly incompressible materials, springs,
bonds, heat, plates that turn, gaps as expressions, rigid obstacles, parts of boundaries, weight, loads that
turn back, interference.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from benchmarks.scenes.parts import body as make_body
from benchmarks.scenes.parts import box, case, held, on_disk, on_plane, pair, platen, polygon, probe
from benchmarks.scenes.scene import Table

FEATURES = (
    "ring",
    "orthotropic",
    "soft",
    "spring",
    "bond",
    "heat",
    "plate",
    "gap",
    "obstacle",
    "part",
    "weight",
    "loop",
    "fit",
)
FLAT = ("bond", "gap", "part")
"""Features that want flat faces on each other."""


def featured(number: int) -> tuple[Table, list[str], list[str]]:
    """The case of a number, the contacts that no sharp corner can reach, and its features."""
    rng = np.random.default_rng([11, number])
    first = FEATURES[number % len(FEATURES)]
    second = str(rng.choice(FEATURES))
    chosen = [first] if rng.random() < 0.5 or second == first else [first, second]
    if "fit" in chosen:
        return *_fit(rng), ["fit"]
    made, smooth = _on_base(rng, chosen)
    return made, smooth, chosen


def _material(rng: np.random.Generator, chosen: list[str]) -> Table:
    E = float(10.0 ** rng.uniform(1.0, 5.5))
    alpha = {"alpha": 1e-5} if "heat" in chosen else {}
    if "orthotropic" in chosen:
        by = float(rng.uniform(1.5, 12.0))
        rest = {"E3": E / by, "nu13": 0.3, "nu23": 0.3}
        angle = float(rng.uniform(-90.0, 90.0))
        return {
            "E1": E,
            "E2": E / by,
            "G12": 0.4 * E / np.sqrt(by),
            "nu12": 0.3,
            **rest,
            "angle": angle,
            **alpha,
        }
    nu = float(rng.uniform(0.0, 0.42))
    if "soft" in chosen:
        nu = float(rng.choice([0.48, 0.495, 0.4999]))
    return {"E": E, "nu": nu, **alpha}


def _modulus(material: Table) -> float:
    return float(material.get("E", material.get("E2")))


def _on_base(rng: np.random.Generator, chosen: list[str]) -> tuple[Table, list[str]]:
    """A body on a base, pressed from above."""
    materials = {"one": _material(rng, chosen), "two": _material(rng, [])}
    if "heat" in chosen:
        materials["two"].pop("alpha", None)
    wide, high = float(rng.uniform(3.0, 9.0)), float(rng.uniform(2.0, 5.0))
    kinds = ["box", "round"] if set(chosen) & set(FLAT) else ["box", "round", "half", "disk"]
    kind = "ring" if "ring" in chosen else str(rng.choice(kinds))
    if "bond" in chosen:
        kind = "box"
    top, low, up, height = _top(rng, kind, wide, high)
    friction: Any = float(rng.choice([0.0, 0.0, 0.3]))
    if "loop" in chosen:
        friction = 0.3
    soft = min(map(_modulus, materials.values()))
    press = 0.004 * soft * wide * (0.1 if kind == "ring" else 1.0)
    contacts, loads, stages, supports = [], [], [], []
    bodies = [top]
    extra: Table = {}
    if "gap" in chosen and "bond" not in chosen and kind in ("box", "round"):
        extra["gap"] = f"x**2/(2*{float(rng.uniform(20.0, 200.0)):.4g})"
    if "obstacle" in chosen:
        materials.pop("two")
        center = (0.0, -20.0)
        if rng.random() < 0.5:
            contacts.append(on_plane("joint", f"top.{low}", (0.0, 0.0), (0.0, 1.0), friction))
        else:
            contacts.append(on_disk("joint", f"top.{low}", center, 20.0, friction))
        contacts[0].update(extra)
    else:
        bodies.insert(0, box("base", "two", (-wide, wide), (-high, 0.0)))
        if "bond" in chosen:
            friction = "bonded"
        elif "part" in chosen and kind == "box":
            extra |= {"from": [-0.3 * wide, 0.0], "to": [0.3 * wide, 0.0]}
        contacts.append(pair("joint", f"top.{low}", "base.top", friction, **extra))
        if "spring" in chosen:
            k = 0.05 * soft / high
            supports.append({"boundary": "base.bottom", "spring": [k, k]})
        else:
            supports.append(held("base.bottom"))
    law = str(rng.choice(["default", "hyperbolic", "default"]))
    if law != "default" and friction != "bonded":
        extra["regularization"] = {"law": law}
        contacts[0] |= extra
    down = f"top.{up}"
    if "plate" in chosen and kind not in ("ring", "disk"):
        e = float(rng.uniform(0.0, 0.1)) * wide
        plate = platen("press", down, fy=-press, ux=0.0, rotation="free", hinge=[e, height])
        loads.append(plate)
    elif "part" in chosen and kind in ("box", "round"):
        part = {"from": [-0.2 * wide, height], "to": [0.2 * wide, height]}
        loads.append(
            {"name": "press", "boundary": down, "kind": "pressure", "pressure": press / (0.4 * wide), **part}
        )
        supports.append({"body": "top", "near": [0.0, height], "ux": 0.0})
    elif kind in ("disk", "ring"):
        plane = {"kind": "plane", "point": [0.0, height], "normal": [0.0, -1.0]}
        laws = {key: extra[key] for key in ("regularization",) if key in extra}
        contacts.append({"name": "lid", "slave": f"top.{low}", "obstacle": plane, "friction": 0.0, **laws})
        loads.append({"name": "press", "obstacle": "lid", "kind": "obstacle", "fy": -press, "ux": 0.0})
    else:
        loads.append(platen("press", down, fy=-press, ux=0.0))
    stages.append({"press": 1.0})
    if "weight" in chosen:
        b = press / (wide * high)
        loads.append({"name": "weight", "body": "top", "kind": "body-force", "body-force": [0.0, -b]})
        stages[0]["weight"] = 1.0
    if "heat" in chosen:
        field: Any = 20.0 if rng.random() < 0.5 else f"20 + 4*x/{wide}"
        loads.append({"name": "warm", "body": "top", "kind": "temperature", "temperature": field})
        stages.append({"warm": 1.0})
    if "loop" in chosen:
        stages += [{"press": 0.4}, {"press": 1.0}]
    made = case(
        str(rng.choice(["strain", "stress"])),
        materials,
        bodies,
        support=supports,
        contact=contacts,
        load=loads,
        stage=stages,
        probe=[probe("middle", "top", 0.0, height - 0.05 * high if kind == "ring" else 0.5 * height)],
    )
    smooth = [one["name"] for one in contacts if kind != "box" and "gap" not in one and friction != "bonded"]
    return made, smooth


def _top(rng: np.random.Generator, kind: str, wide: float, high: float) -> tuple[Table, str, str, float]:
    """The upper body, its lower and upper boundary, its height."""
    if kind == "box":
        return box("top", "one", (-wide / 2, wide / 2), (0.0, high)), "bottom", "top", high
    if kind == "round":
        points = [(-wide / 2, 0.0), (wide / 2, 0.0), (wide / 2, high), (-wide / 2, high)]
        radius = float(rng.uniform(0.1, 0.4)) * high
        names = ["low", "right", "up", "left"]
        return polygon("top", "one", points, names=names, rounding=[radius] * 4), "low", "up", high
    radius = 0.5 * high
    if kind == "disk":
        return make_body("top", "one", "disk", center=[0.0, radius], radius=radius), "arc", "arc", high
    if kind == "ring":
        radii = [float(rng.uniform(0.5, 0.9)) * radius, radius]
        return make_body("top", "one", "annulus", center=[0.0, radius], radii=radii), "outer", "outer", high
    made = make_body("top", "one", "half-disk", center=[0.0, high], radius=high, side="lower")
    return made, "arc", "flat", high


def _fit(rng: np.random.Generator) -> tuple[Table, list[str]]:
    """A shaft, hollow or not, in a ring, with interference or pressed down in a clearance."""
    materials = {"one": _material(rng, []), "two": _material(rng, [])}
    r, outer = 1.0, float(rng.uniform(1.5, 3.0))
    tight = rng.random() < 0.5
    clearance = 0.0 if tight else float(10.0 ** rng.uniform(-3.0, -1.5))
    if rng.random() < 0.5:
        shaft = make_body("shaft", "one", "annulus", center=[0.0, -clearance], radii=[0.4, r])
        edge = "outer"
    else:
        shaft = make_body("shaft", "one", "disk", center=[0.0, -clearance], radius=r)
        edge = "arc"
    ring = make_body("ring", "two", "annulus", center=[0.0, 0.0], radii=[r + clearance, outer])
    friction = float(rng.choice([0.0, 0.2]))
    contact = pair("joint", f"shaft.{edge}", "ring.inner", friction)
    loads: list[Table] = []
    stages: list[Table] = []
    if tight:
        contact["interference"] = 1e-3
    else:
        soft = min(map(_modulus, materials.values()))
        b = 1e-3 * soft / np.pi
        loads.append({"name": "pull", "body": "shaft", "kind": "body-force", "body-force": [0.0, -b]})
        stages.append({"pull": 1.0})
    rest = {"load": loads, "stage": stages} if loads else {}
    support = [held("ring.outer")]
    made = case(
        str(rng.choice(["strain", "stress"])),
        materials,
        [ring, shaft],
        support=support,
        contact=[contact],
        **rest,
    )
    made["probe"] = [probe("edge", "shaft", 0.0, -clearance - 0.95 * r)]
    return made, [] if tight else ["joint"]
