"""Parts of machines and buildings: bearing, cam, pin, pad, plug, fretting, arch, tower."""

from __future__ import annotations

import itertools
from typing import Any

import h5py
import numpy as np
from scipy.integrate import quad

from benchmarks.scenes.bending import STEEL
from benchmarks.scenes.scene import (
    Array,
    Figure,
    Pair,
    Refusal,
    Result,
    Scene,
    Table,
    box,
    case,
    force_at,
    held,
    pair,
    platen,
    polygon,
    pressed,
    probe,
    scene,
    size_of,
    solid,
    weighed,
)
from benchmarks.scenes.scene import body as make_body


def half_disk(name: str, material: str, radius: float) -> Table:
    """One that rests on the origin."""
    return make_body(name, material, "half-disk", center=[0.0, radius], radius=radius, side="lower")


def bearing(count: int, first: float, radius: float, friction: float = 0.0, **rest: Any) -> Table:
    """Evenly spaced rollers of a ``radius``, the ``first`` at an angle (degree), between rings 8 apart, whose
    shaft presses down; with the other tables of a case in ``rest``."""
    bodies = [
        make_body(name, "steel", "annulus", center=[0.0, 0.0], radii=radii)
        for name, radii in (("inner", [12.0, 20.0]), ("outer", [28.0, 36.0]))
    ]
    contacts = []
    for i, angle in enumerate(np.radians(first + 360.0 / count * np.arange(count))):
        center = [24.0 * float(np.cos(angle)), 24.0 * float(np.sin(angle))]
        bodies.append(make_body(f"roller{i}", "steel", "disk", center=center, radius=radius))
        contacts.append(pair(f"in{i}", f"roller{i}.arc", "inner.outer", friction))
        contacts.append(pair(f"out{i}", f"roller{i}.arc", "outer.inner", friction))
    return case(
        "strain",
        {"steel": STEEL},
        bodies,
        support=[held("outer.outer")],
        contact=contacts,
        load=[platen("shaft", "inner.inner", fx=0.0, fy=-400.0)],
        **rest,
    )


@scene
def roller_bearing() -> Scene:
    """Eight rollers between rings, five of them unloaded."""
    given = bearing(8, -90.0, 4.0)
    return Scene("roller_bearing", "roller bearing", given, elements=True)


@scene
def pin_clearance() -> Scene:
    """A pin in the middle of its hole, pulled obliquely."""
    pull = 2500.0 * np.array([np.cos(np.radians(200.0)), np.sin(np.radians(200.0))])
    sides: dict[str, Any] = {"names": ["bottom", "right", "top", "left"]}
    sides["holes"] = [{"center": [30.0, 30.0], "radius": 10.02, "name": "bore"}]
    given = case(
        "stress",
        {"steel": STEEL, "alloy": solid(70e3, 0.33)},
        [
            make_body("pin", "steel", "annulus", center=[30.0, 30.0], radii=[3.0, 10.0]),
            polygon("plate", "alloy", [(0, 0), (90, 0), (90, 60), (0, 60)], **sides),
        ],
        support=[held("plate.right")],
        contact=[pair("fit", "pin.outer", "plate.bore")],
        load=[platen("pull", "pin.inner", fx=float(pull[0]), fy=float(pull[1]))],
    )
    return Scene("pin_clearance", "pin in a hole", given, elements=True)


@scene
def wood_roller() -> Scene:
    """A steel roller on wood, its grain at 35 degrees."""
    wood = {"E1": 12e3, "E2": 800.0, "G12": 700.0, "nu12": 0.4, "angle": 35.0}
    given = case(
        "stress",
        {"steel": STEEL, "wood": wood},
        [half_disk("roller", "steel", 30.0), box("board", "wood", (-45.0, 45.0), (-50.0, 0.0))],
        support=[held("board.bottom")],
        contact=[pair("tread", "roller.arc", "board.top")],
        load=[platen("press", "roller.flat", ux=0.0, fy=-80.0)],
        probe=[probe("beside", "board", 12.0, 0.0)],
    )
    return Scene("wood_roller", "orthotropic", given, elements=True)


@scene
def rubber_pad() -> Scene:
    """A roller driven into a thin pad of nu = 0.49 that sticks to its base; normals are those of the pad."""
    given = case(
        "strain",
        {"steel": STEEL, "rubber": solid(3.0, 0.49)},
        [
            make_body("roller", "steel", "annulus", center=[0.0, 20.0], radii=[5.0, 20.0]),
            box("pad", "rubber", (-30.0, 30.0), (-8.0, 0.0)),
        ],
        support=[held("pad.bottom")],
        contact=[pair("tread", "roller.outer", "pad.top")],
        load=[platen("press", "roller.inner", ux=0.0, uy=-0.3)],
        probe=[probe("beside", "pad", 8.0, 0.0)],
    )
    return Scene("rubber_pad", "incompressible", given, elements=True, straight_walls=True)


def cam(count: int) -> Array:
    """Places (count, 2) around a cam in metres, its nose at 50 degrees."""
    angle = 2.0 * np.pi * np.arange(count) / count
    radius = 0.03 + 0.008 * np.cos(angle) + 0.002 * np.cos(2.0 * angle)
    angle = angle + np.radians(50.0)
    return np.asarray(radius[:, None] * np.column_stack([np.cos(angle), np.sin(angle)]))


@scene
def cam_follower() -> Scene:
    """A cam by a curve through 72 points under a flat follower, in metres and pascals."""
    points, top = cam(72), float(cam(200_000)[:, 1].max())
    side = {"name": "lobe", "points": [*points.tolist(), points[0].tolist()]}
    bore = {"center": [0.0, 0.0], "radius": 0.01, "name": "bore"}
    given = case(
        "strain",
        {"steel": solid(206e9, 0.29)},
        [
            make_body("cam", "steel", "outline", sides=[side], holes=[bore]),
            box("follower", "steel", (-0.02, 0.045), (top, top + 0.02)),
        ],
        support=[held("cam.bore")],
        contact=[pair("tip", "cam.lobe", "follower.bottom")],
        load=[platen("push", "follower.top", ux=0.0, fy=-1.5e5)],
    )
    return Scene(
        "cam_follower", "cam", given, [Figure("force", force_at("tip", 1, -1.0), 1.5e5)], elements=True
    )


@scene
def tapered_plug() -> Scene:
    """A plug of half angle 8 degrees driven between two blocks; all of its flanks slip."""
    angle, friction, force = np.radians(8.0), 0.15, 300.0

    def high(x: float) -> float:
        return 8.0 - float(np.tan(angle)) * x

    plug = [(-35.0, -high(-35.0)), (25.0, -high(25.0)), (25.0, high(25.0)), (-35.0, high(-35.0))]
    upper = [(-20.0, high(-20.0)), (15.0, high(15.0)), (15.0, 40.0), (-20.0, 40.0)]
    lower: list[Pair] = [(x, -y) for x, y in upper]
    names = ["face", "right", "back", "left"]
    given = case(
        "strain",
        {"steel": STEEL},
        [
            polygon("plug", "steel", plug, names=["low", "tip", "high", "back"]),
            polygon("upper", "steel", upper, names=names),
            polygon("lower", "steel", lower, names=names),
        ],
        support=[held("upper.back"), held("lower.back")],
        contact=[
            pair("above", "upper.face", "plug.high", friction),
            pair("below", "lower.face", "plug.low", friction),
        ],
        load=[platen("drive", "plug.back", fx=force, uy=0.0)],
    )
    sine, cosine = float(np.sin(angle)), float(np.cos(angle))
    across = 0.5 * force * (cosine - friction * sine) / (sine + friction * cosine)
    figures = [
        figure
        for name, sign in (("above", 1.0), ("below", -1.0))
        for figure in (
            Figure(f"along {name}", size_of(name), 0.5 * force),
            Figure(f"across {name}", force_at(name, 1, sign), across),
        )
    ]
    return Scene("tapered_plug", "wedge with friction", given, figures)


@scene
def fretting_bulk() -> Scene:
    """Partial slip with a bulk stress in the plate, which shifts what sticks (Nowell and Hills 1987)."""
    modulus, radius, friction, shift = 210e3 / (1.0 - 0.3**2) / 2.0, 50.0, 0.5, 0.1
    peak = modulus / (2.0 * radius)  # of a half-width of 1
    load = 0.5 * np.pi * peak
    given = case(
        "strain",
        {"steel": STEEL},
        [half_disk("pad", "steel", radius), box("plate", "steel", (-60.0, 60.0), (-60.0, 0.0))],
        support=[held("plate.bottom", "uy"), held("plate.left", "ux")],
        contact=[pair("fret", "pad.arc", "plate.top", friction)],
        load=[
            platen("press", "pad.flat", fy=-load),
            platen("shear", "pad.flat", fx=-0.4 * friction * load),
            {
                "name": "bulk",
                "boundary": "plate.right",
                "kind": "traction",
                "traction": [4.0 * friction * peak * shift, 0.0],
            },
        ],
        stage=[{"press": 1.0}, {"shear": 1.0, "bulk": 1.0}],
    )

    def stuck(result: Result) -> Array:
        with h5py.File(result.folder / "run.h5") as file:
            one = file["contacts/fret"]
            return np.asarray(one["points"][:][one["status"][-1] == 1, 0])

    return Scene(
        "fretting_bulk",
        "fretting",
        given,
        [
            Figure("peak", lambda r: r.peak("fret"), peak, 3.0),
            Figure("shear", size_of("fret"), 0.4 * friction * load),
            Figure("half of stick", lambda r: 0.5 * float(np.ptp(stuck(r))), float(np.sqrt(0.6)), 3.0),
            Figure("shift", lambda r: 0.5 * abs(float(stuck(r).min() + stuck(r).max())), shift, 3.0, 1.0),
        ],
    )


@scene
def fretting_cycle() -> Scene:
    """Work dissipated in a cycle of the shear, by the difference of two normal contacts (Jaeger 1998)."""
    modulus, radius, friction = 70e3 / (1.0 - 0.33**2) / 2.0, 40.0, 0.4
    load = float(np.pi * 1.2**2 * modulus / (4.0 * radius))
    shear = 0.6 * friction * load

    def approach(force: float) -> float:
        """Up to what is linear in the force, which makes no loop."""
        return float(-(force * np.log(force) - force) / (np.pi * modulus))

    def shift(force: float) -> float:
        return friction * (approach(load) - approach(load - force / friction))

    loop = abs(8.0 * quad(shift, 0.0, shear)[0] - 4.0 * shear * shift(shear))
    given = case(
        "strain",
        {"alloy": solid(70e3, 0.33)},
        [half_disk("pad", "alloy", radius), box("plate", "alloy", (-50.0, 50.0), (-50.0, 0.0))],
        support=[held("plate.bottom")],
        contact=[pair("fret", "pad.arc", "plate.top", friction)],
        load=[platen("press", "pad.flat", fy=-load), platen("shear", "pad.flat", fx=shear)],
        stage=[{"press": 1.0}, {"shear": 1.0}, {"shear": -1.0}, {"shear": 1.0}],
    )

    def dissipated(result: Result) -> float:
        with h5py.File(result.folder / "run.h5") as file:
            work, place = file["contacts/fret/dissipated_work"][:], file["path/position"][:]
        return float(work[-1] - work[np.flatnonzero(place <= 2.0 + 1e-9)[-1]])

    return Scene("fretting_cycle", "fretting", given, [Figure("dissipated", dissipated, loop, 3.0)])


@scene
def tower_tips() -> Scene:
    """A block that is pressed, then pushed near its top until it tips, all turned by 23 degrees."""
    turn = np.radians(23.0)
    axes = np.array([[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]])
    tower = np.array([(0, 0), (20, 0), (20, 50), (20, 60), (0, 60)]) @ axes
    ground = np.array([(-60, -60), (80, -60), (80, 0), (-60, 0)]) @ axes
    given = case(
        "strain",
        {"stone": solid(30e3, 0.2), "soil": solid(60e3, 0.25)},
        [
            polygon("tower", "stone", tower.tolist(), names=["foot", "right", "push", "top", "left"]),
            polygon("ground", "soil", ground.tolist(), names=["bottom", "right", "top", "left"]),
        ],
        support=[held("ground.bottom")],
        contact=[pair("base", "tower.foot", "ground.top", 0.6)],
        load=[pressed("press", "tower.top", 2.0), pressed("shove", "tower.push", 1.0)],
        stage=[{"press": 1.0}, {"shove": 1.0}],
    )
    # 40 at the middle of the foot against 10 at a height of 55.
    refusal = Refusal(("tip", "tilt", "turn", "rotat"), 1.0 + 400.0 / 550.0)
    return Scene("tower_tips", "stack of bricks that slides or tips", given, refusal=refusal)


@scene
def stone_arch() -> Scene:
    """Five stones of an arch on two abutments."""
    return arch("stone_arch", 5)


def arch(name: str, count: int) -> Scene:
    """Stones of an arch on two abutments, of their own weight, with friction in all joints."""
    edges, weight, last = np.linspace(180.0, 0.0, count + 1).tolist(), 2.5e-5, count - 1
    bodies = [
        make_body(f"stone{i}", "stone", "sector", center=[0.0, 0.0], radii=[40.0, 52.0], angles=[end, start])
        for i, (start, end) in enumerate(itertools.pairwise(edges))
    ]
    bodies += [
        box("left", "stone", (-62.0, -30.0), (-20.0, 0.0)),
        box("right", "stone", (30.0, 62.0), (-20.0, 0.0)),
    ]
    contacts = [pair(f"joint{i}", f"stone{i}.end", f"stone{i - 1}.start", 0.7) for i in range(1, count)]
    contacts += [
        pair("from", "stone0.end", "left.top", 0.7),
        pair("to", f"stone{last}.start", "right.top", 0.7),
    ]
    given = case(
        "strain",
        {"stone": solid(20e3, 0.2)},
        bodies,
        support=[held("left.bottom"), held("right.bottom")],
        contact=contacts,
        load=[weighed(f"weight{i}", f"stone{i}", 0.0, -weight) for i in range(count)],
        stage=[{f"weight{i}": 1.0 for i in range(count)}],
    )
    half = 0.25 * weight * float(np.pi) * (52.0**2 - 40.0**2)
    return Scene(
        name,
        "arch",
        given,
        [Figure("left", force_at("from", 1), half), Figure("right", force_at("to", 1), half)],
    )
